"""Rows that are asked for by their keys are found by these, however many the collection has."""

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event

from server.store import migrations_runner
from server.store.repositories.candidate_rows import found_submaps
from server.store.repositories.feature_rows import FeatureRows
from server.store.repositories.submaps import Submaps
from server.store.sqlite.database import Database


@pytest.mark.parametrize(
    "read",
    [
        lambda session: Submaps(session, 1).ids(range(1, 80)),
        lambda session: list(FeatureRows(session, 1).stored(range(1, 80))),
        lambda session: FeatureRows(session, 1).packed(range(1, 80)),
        lambda session: found_submaps(session, 1, range(1, 80), landmarks=False),
        lambda session: found_submaps(session, 1, range(1, 80), landmarks=True),
    ],
)
def test_submaps_asked_for_by_key_are_found_by_key(tmp_path: Path, read: Any) -> None:
    database = Database(tmp_path / "plans.sqlite")
    migrations_runner.upgrade(database)
    database.dispose()
    said: list[str] = []
    event.listen(database.engine, "connect", lambda connection, _: connection.set_trace_callback(said.append))
    with database.read() as session:
        read(session)
        statements = [statement for statement in said if " submaps" in statement]
        assert statements
        for statement in statements:
            plan = session.connection().exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}").all()
            assert any("submaps USING INTEGER PRIMARY KEY" in row[-1] for row in plan), plan
    database.dispose()
