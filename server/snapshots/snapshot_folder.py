"""The files of snapshots in a folder beside the database: named, published, listed, checked, cleaned up.

A snapshot is `<name>.db` and its manifest `<name>.json`, which is written last and removed first: without a manifest, a
snapshot does not exist. Snapshots in progress are in the folder `making`.
"""

import hashlib
import logging
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from server.errors import Conflict, InvalidField, NotFound, StorageDamaged
from server.platform.disk_errors import disk_errors
from server.platform.file_locks import try_lock
from server.schemas.snapshots import Snapshot
from urquhart.index.segment_file import sync

_FILE: Final = ".db"
_MANIFEST: Final = ".json"
_LONGEST: Final = 200
"""Bytes of a name. File systems allow 255 including the suffix."""
_PIECE: Final = 1 << 20
_log = logging.getLogger(__name__)


class SnapshotFolder:
    """The folder `<database file>.snapshots`, created with the first snapshot."""

    def __init__(self, database: Path) -> None:
        """Beside a database file, which need not exist."""
        file = database.resolve()
        self.path = file.with_name(f"{file.name}.snapshots")
        self.making = self.path / "making"

    def file(self, name: str) -> Path:
        """Path of a snapshot's database."""
        return self.path / f"{name}{_FILE}"

    def manifest(self, name: str) -> Path:
        """Path of a snapshot's manifest."""
        return self.path / f"{name}{_MANIFEST}"

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Lock the creation of snapshots, across processes, and remove left-over files.

        Raises Conflict and OSError.
        """
        self.path.mkdir(exist_ok=True)
        # The open file holds the lock, so it is free when the process ends, however it ends.
        with (self.path / "snapshot.lock").open("a") as file:
            if not try_lock(file):
                raise Conflict("Another snapshot is being created. Wait until it is complete.")
            self._clean_up()
            self.making.mkdir(0o700)  # a copy gets the database's permissions only when it is complete
            try:
                yield
            finally:
                shutil.rmtree(self.making)

    def clean_up(self) -> None:
        """Remove left-over files of processes that ended. Does nothing while another one creates a snapshot. Raises
        OSError.
        """
        if self.path.is_dir():
            with suppress(Conflict), self.turn():
                pass

    def publish(self, written: Path, snapshot: Snapshot) -> None:
        """Give a complete file its name and then its manifest, durably. Nothing is left if that fails. Raises
        OSError.
        """
        prepared = self.making / "manifest"
        file = self.file(snapshot.name)
        try:
            written.rename(file)
            prepared.write_bytes(snapshot.document())
            shutil.copymode(file, prepared)  # it names all collections
            sync(prepared)
            sync(self.path)
            prepared.rename(self.manifest(snapshot.name))
        except BaseException:
            file.unlink(missing_ok=True)
            raise
        sync(self.path)

    def all(self) -> list[Snapshot]:
        """All snapshots, oldest first. Raises StorageError."""
        with disk_errors(self.path):
            names = [path.stem for path in self.path.glob(f"*{_MANIFEST}")] if self.path.is_dir() else []
            found = [snapshot for name in names if (snapshot := self._read(name)) is not None]
        return sorted(found, key=lambda snapshot: (snapshot.created, snapshot.name))

    def get(self, name: str) -> Snapshot:
        """The snapshot of that name. Raises NotFound and StorageError."""
        with disk_errors(self.path):
            snapshot = self._read(name) if is_name(name) else None
        if snapshot is None:
            raise NotFound("snapshot", name)
        return snapshot

    def remove(self, name: str) -> None:
        """Delete a snapshot. Readers that have it open can read on. Raises NotFound and StorageError."""
        self.get(name)
        with disk_errors(self.path):
            self.manifest(name).unlink(missing_ok=True)
            sync(self.path)
            self.file(name).unlink(missing_ok=True)

    def _read(self, name: str) -> Snapshot | None:
        try:
            snapshot = read_manifest(self.manifest(name))
        except StorageDamaged as error:
            _log.warning("%s", error)
            return None
        return snapshot if snapshot is not None and snapshot.name == name and self.file(name).is_file() else None

    def _clean_up(self) -> None:
        if self.making.exists():
            shutil.rmtree(self.making)
        for path in self.path.glob(f"*{_FILE}"):
            if not self.manifest(path.stem).exists():
                path.unlink(missing_ok=True)


def is_name(name: str) -> bool:
    """Whether a file of that name can be in the folder and nowhere else."""
    return bool(name) and "/" not in name and "\0" not in name and len(name.encode()) <= _LONGEST


def check_name(name: str) -> None:
    """Raise InvalidField if a name is too long for a file."""
    if not is_name(name):
        raise InvalidField(f"is too long for a file: at most {_LONGEST} bytes", code="too_long", pointer="/name")


def read_manifest(path: Path) -> Snapshot | None:
    """The manifest in a file, None if there is none. Raises StorageDamaged and OSError."""
    try:
        return Snapshot.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except ValidationError as error:
        raise StorageDamaged(f"{path.name} is not the manifest of a snapshot. It was not changed.") from error


def sha256(path: Path, *, between: Callable[[bytes], object] = len) -> str:
    """SHA-256 of a file, in hexadecimal. `between` is called with each piece of it. Raises OSError."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
            between(piece)
    return digest.hexdigest()
