"""Features that an older version made are rebuilt, once."""

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

import urquhart as method
from server.app import create_app
from server.checks.database import discrepancies
from server.config.settings import Settings
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import feature_backfill, migrations_runner
from server.store.sqlite.upgrade.feature_backfill import BackfillProgress, backfill, bring_up_to_date
from server.store.tables import SubmapRow
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.store.older import OLD_FEATURES
from urquhart.config import FEATURES_VERSION

PLOTS = "/v1/collections/plots"


def execute(database: Database, statement: str, *values: Any) -> None:
    with database.write_connection() as connection:
        connection.exec_driver_sql(statement, values)


def marked(database: Database) -> bool:
    with database.read_connection() as connection:
        return connection.exec_driver_sql("PRAGMA user_version").scalar() == FEATURES_VERSION


def formats(database: Database) -> set[int]:
    """Formats of all features."""
    with database.read_connection() as connection:
        return {row[0][4] for row in connection.exec_driver_sql("SELECT features FROM submaps").all()}


def make_old(path: Path, submaps: int = 3) -> Database:
    """A database with features of format 1, in this version's tables."""
    with TestClient(create_app(Settings(database=str(path)))) as client:
        client.put(PLOTS, json={}).raise_for_status()
        for i in range(submaps):
            put_submap(client, "plots", f"p{i}", i).raise_for_status()
    database = Database(path)
    execute(database, OLD_FEATURES)
    execute(database, "PRAGMA user_version = 0")
    return database


def test_features_are_rebuilt_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = make_old(tmp_path / "old.db", submaps=5)
    monkeypatch.setattr(feature_backfill, "_BATCH", 2)
    migrations_runner.upgrade(database)
    assert list(backfill(database)) == [BackfillProgress(2, 5, 2), BackfillProgress(4, 5, 4), BackfillProgress(5, 5, 5)]
    assert list(discrepancies(database)) == []
    assert marked(database)
    assert bring_up_to_date(database) is False
    # What is damaged later is found when it is asked for.
    execute(database, "UPDATE submaps SET features = x'00' WHERE id = 'p3'")
    assert list(backfill(database)) == []
    assert list(backfill(database, all_rows=True)) == [BackfillProgress(1, 1, 1)]
    assert list(discrepancies(database)) == []
    database.dispose()


def test_ended_half_way_it_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = make_old(tmp_path / "old.db", submaps=5)
    monkeypatch.setattr(feature_backfill, "_BATCH", 2)
    migrations_runner.upgrade(database)
    assert next(backfill(database)) == BackfillProgress(2, 5, 2)
    assert not marked(database)
    assert formats(database) == {1, 2}
    assert list(backfill(database)) == [BackfillProgress(2, 3, 2), BackfillProgress(3, 3, 3)]
    assert (formats(database), list(discrepancies(database))) == ({2}, [])
    database.dispose()


def test_what_was_replaced_meanwhile_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = make_old(tmp_path / "old.db", submaps=2)
    migrations_runner.upgrade(database)
    describe = method.describe

    def replaced_while_described(*arguments: Any) -> Any:
        with TestClient(create_app(Settings(database=str(database.path)))) as client:
            monkeypatch.undo()
            put_submap(client, "plots", "p0", 77).raise_for_status()
        return describe(*arguments)

    execute(database, f"PRAGMA user_version = {FEATURES_VERSION}")  # that start must not do it itself
    monkeypatch.setattr(method, "describe", replaced_while_described)
    assert list(backfill(database, all_rows=True)) == [BackfillProgress(2, 2, 1)]
    assert list(discrepancies(database)) == []
    with database.read_connection() as connection:
        assert connection.scalar(select(SubmapRow.landmark_count).where(SubmapRow.id == "p0")) == len(forest(77))
    database.dispose()


def test_what_cannot_be_described_or_written_is_left(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    database = make_old(tmp_path / "old.db", submaps=2)
    migrations_runner.upgrade(database)
    execute(database, "UPDATE submaps SET landmarks = zeroblob(length(landmarks)) WHERE id = 'p0'")
    reader = Database(database.path, read_only=True)
    assert list(backfill(reader)) == []
    reader.dispose()
    assert list(backfill(database)) == [BackfillProgress(2, 2, 1)]
    assert "p0 cannot be described" in caplog.text
    execute(database, "UPDATE collections SET config = '{\"colour\": 1}'")
    execute(database, OLD_FEATURES)
    assert list(backfill(database, all_rows=True)) == []
    database.dispose()


def test_diameters_are_made_part_of_the_features(tmp_path: Path) -> None:
    trees = [{"x": x, "y": y, "dbh_cm": 20.0 + i} for i, (x, y) in enumerate(points(forest(3)))]
    database = make_old(tmp_path / "old.db", submaps=0)
    bring_up_to_date(database)
    with TestClient(create_app(Settings(database=str(database.path)))) as client:
        client.put(f"{PLOTS}/submaps/p", json={"landmarks": trees}).raise_for_status()
    execute(database, OLD_FEATURES)
    assert list(backfill(database, all_rows=True)) == [BackfillProgress(1, 1, 1)]
    assert list(discrepancies(database)) == []
    database.dispose()
