"""Databases as earlier versions left them: the rows of `data/schema_0010.sql`, in the schema of any revision.

The rows were written by a service of schema 0010: two collections with a crs and a map frame, submaps with all members
and with none, one that was deleted, a stand of three submaps, a stored query, an import, an answer to be given again.
"""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import orjson

from server.store.sqlite.upgrade.old_contents import changes_since

REVISIONS = [f"{number:04}" for number in range(1, 12)]
DUMP = Path(__file__).parents[1] / "data/schema_0010.sql"
CONFIG: dict[str, Any] = {
    **{"samples": 20, "squared": False, "keep_hull": False, "neighbours": 48, "candidates": 24, "hypotheses": 32},
    **{"sweeps": 16, "quad_hits": 200000, "sigma": 0.25, "gate": 6.9, "share": 0.4, "margin": 0.35, "tau": 8.0},
    **{"vertex_window": 3, "gamma": None, "eta": 0.5, "ransac_distance": 0.5, "ransac_ratio": 0.99},
    **{"ransac_iterations": 40000, "correspondences": 4},
}
"""A configuration as revision 0001 stored it."""
OLD_FEATURES = "UPDATE submaps SET features = CAST(substr(features, 1, 4) || x'0100' || substr(features, 7) AS BLOB)"
"""Features of the format of then."""
_BACK = {
    "0010": "",
    "0009": "DROP TABLE map_frames",
    "0008": "DROP INDEX ix_submaps_stand_key; ALTER TABLE submaps DROP COLUMN stand_key; DROP TABLE stands",
    "0007": "ALTER TABLE jobs ADD COLUMN worker TEXT; ALTER TABLE jobs ADD COLUMN heartbeat BIGINT",
    "0006": "DROP INDEX ix_submaps_width; ALTER TABLE submaps DROP COLUMN map_width; "
    "DROP INDEX ix_submaps_collection_key_session_stamp_landmark_count",
    "0005": "DROP INDEX ix_submaps_collection_key",
    "0004": "DROP TABLE idempotency; DROP TABLE jobs; DROP TABLE api_keys",
    "0003": "DROP TABLE segments; ALTER TABLE collections DROP COLUMN pruned_revision",
    "0002": f"{OLD_FEATURES}; PRAGMA user_version = 0",
}
"""What takes a database of a revision to the one before."""


def make(path: Path, revision: str = "0011", *changes: str) -> Path:
    """A database of a revision at `path`, with changes made to its rows."""
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(DUMP.read_text())
        if revision == "0011":
            _in_units(connection)
        for step in sorted(_BACK, reverse=True):
            if step > revision:
                connection.executescript(_BACK[step])
        if revision == "0001":
            connection.execute("UPDATE collections SET config = ?", [orjson.dumps(CONFIG).decode()])
        connection.execute("UPDATE alembic_version SET version_num = ?", [revision])
        for change in changes:
            connection.execute(change)
        connection.commit()
        connection.execute("PRAGMA journal_mode = WAL")
    return path


def _in_units(connection: sqlite3.Connection) -> None:
    """What 0011 changed: units in the names of attributes, and names of parameters."""
    changes, _ = changes_since(connection, "0010")
    for table, columns in changes.items():
        values = ", ".join(f"{column} = {expression}" for column, expression in columns.items())
        connection.execute(f"UPDATE {table} SET {values}")  # noqa: S608


_LATER = {("submaps", "map_width"), ("stands", "crs")}
"""Columns that are computed, or that no schema before 0012 had."""


_NEW = ("alembic_version", "constraints", "searched_submaps")
"""Tables that no schema before 0014 had."""


def rows(path: Path) -> dict[str, list[dict[str, Any]]]:
    """All rows of a database, by table, each with its columns by name; without those of `_LATER` and `_NEW`."""
    with closing(sqlite3.connect(path)) as connection:
        connection.row_factory = sqlite3.Row
        tables = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        return {
            name: [
                {key: value for key, value in dict(row).items() if (name, key) not in _LATER}
                for row in connection.execute(f"SELECT * FROM {name} ORDER BY 1, 2")  # noqa: S608
            ]
            for (name,) in tables.fetchall()
            if name not in _NEW
        }
