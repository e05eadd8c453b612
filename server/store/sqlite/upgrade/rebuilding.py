"""Databases from before the tables were strict (schemas 0001 to 0011), copied into the tables of this version.

The new file is built beside the old one, checked, and put in its place in one step. Whenever that is interrupted, the
old database is there or the new one. The old one is kept as `<file>.before-upgrade-<time>`.
"""

import logging
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Final

from sqlalchemy import Connection

from server.errors import DatabaseNotUpgraded, StorageDamaged
from server.store.sqlite.database import Database
from server.store.sqlite.database_lock import exclusive
from server.store.sqlite.file_checks import file_faults
from server.store.sqlite.replacing import fold, mend, require_room, swap, workshop
from server.store.sqlite.sqlite_errors import storage_errors
from server.store.sqlite.upgrade.old_contents import changes_since
from server.store.sqlite.upgrade.row_copy import both, copy_rows

REVISIONS: Final = frozenset(f"{number:04}" for number in range(1, 12))
"""Of the schemas that are rebuilt."""
_log = logging.getLogger(__name__)


def rebuild(path: Path, create_tables: Callable[[Connection], None]) -> None:
    """Put a copy with the tables of this version in the place of the database at `path`.

    Nothing is done if another process did it meanwhile.

    Raises:
        DatabaseNotUpgraded: the tables refuse a row of the old database. It is left as it is.
        Conflict: somebody has the database open.
        StorageError: disk full, file damaged ...; the old database is left as it is.
    """
    path = path.resolve()
    with storage_errors(path), exclusive(path):
        mend(path)
        if not fold(path):
            raise StorageDamaged(f"{path.name} cannot be read. Run `urquhart db check`, and restore a backup.")
        revision = _revision(path)
        if revision not in REVISIONS:
            return
        require_room(path, path.parent, f"An upgrade of {path.name}", "Free some space and try again.")
        with workshop(path, "upgrade") as folder:
            fresh = folder / path.name
            _make(fresh, create_tables)
            with both(fresh, path) as connection:
                changes, after = changes_since(connection, revision)
                copy_rows(connection, changes)
                for statement in after:
                    connection.execute(statement)
            _require_sound(fresh)
            aside = swap(fresh, path, "upgrade")
        _log.info("%s is upgraded from schema %s; the old file is %s", path.name, revision, aside and aside.name)


def _revision(path: Path) -> str:
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        return str(connection.execute("SELECT version_num FROM alembic_version").fetchone()[0])


def _make(fresh: Path, create_tables: Callable[[Connection], None]) -> None:
    database = Database(fresh)
    try:
        database.use_wal()
        with database.write_connection() as connection:
            create_tables(connection)
    finally:
        database.dispose()


def _require_sound(fresh: Path) -> None:
    database = Database(fresh, read_only=True)
    try:
        with database.read_connection() as connection:
            for fault in file_faults(connection):
                raise DatabaseNotUpgraded(
                    f"The copy of the database is damaged: {fault}. Nothing was changed; try again."
                )
    finally:
        database.dispose()
