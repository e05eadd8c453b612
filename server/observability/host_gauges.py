"""Gauges of the host, read at each scrape: bytes on the disk, the newest snapshot, memory, and which version runs."""

import os
import platform
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from server.observability.metric_samples import Family, Key
from server.platform.version import service_version
from server.store.schema_version import expected_revision

_PAGE: Final = os.sysconf("SC_PAGE_SIZE")
_FOLDERS: Final = ("index", "jobs", "snapshots")
"""What lies in folders of its own beside the database: `<database file>.index`, and so on."""


def resident_bytes() -> float:
    """Memory of this process that is not swapped out, in bytes. 0 where the system does not tell."""
    try:
        return float(int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * _PAGE)
    except (OSError, IndexError, ValueError):
        return 0.0


def host_gauges(database: Path) -> list[Family]:
    """Gauges of the version that runs and of the files of a database, which need not exist.

    A gauge that cannot be read is left out: there is no newest snapshot before the first one.
    """
    file = database.resolve()
    labels = (("python", platform.python_version()), ("schema", expected_revision()), ("version", service_version()))
    build = Family(
        "urquhart_build_info",
        "gauge",
        "Always 1; the labels say which version answers.",
        {("urquhart_build_info", labels): 1.0},
    )
    parts = {"database": _size(file), "wal": _size(file.with_name(f"{file.name}-wal"))}
    parts |= {name: _size_of_files(file.with_name(f"{file.name}.{name}")) for name in _FOLDERS}
    storage = Family(
        "urquhart_storage_bytes",
        "gauge",
        "Bytes of the files of the database.",
        {("urquhart_storage_bytes", (("part", name),)): float(size) for name, size in parts.items()},
    )
    return [build, storage, *_disk_free(file), _newest_snapshot(file.with_name(f"{file.name}.snapshots"))]


def _disk_free(file: Path) -> Iterator[Family]:
    try:
        free = shutil.disk_usage(file.parent).free
    except OSError:
        return
    yield _gauge("disk_free_bytes", "Bytes free for the service on the disk of the database.", float(free))


def _newest_snapshot(folder: Path) -> Family:
    # The manifest is written last: without one, a snapshot does not exist.
    moments = [_completed(Path(entry.path)) for entry in _entries(folder) if entry.name.endswith(".json")]
    name = "urquhart_newest_snapshot_timestamp_seconds"
    newest: dict[Key, float] = {(name, ()): max(moments)} if any(moments) else {}
    return Family(name, "gauge", "When the newest snapshot was completed, in seconds since 1970.", newest)


def _gauge(name: str, about: str, value: float) -> Family:
    return Family(f"urquhart_{name}", "gauge", about, {(f"urquhart_{name}", ()): value})


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def _completed(manifest: Path) -> float:
    try:
        return manifest.stat().st_mtime
    except OSError:
        return 0.0  # it was deleted meanwhile


def _size_of_files(folder: Path) -> int:
    return sum(_size(Path(entry.path)) for entry in _entries(folder))


def _entries(folder: Path) -> list[os.DirEntry[str]]:
    """The files in a folder, none if it does not exist. One may be gone when it is looked at."""
    try:
        with os.scandir(folder) as entries:
            return [entry for entry in entries if entry.is_file()]
    except OSError:
        return []
