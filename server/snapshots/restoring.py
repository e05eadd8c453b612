"""Restore a snapshot: verified first, prepared beside the database, and put in its place in one step.

If this is interrupted, either the old database or the new one is in place.
"""

import logging
from dataclasses import dataclass
from pathlib import Path

from server.checks.database import file_discrepancies
from server.collections.crud import get_collection
from server.errors import Conflict, NotADatabase, NotFound, StorageDamaged
from server.index.index_folder import IndexFolder
from server.index.row_decoding import config_of
from server.problem_types import document
from server.schemas.snapshots import Snapshot
from server.snapshots.snapshot_folder import SnapshotFolder, is_name, read_manifest, sha256
from server.store.sqlite.database import Database
from server.store.sqlite.database_lock import exclusive
from server.store.sqlite.replacing import fold, has_content, mend, swap, workshop
from server.store.sqlite.sqlite_errors import storage_errors
from server.store.sqlite.upgrade import migrations_runner
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from urquhart.index.segment_file import SegmentDamaged

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
        mend(path)
        if path.exists() and not force:
            raise Conflict(f"{path} exists already. Use --force to set it aside and restore in its place.")
        with workshop(path, "restore") as folder:
            fresh = folder / path.name
            with fresh.open("xb") as copy:
                found = sha256(source.file, between=copy.write)
            _check_sum(source, found)
            fold(fresh)
            _prove(source, fresh)
            ended = _make_ready(fresh)
            aside = swap(fresh, path, "restore", discard=discard)
    return RestoreReport(aside, ended)


def forget_unusable(database: Database) -> int:
    """Remove segments that are missing or damaged from the list. Returns their number. The service rebuilds them."""
    folder, dropped = IndexFolder(database), 0
    with database.write() as tx:
        for key, collection_id, _ in tx.collections.revisions():
            config, segments = config_of(get_collection(tx, collection_id)), tx.segments(key)
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
    if has_content(log):
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
        with copy.read() as tx:
            contents = tx.collections.contents()
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
        with store.write() as tx:
            ended = tx.jobs.end_unfinished(problem)
    finally:
        store.dispose()
    fold(file)
    return ended
