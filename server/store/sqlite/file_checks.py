"""What SQLite tells of a database file: its schema, its number of a version, and whether it is whole."""

from collections.abc import Iterator
from typing import Final

from sqlalchemy import Connection


def schema_of(connection: Connection) -> dict[str, str]:
    """The statements that made the tables and indexes, by name."""
    statement = "SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite!_%' ESCAPE '!'"
    return {row[0]: row[1] for row in connection.exec_driver_sql(statement)}


def file_faults(connection: Connection, *, quick: bool = False) -> Iterator[str]:
    """What is wrong with pages, indexes, types and the rules of rows; if that is nothing, with references to rows.

    `quick` leaves out whether indexes agree with their tables.
    """
    whole = True
    for (line,) in connection.exec_driver_sql("PRAGMA quick_check" if quick else "PRAGMA integrity_check").all():
        if line != "ok":
            whole = False
            yield f"integrity check: {line}"
    if whole:
        for table, row, parent, _ in connection.exec_driver_sql("PRAGMA foreign_key_check").all():
            yield f"row {row} of {table} belongs to a row of {parent} that is not there"


def user_version(connection: Connection) -> int:
    """The number that a database carries for its application."""
    return int(connection.exec_driver_sql("PRAGMA user_version").scalar_one())


def set_user_version(connection: Connection, version: int) -> None:
    """Set that number."""
    connection.exec_driver_sql(f"PRAGMA user_version = {version:d}")


def broken_invariants(connection: Connection) -> Iterator[tuple[str, str]]:
    """What the rules of one row cannot say, because it concerns several: where it is broken, and how.

    Where is a collection, "" for the whole file, or what stands in its place.
    """
    for what, statement in _INVARIANTS:
        for (where,) in connection.exec_driver_sql(statement):
            yield where, what


_INVARIANTS: Final = (
    (
        "a deletion is noted that should be forgotten",
        "SELECT c.id FROM deletions d JOIN collections c ON c.key = d.collection_key "
        "WHERE d.revision <= c.pruned_revision",
    ),
    (
        "a segment is listed beyond its revision",
        "SELECT c.id FROM segments g JOIN collections c ON c.key = g.collection_key WHERE g.revision > c.revision",
    ),
    (
        "a constraint names landmarks of a later revision",
        "SELECT c.id FROM constraints k JOIN collections c ON c.key = k.collection_key "
        "WHERE max(k.from_revision, k.to_revision) > c.revision",
    ),
    (
        "a submap is noted as searched under another collection",
        "SELECT c.id FROM searched_submaps f JOIN submaps s ON s.key = f.submap_key "
        "JOIN collections c ON c.key = s.collection_key WHERE f.collection_key <> s.collection_key",
    ),
    (
        "keys of submaps would be given out again",
        "SELECT '' WHERE coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'submaps'), 0) "
        "< max(coalesce((SELECT max(key) FROM submaps), 0), coalesce((SELECT max(submap_key) FROM deletions), 0))",
    ),
    (
        "keys of collections would be given out again",
        "SELECT '' WHERE coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'collections'), 0) "
        "< (SELECT max(key) FROM collections)",
    ),
    (
        "keys of jobs would be given out again",
        "SELECT '' WHERE coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'jobs'), 0) "
        "< (SELECT max(key) FROM jobs)",
    ),
    (
        "allows what no key allows",
        "SELECT 'key ' || k.id FROM api_keys k, json_each(k.scopes) "
        "WHERE json_each.value NOT IN ('read', 'write', 'admin')",
    ),
)
