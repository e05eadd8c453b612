"""Snapshots: copies of the whole database, created while the service runs, listed, and deleted.

A snapshot contains everything that was acknowledged before it was requested. It is verified before it gets its name.
"""

import logging
import shutil
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from server.checks.database import file_discrepancies
from server.config.settings import Limits
from server.errors import Conflict, StorageDamaged, StorageReadOnly
from server.platform.ids import moment_name
from server.platform.version import service_version
from server.resources import links
from server.resources.idempotency import (
    NO_CONTENT,
    IdempotencyKey,
    StoredResponse,
    find_response,
    run_once,
    store_response,
)
from server.resources.paging import page_size, read_name_cursor, write_cursor
from server.schemas.snapshots import Snapshot, SnapshotCollection, SnapshotPage
from server.snapshots.snapshot_folder import SnapshotFolder, check_name, sha256
from server.store.sqlite.database import Database
from server.store.sqlite.replacing import require_room
from server.store.sqlite.sqlite_errors import storage_errors
from server.store.sqlite.upgrade import migrations_runner
from server.store.storage import WriteTransaction
from urquhart.index.segment_file import sync

_OPERATION: Final = "postSnapshot"
_BREATH: Final = 0.001
"""Pause in seconds after every megabyte, which leaves the disk to writers."""
_log = logging.getLogger(__name__)


def make(database: Database, folder: SnapshotFolder, name: str | None, keep_last: int) -> Snapshot:
    """Create a snapshot, then delete the oldest ones beyond `keep_last` (0: none).

    Raises:
        Conflict: one is being made, or there is one of that name.
        InvalidField, StorageError; nothing is left of it then.
    """
    created = datetime.now(UTC)
    name = name or moment_name(created)
    check_name(name)
    with storage_errors(folder.path), folder.turn():
        if folder.manifest(name).exists():
            raise Conflict(f"The snapshot {name!r} exists already. Use another name, or delete it first.")
        require_room(database.path, folder.path, "A snapshot", "Delete old snapshots, or free some space.")
        file = folder.making / "snapshot"
        database.copy_to(file, between=lambda: time.sleep(_BREATH))
        shutil.copymode(database.path, file)
        sync(file)
        snapshot = _described(file, name=name, created=created)
        folder.publish(file, snapshot)
        _remove_oldest(folder, keep_last, name)
    return snapshot


def make_once(
    database: Database, folder: SnapshotFolder, name: str | None, keep_last: int, idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """Create a snapshot, unless the same request did. Returns the answer. Raises what `make` raises, and KeyReused."""
    _must_keep(database, idempotency_key)
    with database.read() as tx:
        response = find_response(tx, idempotency_key, _OPERATION)
    if response is not None:
        return response
    snapshot = make(database, folder, name, keep_last)
    answer = StoredResponse(
        201, {"Location": links.snapshot(snapshot.name), "ETag": f'"{snapshot_etag(snapshot)}"'}, snapshot.document()
    )
    if idempotency_key is None:
        return answer
    with database.write() as tx:
        return store_response(tx, idempotency_key, _OPERATION, answer)


def remove_once(
    database: Database, folder: SnapshotFolder, name: str, idempotency_key: IdempotencyKey | None
) -> StoredResponse:
    """Delete a snapshot, unless the same request did. Returns the answer. Raises NotFound, StorageError and
    KeyReused.
    """
    if idempotency_key is None:
        folder.remove(name)
        return NO_CONTENT

    def remove(_: WriteTransaction) -> StoredResponse:
        folder.remove(name)
        return NO_CONTENT

    _must_keep(database, idempotency_key)
    return run_once(database, idempotency_key, f"deleteSnapshot {name}", remove)


def _must_keep(database: Database, idempotency_key: IdempotencyKey | None) -> None:
    if idempotency_key is not None and database.read_only:
        raise StorageReadOnly(
            "The database is open read-only, so no Idempotency-Key can be stored. Send the request without one."
        )


def page(folder: SnapshotFolder, limits: Limits, limit: int | None, cursor: str | None) -> SnapshotPage:
    """A page of snapshots, oldest first. Raises InvalidField and StorageError."""
    size, after = page_size(limit, limits), read_name_cursor("snapshots", cursor)
    there = [snapshot for snapshot in folder.all() if _place(snapshot) > after]
    return SnapshotPage(
        snapshots=there[:size],
        next=write_cursor("snapshots", _place(there[size - 1])) if len(there) > size else None,
    )


def snapshot_etag(snapshot: Snapshot) -> str:
    """Entity tag of a snapshot's document. That of its file is the checksum alone."""
    return f"{snapshot.sha256}-document"


def _described(file: Path, *, name: str, created: datetime) -> Snapshot:
    """The manifest of a copy, read from the copy. Raises StorageDamaged if it is damaged."""
    copy = Database(file, read_only=True)
    try:
        for finding in file_discrepancies(copy, quick=True):
            raise StorageDamaged(
                f"The database is damaged, so no snapshot was stored: {finding.what}. Restore an earlier snapshot that "
                "is intact."
            )
        revision = migrations_runner.current_revision(copy)
        with copy.read() as tx:
            contents = tx.collections.contents()
    finally:
        copy.dispose()
    return Snapshot(
        name=name,
        created=created,
        size=file.stat().st_size,
        sha256=sha256(file),
        schema_=revision or "",
        version=service_version(),
        collections=[SnapshotCollection(id=id_, revision=at, submaps=submaps) for id_, at, submaps in contents],
    )


def _remove_oldest(folder: SnapshotFolder, keep_last: int, made: str) -> None:
    old = [snapshot.name for snapshot in folder.all() if snapshot.name != made]
    for name in old[: max(len(old) + 1 - keep_last, 0)] if keep_last else []:
        folder.remove(name)
        _log.info("snapshot %s removed: the last %d are kept", name, keep_last)


def _place(snapshot: Snapshot) -> str:
    """The position of a snapshot in a listing."""
    return f"{moment_name(snapshot.created)} {snapshot.name}"
