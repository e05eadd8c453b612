"""Restore a snapshot: verified first, prepared beside the database, and put in its place in one step.

If this is interrupted, either the old database or the new one is in place.
"""

import logging
import os
import shutil
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from server.checks.integrity import file_discrepancies
from server.collections.registry import get_collection
from server.errors import Conflict, NotADatabase, NotFound, StorageDamaged, StorageUnavailable
from server.index.derived import config_of
from server.index.segment_folder import SegmentFolder
from server.problem_types import document
from server.schemas.snapshots import Snapshot
from server.snapshots.snapshot_folder import SnapshotFolder, is_name, read_manifest, sha256
from server.snapshots.snapshots import moment_name
from server.store import migrations_runner
from server.store.feature_backfill import bring_up_to_date
from server.store.repositories.collections import Collections
from server.store.repositories.jobs import Jobs
from server.store.repositories.segments import Segments
from server.store.sqlite.database import Database
from server.store.sqlite.database_lock import exclusive
from server.store.sqlite.sqlite_errors import storage_errors
from urquhart.index.segment_file import SegmentDamaged, sync

_BESIDE: Final = ("-wal", "-journal", "-shm")
"""Files that SQLite keeps beside a database, and would apply to any other file of the same name."""
_PATIENCE: Final = 2.0
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RestoreSource:
    """A snapshot's file, and its expected checksum: from its manifest, from the caller, or none."""

    file: Path
    manifest: Snapshot | None
    checksum: str | None


@dataclass(frozen=True, slots=True)
class RestoreReport:
    """The result of a restore: where the old database is now, and how many unfinished jobs were ended."""

    aside: Path | None
    jobs_ended: int


def find(database: Path, wanted: str, checksum: str | None = None) -> RestoreSource:
    """The snapshot of that name beside a database, or else the file of that name. Raises NotFound and StorageError."""
    folder = SnapshotFolder(database)
    if is_name(wanted) and folder.manifest(wanted).is_file() and folder.file(wanted).is_file():
        file = folder.file(wanted)
    elif Path(wanted).is_file():
        file = Path(wanted)
    else:
        raise NotFound("snapshot", wanted)
    with storage_errors(file):
        manifest = read_manifest(file.with_suffix(".json"))
    if checksum is None and manifest is not None:
        checksum = manifest.sha256
    return RestoreSource(file, manifest, checksum.lower() if checksum else None)


def verify(source: RestoreSource) -> str:
    """Verify that a snapshot is complete and can be read. Returns its checksum. Raises StorageError and Conflict."""
    _no_log_beside(source.file)
    with storage_errors(source.file):
        found = sha256(source.file)
    _check_sum(source, found)
    _prove(source, source.file)
    return found


def restore(source: RestoreSource, path: Path, *, force: bool = False, discard: bool = False) -> RestoreReport:
    """Put a snapshot in the place of the database at `path`, upgraded to this version's schema and features.

    Args:
        force: also where there is a database already; it is put aside as `<file>.before-restore-<time>`,
        discard: unless it is not to be kept.

    Raises:
        Conflict: there is a database and `force` is not said, or somebody has it open.
        StorageError: the snapshot is not sound, or cannot be written here. The old database is as it was.
    """
    path = path.resolve()
    _no_log_beside(source.file)
    with storage_errors(path), exclusive(path):
        _mend(path)
        if path.exists() and not force:
            raise Conflict(f"{path} exists already. Use --force to set it aside and restore in its place.")
        with _workshop(path) as folder:
            fresh = folder / path.name
            with fresh.open("xb") as copy:
                found = sha256(source.file, between=copy.write)
            _check_sum(source, found)
            _fold(fresh)
            _prove(source, fresh)
            ended = _make_ready(fresh)
            _belong(fresh, path)
            sync(fresh)
            aside = _swap(fresh, path, discard=discard)
    return RestoreReport(aside, ended)


def forget_unusable(database: Database) -> int:
    """Remove segments that are missing or damaged from the list. Returns their number. The service rebuilds them."""
    folder, dropped = SegmentFolder(database), 0
    with database.write() as session:
        for key, collection_id, _ in Collections(session).revisions():
            config, segments = config_of(get_collection(session, collection_id)), Segments(session, key)
            for listed in segments.chain():
                try:
                    segment = folder.open(listed, key, config)
                    if segment.file is not None:
                        segment.file.check()
                except (SegmentDamaged, OSError) as error:
                    _log.info("segment %s is rebuilt: %s", listed.name, error)
                    dropped += segments.drop_from(listed.name)
                    break
    return dropped


def _check_sum(source: RestoreSource, found: str) -> None:
    if source.checksum is not None and found != source.checksum:
        raise StorageDamaged(
            f"{source.file} has changed: its SHA-256 is {found}, but the manifest says {source.checksum}. Use another "
            "copy."
        )


def _no_log_beside(file: Path) -> None:
    log = file.with_name(f"{file.name}-wal")
    if _has_content(log):
        raise Conflict(
            f"{file} is a database in use, or one that was not closed ({log.name} is beside it). Restore a snapshot "
            "instead."
        )


def _prove(source: RestoreSource, file: Path) -> None:
    """Raise StorageError unless a file is an intact database of this service that contains what its manifest says."""
    copy = Database(file, read_only=True)
    try:
        revision = migrations_runner.current_revision(copy)
        if revision is None:
            raise NotADatabase(f"{source.file} is an empty database, not one of this service.")
        for finding in file_discrepancies(copy):
            raise StorageDamaged(f"{source.file} is damaged: {finding.what}. Use another snapshot.")
        with copy.read() as session:
            contents = Collections(session).contents()
    finally:
        copy.dispose()
    if source.manifest is not None:
        told = [(of.id, of.revision, of.submaps) for of in source.manifest.collections]
        if (revision, contents) != (source.manifest.schema_, told):
            raise StorageDamaged(f"{source.file} does not contain what its manifest says. Use another snapshot.")


def _make_ready(file: Path) -> int:
    """Upgrade a copy and end its unfinished jobs, in one file without a log. Returns the number of these jobs."""
    store = Database(file)
    try:
        bring_up_to_date(store)
        problem = document(Conflict("The database was restored to an earlier state during this request."))
        with store.write() as session:
            ended = Jobs(session).end_unfinished(problem)
    finally:
        store.dispose()
    _fold(file)
    return ended


def _fold(file: Path) -> bool:
    """Fold a log into its database, which needs exclusive access. Returns whether SQLite can read it at all."""
    if not _has_header(file):
        return False
    try:
        with closing(sqlite3.connect(f"{file.as_uri()}?mode=rw", uri=True, timeout=_PATIENCE)) as connection:
            return bool(connection.execute("PRAGMA journal_mode = DELETE").fetchone()[0] == "delete")
    except sqlite3.DatabaseError as error:
        code = (error.sqlite_errorcode or 0) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise Conflict(f"{file} is open in another program. Close it and try again.") from error
        if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
            return False
        raise StorageUnavailable(f"{file} cannot be written: {error}.") from error


def _has_header(file: Path) -> bool:
    """Whether a file begins like a database with the log beside it. SQLite deletes the log of any other file."""
    log = file.with_name(f"{file.name}-wal")
    with file.open("rb") as opened:
        header = opened.read(20)
    return header.startswith(b"SQLite format 3\0") and (header[18:] == b"\2\2" or not _has_content(log))


def _has_content(file: Path) -> bool:
    return file.exists() and file.stat().st_size > 0


def _belong(fresh: Path, path: Path) -> None:
    """Give the new file the owner and the permissions of the old one."""
    if not path.exists():
        return
    old = path.stat()
    fresh.chmod(stat.S_IMODE(old.st_mode))
    if (old.st_uid, old.st_gid) != (os.getuid(), os.getgid()) and os.geteuid() == 0:
        os.chown(fresh, old.st_uid, old.st_gid)


def _swap(fresh: Path, path: Path, *, discard: bool) -> Path | None:
    aside = path.with_name(f"{path.name}.before-restore-{moment_name(datetime.now(UTC))}")
    there = path.exists()
    if there:
        _fold(path)  # if SQLite cannot read the database, it keeps its log, and both are set aside
        if not discard:
            aside.hardlink_to(path)
    for ending in _BESIDE:
        beside = path.with_name(path.name + ending)
        if beside.exists():
            if discard or ending == "-shm":
                beside.unlink()
            else:
                beside.rename(aside.with_name(aside.name + ending))
    sync(path.parent)
    fresh.replace(path)
    sync(path.parent)
    return aside if there and not discard else None


def _mend(path: Path) -> None:
    """Undo an interrupted restore: the database has two names for a moment, and must have one."""
    if _workshop_path(path).exists():
        shutil.rmtree(_workshop_path(path))
    for aside in list(path.parent.iterdir()):
        if aside.name.startswith(f"{path.name}.before-restore-") and path.exists() and aside.samefile(path):
            for ending in _BESIDE:
                beside = aside.with_name(aside.name + ending)
                if beside.exists():
                    beside.rename(path.with_name(path.name + ending))
            aside.unlink()


def _workshop_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.restoring")


@contextmanager
def _workshop(path: Path) -> Iterator[Path]:
    folder = _workshop_path(path)
    folder.mkdir(0o700)  # files in it get the old database's permissions only at the end
    try:
        yield folder
    finally:
        shutil.rmtree(folder)
