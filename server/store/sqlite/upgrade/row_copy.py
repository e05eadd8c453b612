"""All rows of a database copied into the tables of another, one by one where one of them is refused, to name it."""

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from server.errors import DatabaseNotUpgraded
from server.store.sqlite.sqlite_errors import storage_errors

_SEQUENCES: Final = "sqlite_sequence"


@contextmanager
def both(fresh: Path, old: Path) -> Iterator[sqlite3.Connection]:
    """A connection to `fresh`, with the database `old` attached to be read; nobody else may use either.

    It is committed in the end. References are not enforced, and nothing is synced. Raises StorageError.
    """
    with storage_errors(old), closing(sqlite3.connect(fresh.as_uri(), uri=True, isolation_level=None)) as connection:
        # Nobody needs the copy before it is complete, and then it is synced as a whole.
        for setting in ("journal_mode = MEMORY", "synchronous = OFF", "foreign_keys = OFF", "cache_size = -65536"):
            connection.execute(f"PRAGMA {setting}")
        connection.execute("ATTACH ? AS old", [f"{old.as_uri()}?mode=ro"])
        connection.execute("BEGIN")
        yield connection
        connection.execute("COMMIT")


def copy_rows(connection: sqlite3.Connection, changes: Mapping[str, Mapping[str, str]]) -> None:
    """Copy what the tables of both have in common, with the keys that were given out, and the application's number.

    `changes`: by table and column, expressions for what is not copied as it is.

    Raises:
        DatabaseNotUpgraded: a table refuses a row, or a row refers to one that is not there. Says which and why.
    """
    for table in _tables(connection, "main") & _tables(connection, "old"):
        there = _columns(connection, "old", table)
        sources = {name: name for name in there} | dict(changes.get(table, {}))
        taken = {name: sources[name] for name in _columns(connection, "main", table) if name in sources}
        copy = f"INSERT INTO main.{table} ({', '.join(taken)}) SELECT {', '.join(taken.values())} FROM old.{table}"
        try:
            connection.execute(copy)
        except sqlite3.IntegrityError:
            _name_the_refused(connection, table, copy)
            raise
        _require_all(connection, table)
    for table, row, parent, _ in connection.execute("PRAGMA main.foreign_key_check").fetchall():
        raise DatabaseNotUpgraded(_refusal(table, row, f"it belongs to a row of {parent} that is not there"))
    connection.execute(f"DELETE FROM main.{_SEQUENCES}")
    connection.execute(f"INSERT INTO main.{_SEQUENCES} SELECT name, seq FROM old.{_SEQUENCES}")
    (number,) = connection.execute("PRAGMA old.user_version").fetchone()
    connection.execute(f"PRAGMA main.user_version = {number:d}")


def _tables(connection: sqlite3.Connection, schema: str) -> set[str]:
    names = connection.execute(f"SELECT name FROM {schema}.sqlite_master WHERE type = 'table'").fetchall()
    return {name for (name,) in names} - {_SEQUENCES, "alembic_version"}


def _columns(connection: sqlite3.Connection, schema: str, table: str) -> list[str]:
    """Names of columns; those that are computed are not among them."""
    return [row[1] for row in connection.execute(f"PRAGMA {schema}.table_info({table})")]


def _name_the_refused(connection: sqlite3.Connection, table: str, copy: str) -> None:
    """Raise DatabaseNotUpgraded with the first row that the table refuses, and why."""
    rows = [row for (row,) in connection.execute(f"SELECT rowid FROM old.{table} ORDER BY rowid")]
    for row in rows:
        try:
            connection.execute(f"{copy} WHERE rowid = ?", [row])
        except sqlite3.IntegrityError as error:
            raise DatabaseNotUpgraded(_refusal(table, row, str(error))) from error


def _require_all(connection: sqlite3.Connection, table: str) -> None:
    old, new = (
        connection.execute(f"SELECT count(*) FROM {schema}.{table}").fetchone()[0] for schema in ("old", "main")
    )
    if old != new:
        raise DatabaseNotUpgraded(f"{new} of {old} rows of {table} were copied. Nothing was changed; try again.")


def _refusal(table: str, row: int, why: str) -> str:
    return (
        f"Row {row} of {table} cannot be upgraded: {why}. Nothing was changed. Correct the row or delete it, "
        "for example with the sqlite3 command, and try again."
    )
