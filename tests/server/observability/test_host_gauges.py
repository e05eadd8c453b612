"""Gauges of files, memory and version."""

from pathlib import Path

from server.observability.host_gauges import host_gauges, resident_bytes
from server.observability.metric_samples import Family
from server.platform.version import service_version


def told(database: Path) -> dict[str, Family]:
    return {family.name: family for family in host_gauges(database)}


def test_bytes_are_those_of_the_files(tmp_path: Path) -> None:
    database = tmp_path / "a.db"
    database.write_bytes(bytes(10))
    (tmp_path / "a.db-wal").write_bytes(bytes(3))
    for name, sizes in {"index": (5, 6), "snapshots": (7,)}.items():
        folder = tmp_path / f"a.db.{name}"
        folder.mkdir()
        for number, size in enumerate(sizes):
            (folder / f"{number}.json").write_bytes(bytes(size))
    told_sizes = {labels[0][1]: size for (_, labels), size in told(database)["urquhart_storage_bytes"].samples.items()}
    assert told_sizes == {"database": 10, "wal": 3, "index": 11, "jobs": 0, "snapshots": 7}


def test_there_is_no_newest_snapshot_before_the_first(tmp_path: Path) -> None:
    name = "urquhart_newest_snapshot_timestamp_seconds"
    assert told(tmp_path / "a.db")[name].samples == {}
    folder = tmp_path / "a.db.snapshots"
    folder.mkdir()
    (folder / "one.db").write_bytes(b"without a manifest it does not exist")
    assert told(tmp_path / "a.db")[name].samples == {}
    (folder / "one.json").write_text("{}")
    assert told(tmp_path / "a.db")[name].samples == {(name, ()): (folder / "one.json").stat().st_mtime}


def test_a_database_that_does_not_exist_has_no_bytes(tmp_path: Path) -> None:
    families = told(tmp_path / "no folder" / "a.db")
    assert set(families["urquhart_storage_bytes"].samples.values()) == {0.0}
    assert "urquhart_disk_free_bytes" not in families


def test_memory_and_version_are_told(tmp_path: Path) -> None:
    assert resident_bytes() > 1e6
    ((_, labels),) = told(tmp_path / "a.db")["urquhart_build_info"].samples
    assert dict(labels)["version"] == service_version()
