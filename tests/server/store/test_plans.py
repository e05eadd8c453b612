"""Rows that are asked for by their keys are found by these, however many the collection has."""

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event

from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner


@pytest.mark.parametrize(
    "read",
    [
        lambda tx: tx.submaps(1).ids(range(1, 80)),
        lambda tx: list(tx.features(1).stored(range(1, 80))),
        lambda tx: tx.features(1).packed(range(1, 80)),
        lambda tx: tx.candidates(1).read(range(1, 80), landmarks=False),
        lambda tx: tx.candidates(1).read(range(1, 80), landmarks=True),
    ],
)
def test_submaps_asked_for_by_key_are_found_by_key(tmp_path: Path, read: Any) -> None:
    database = Database(tmp_path / "plans.sqlite")
    migrations_runner.upgrade(database)
    database.dispose()
    said: list[str] = []
    event.listen(database.engine, "connect", lambda connection, _: connection.set_trace_callback(said.append))
    with database.read() as tx:
        read(tx)
    statements = [statement for statement in said if " submaps" in statement]
    assert statements
    with database.read_connection() as connection:
        for statement in statements:
            plan = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}").all()
            assert any("submaps USING INTEGER PRIMARY KEY" in row[-1] for row in plan), plan
    database.dispose()
