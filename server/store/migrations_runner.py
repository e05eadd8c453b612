"""The schema's version: upgrade a database, or say plainly why not."""

from functools import cache
from importlib import resources
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, inspect

from server.errors import DatabaseNotUpgraded, DatabaseTooNew, NotADatabase
from server.store.sqlite.database import Database
from server.store.sqlite.database_lock import lock_path


@cache
def expected_revision() -> str:
    """The schema revision that this version of the service works with."""
    head = ScriptDirectory.from_config(_alembic()).get_current_head()
    if head is None:
        raise RuntimeError("the package `migrations` holds no revision")
    return head


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
    Raises what `current_revision` does, and DatabaseNotUpgraded for an old file that may not be written.
    """
    expected = expected_revision()
    found = claim(database)
    if found == expected:
        database.use_wal()
        return False
    if database.read_only:
        raise DatabaseNotUpgraded(
            f"{database.path.name} has schema {found}, this version needs {expected}, and it is opened read-only. "
            "Run `urquhart db upgrade` with write access."
        )
    database.use_wal()
    with database.write_connection() as connection:
        if _current(connection, database.path) == expected:
            return False
        command.upgrade(_alembic(connection), "head")
    return True


def downgrade(database: Database, revision: str) -> None:
    """Take the schema back to `revision` ("base" for none); what later revisions added is lost."""
    with database.write_connection() as connection:
        command.downgrade(_alembic(connection), revision)


def drift(database: Database) -> list[object]:
    """Differences between the database's schema and the tables as declared; empty when they agree."""
    from alembic.autogenerate import compare_metadata

    from server.store.tables import CollectionRow

    with database.read_connection() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        return list(compare_metadata(context, CollectionRow.metadata))


def _current(connection: Connection, path: Path) -> str | None:
    revision = MigrationContext.configure(connection).get_current_revision()
    if revision is None:
        strangers = [name for name in inspect(connection).get_table_names() if name != "alembic_version"]
        if strangers:
            raise NotADatabase(
                f"{path.name} is a SQLite database of something else (it has the table {strangers[0]!r}) and is left "
                "as it is. Give another path."
            )
        return None
    known = {script.revision for script in ScriptDirectory.from_config(_alembic()).walk_revisions()}
    if revision not in known:
        raise DatabaseTooNew(
            f"{path.name} has schema {revision}, which this version does not know: a newer version of the service "
            f"wrote it. Install that version, or give another database; this one is left as it is."
        )
    return revision


def _alembic(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(resources.files("migrations")).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config
