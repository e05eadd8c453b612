"""The schema's version: upgrade a database, or say plainly why not."""

import time
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, create_engine, text

from server.errors import Conflict, DatabaseNotUpgraded, DatabaseTooNew, NotADatabase
from server.store.schema_version import SCHEMA, alembic_config, expected_revision
from server.store.sqlite.database import Database
from server.store.sqlite.database_lock import lock_path
from server.store.sqlite.file_checks import schema_of

_NOTE: Final = "alembic_version"
"""The table with the schema revision."""
_AGAIN: Final = 0.05
"""Seconds after which a database that is in use is looked at again."""


def current_revision(database: Database) -> str | None:
    """The schema revision of the database, None for an empty one.

    Raises NotADatabase, DatabaseTooNew and StorageUnavailable.
    """
    with database.read_connection() as connection:
        return _current(connection, database.path)


def claim(database: Database) -> str | None:
    """The schema revision, None for an empty database or none, with the file held until `database.dispose()`.

    Nobody can put another file in its place meanwhile. Raises what `current_revision` does, and StorageBusy.
    """
    there = database.path.exists() or database.read_only
    if there and not lock_path(database.path).exists():
        current_revision(database)  # what is not ours gets no lock beside it
    database.hold_file()
    return current_revision(database) if there else None


def upgrade(database: Database) -> bool:
    """Bring the database to the expected revision, and hold it; True when something had to be done.

    All steps are one transaction, and several processes may start at once: the later ones find the work done.
    A database from before the tables were strict is rebuilt, and the old file kept: see `rebuilding`.

    Raises:
        DatabaseNotUpgraded: an old file that may not be written, or that holds what the tables refuse.
        Conflict: it must be rebuilt, and somebody else has it open.
        StorageError: what `current_revision` raises, and what the disk says.
    """
    expected = expected_revision()
    found = claim(database)
    if found == expected:
        database.use_wal()
        return False
    from server.store.sqlite.upgrade import rebuilding  # loads arrays and segments, which few starts need

    if database.read_only:
        raise DatabaseNotUpgraded(
            f"{database.path.name} has schema {found}, this version needs {expected}, and it is opened read-only. "
            "Run `urquhart db upgrade` with write access."
        )
    if found in rebuilding.REVISIONS:
        _rebuild(database)
    database.use_wal()
    with database.write_connection() as connection:
        if _current(connection, database.path) == expected:
            return found in rebuilding.REVISIONS
        create_tables(connection)
    return True


def _rebuild(database: Database) -> None:
    """Rebuild a database, or wait for another process to do it; it is held in the end, as after `claim`."""
    from server.store.sqlite.upgrade import rebuilding

    deadline = time.monotonic() + database.busy_timeout
    while True:
        database.dispose()  # nobody may have it open while another file takes its place
        try:
            rebuilding.rebuild(database.path, create_tables)
        except Conflict:
            # It is in use: by an older service, by one that comes to rebuild it as well, or by one that has done so.
            if claim(database) not in rebuilding.REVISIONS:
                return
            if time.monotonic() > deadline:
                raise
            database.dispose()
            time.sleep(_AGAIN)
        else:
            claim(database)
            return


def create_tables(connection: Connection) -> None:
    """Make the tables of this version, or change those of an earlier one, in the transaction of the connection."""
    from alembic import command

    command.upgrade(alembic_config(connection), "head")


def drift(database: Database) -> list[str]:
    """Tables and indexes of the database that are not as the migrations make them; empty when all are."""
    with create_engine("sqlite://").begin() as fresh:
        create_tables(fresh)
        expected = schema_of(fresh)
    with database.read_connection() as connection:
        found = schema_of(connection)
    names = sorted(expected.keys() | found.keys())
    return [
        f"{name} {'is missing' if name not in found else 'is not known' if name not in expected else 'is another'}"
        for name in names
        if found.get(name) != expected.get(name)
    ]


def _current(connection: Connection, path: Path) -> str | None:
    tables = schema_of(connection)
    noted = connection.scalars(text("SELECT version_num FROM alembic_version")).all() if _NOTE in tables else []
    if list(noted) == [SCHEMA]:
        return SCHEMA
    revision = _noted_revision(connection)
    if revision is None:
        strangers = [name for name in tables if name != _NOTE]
        if strangers:
            raise NotADatabase(
                f"{path.name} is a SQLite database of something else (it has the table {strangers[0]!r}) and is left "
                "as it is. Give another path."
            )
        return None
    from server.store.sqlite.upgrade import rebuilding

    if revision not in _known_revisions() | rebuilding.REVISIONS:
        raise DatabaseTooNew(
            f"{path.name} has schema {revision}, which this version does not know: a newer version of the service "
            f"wrote it. Install that version, or give another database; this one is left as it is."
        )
    return revision


def _noted_revision(connection: Connection) -> str | None:
    from alembic.migration import MigrationContext

    return MigrationContext.configure(connection).get_current_revision()


def _known_revisions() -> set[str]:
    from alembic.script import ScriptDirectory

    return {script.revision for script in ScriptDirectory.from_config(alembic_config()).walk_revisions()}
