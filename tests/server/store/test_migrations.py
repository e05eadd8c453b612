"""A database of an older version: its configurations, and features that are rebuilt once."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urquhart as method
from server.app import create_app
from server.checks.contents import content_discrepancies
from server.checks.integrity import discrepancies
from server.config.settings import Settings
from server.store import feature_backfill, migrations_runner
from server.store.feature_backfill import BackfillProgress, backfill, bring_up_to_date
from server.store.sqlite.database import Database
from server.store.tables import SubmapRow
from tests.server.commands.cli_helpers import Urquhart
from tests.server.commands.conftest import urquhart
from tests.server.factories import TestClient, forest, observed, points, put_submap
from urquhart import SE2, Config
from urquhart.features.describe import FEATURES_VERSION

__all__ = ["urquhart"]

PLOTS = "/v1/collections/plots"
OLD: dict[str, Any] = {
    **{"samples": 20, "squared": False, "keep_hull": False, "neighbours": 48, "candidates": 24, "hypotheses": 32},
    **{"sweeps": 16, "quad_hits": 200000, "sigma": 0.25, "gate": 6.9, "share": 0.4, "margin": 0.35, "tau": 8.0},
    **{"vertex_window": 3, "gamma": None, "eta": 0.5, "ransac_distance": 0.5, "ransac_ratio": 0.99},
    **{"ransac_iterations": 40000, "correspondences": 4},
}
"""A configuration as revision 0001 stored it."""
KEPT = {name: value for name, value in OLD.items() if name not in ("share", "margin", "sweeps")}
"""What of it is still chosen."""
RENAMED = {"margin": "lead_per_landmark", "sweeps": "exhaustive_submaps"}
TO_FORMAT_1 = "UPDATE submaps SET features = CAST(substr(features, 1, 4) || x'0100' || substr(features, 7) AS BLOB)"


def config_in(database: Database, collection: str = "plots") -> dict[str, Any]:
    """The configuration as it lies in its column."""
    with database.read_connection() as connection:
        text = connection.exec_driver_sql("SELECT config FROM collections WHERE id = ?", (collection,)).scalar_one()
    found: dict[str, Any] = json.loads(text)
    return found


def in_old_words(config: dict[str, Any]) -> dict[str, Any]:
    """A configuration with the names that its parameters had at first."""
    return {next((old for old, new in RENAMED.items() if new == name), name): config[name] for name in config}


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


def make_old(path: Path, config: dict[str, Any], submaps: int = 3) -> Database:
    """A database as an older version left it: schema 0001, features of format 1, and this configuration."""
    with TestClient(create_app(Settings(database=str(path)))) as client:
        client.put(PLOTS, json={}).raise_for_status()
        for i in range(submaps):
            put_submap(client, "plots", f"p{i}", i).raise_for_status()
    database = Database(path)
    migrations_runner.downgrade(database, "0001")
    execute(database, "UPDATE collections SET config = ?", json.dumps(config))
    execute(database, TO_FORMAT_1)
    return database


def test_a_database_of_the_first_revision_opens_and_answers(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    database = make_old(tmp_path / "old.db", OLD)
    assert migrations_runner.current_revision(database) == "0001"
    database.dispose()
    xy, truth = observed(forest(1), 5)
    with TestClient(create_app(Settings(database=str(tmp_path / "old.db")))) as client:
        answer = client.post(f"{PLOTS}/queries", json={"xy": xy}).json()
        assert answer["verdict"] == "matched"
        best = answer["candidates"][0]
        assert best["submap_id"] == "p1"
        found = SE2(*(best["transform"][name] for name in ("x", "y", "yaw")))
        assert found.distance(truth)[0] < 0.2
        bodies: list[dict[str, Any]] = [{}, {"config": {}}, {"config": Config().to_dict()}]
        for body in bodies:
            assert client.put(PLOTS, json=body).status_code == 200, body
        assert client.patch(PLOTS, json={"config": {}}).status_code == 200
        assert client.put(PLOTS, json={"config": {"gate": 3.0}}).status_code == 409
        assert client.get(PLOTS).json()["config"] == Config().to_dict()
        assert put_submap(client, "plots", "p1", 1).json()["outcome"] == "unchanged"
    assert "describing the landmarks again" not in caplog.text
    assert (formats(database), list(discrepancies(database)), migrations_runner.drift(database)) == ({2}, [], [])
    database.dispose()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (OLD, KEPT),
        (OLD | {"margin": 0.5, "share": 0.1}, KEPT | {"lead_per_landmark": 0.5}),
        (OLD | {"sweeps": 8}, KEPT | {"exhaustive_submaps": 8}),
        (OLD | {"pairs": 48}, KEPT),
        ({"gate": 9.5}, {"gate": 9.5}),
        ({}, {}),
    ],
)
def test_configurations_up_and_down(tmp_path: Path, old: dict[str, Any], new: dict[str, Any]) -> None:
    database = make_old(tmp_path / "old.db", old, submaps=0)
    assert migrations_runner.upgrade(database) is True
    assert config_in(database) == new
    assert Config.from_dict(config_in(database)) == Config.from_dict(new)
    assert migrations_runner.drift(database) == []
    migrations_runner.downgrade(database, "0001")
    assert config_in(database) == {"sweeps": 16} | in_old_words(new) | {"share": 0.4, "margin": 0.35}
    assert migrations_runner.current_revision(database) == "0001"
    assert migrations_runner.upgrade(database) is True
    assert config_in(database) == {name: value for name, value in new.items() if name != "lead_per_landmark"}
    database.dispose()


def test_what_the_older_version_does_not_know_goes_with_the_downgrade(database: Database) -> None:
    assert bring_up_to_date(database) is False
    with TestClient(create_app(Settings(database=str(database.path)))) as client:
        client.put(PLOTS, json={"config": {"lead_per_landmark": 1.0, "exhaustive_submaps": 5000}}).raise_for_status()
    assert marked(database)
    migrations_runner.downgrade(database, "0001")
    assert set(config_in(database)) == set(OLD)
    assert config_in(database)["sweeps"] == 1000
    assert not marked(database)


def test_features_are_made_again_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = make_old(tmp_path / "old.db", OLD, submaps=5)
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
    database = make_old(tmp_path / "old.db", OLD, submaps=5)
    monkeypatch.setattr(feature_backfill, "_BATCH", 2)
    migrations_runner.upgrade(database)
    assert next(backfill(database)) == BackfillProgress(2, 5, 2)
    assert not marked(database)
    assert formats(database) == {1, 2}
    assert list(backfill(database)) == [BackfillProgress(2, 3, 2), BackfillProgress(3, 3, 3)]
    assert (formats(database), list(discrepancies(database))) == ({2}, [])
    database.dispose()


def test_what_was_replaced_meanwhile_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = make_old(tmp_path / "old.db", OLD, submaps=2)
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
    with database.read() as session:
        assert session.query(SubmapRow).filter_by(id="p0").one().landmark_count == len(forest(77))
    database.dispose()


def test_what_cannot_be_described_or_written_is_left(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    database = make_old(tmp_path / "old.db", OLD, submaps=2)
    migrations_runner.upgrade(database)
    execute(database, "UPDATE submaps SET landmarks = zeroblob(160) WHERE id = 'p0'")
    reader = Database(database.path, read_only=True)
    assert list(backfill(reader)) == []
    reader.dispose()
    assert list(backfill(database)) == [BackfillProgress(2, 2, 1)]
    assert "p0 cannot be described" in caplog.text
    execute(database, "UPDATE collections SET config = '{\"colour\": 1}'")
    execute(database, TO_FORMAT_1)
    assert list(backfill(database, all_rows=True)) == []
    database.dispose()


def test_diameters_are_made_part_of_the_features(tmp_path: Path) -> None:
    trees = [{"x": x, "y": y, "dbh_cm": 20.0 + i} for i, (x, y) in enumerate(points(forest(3)))]
    database = make_old(tmp_path / "old.db", OLD, submaps=0)
    bring_up_to_date(database)
    with TestClient(create_app(Settings(database=str(database.path)))) as client:
        client.put(f"{PLOTS}/submaps/p", json={"landmarks": trees}).raise_for_status()
    execute(database, TO_FORMAT_1)
    assert list(backfill(database, all_rows=True)) == [BackfillProgress(1, 1, 1)]
    assert list(discrepancies(database)) == []
    database.dispose()


def attributes_in(database: Database) -> dict[str, Any]:
    """The attributes of the trees of `p` as they lie in their column."""
    with database.read_connection() as connection:
        blob = connection.exec_driver_sql("SELECT attributes FROM submaps WHERE id = 'p'").scalar_one()
    found: dict[str, Any] = json.loads(blob)
    return found


def test_diameters_in_metres_become_centimetres(database: Database) -> None:
    """A diameter is the same to the last bit of its features, and the submap is the same to whoever puts it again."""
    bring_up_to_date(database)
    measured = [29.0, 31.0, 30.5, 12.3456789, 57.0, None, *np.random.default_rng(1).uniform(1.0, 200.0, 54).tolist()]
    trees = [
        {"id": f"t{i}", "x": x, "y": y, "dbh_cm": stem, "height_m": 18.5, "species": "fir"}
        for i, ((x, y), stem) in enumerate(zip(points(forest(3)), measured, strict=True))
    ]
    body = {"landmarks": trees, "session": "s", "stamp": "2026-05-04T09:30:00.5Z", "properties": {"b": 1, "a": [2.5]}}
    pose = {"x": 1.5, "y": 2.0, "yaw": 0.25, "covariance": [1, 0, 0, 0, 1, 0, 0, 0, 0.01]}
    with TestClient(create_app(Settings(database=str(database.path)))) as client:
        client.put(PLOTS, json={}).raise_for_status()
        client.put(f"{PLOTS}/submaps/p", json=body | {"map_pose": pose}).raise_for_status()
        client.put(f"{PLOTS}/submaps/bare", json={"xy": points(forest(4))}).raise_for_status()
    migrations_runner.downgrade(database, "0010")
    old = attributes_in(database)
    assert set(old) == {"dbh", "height", "species"}
    assert old["dbh"][:6] == [0.29, 0.31, 0.305, 12.3456789 / 100.0, 0.57, None]
    assert migrations_runner.upgrade(database) is True
    new = attributes_in(database)
    assert list(new) == ["dbh_cm", "height_m", "species"]
    assert [stem for stem in new["dbh_cm"] if stem is not None] == pytest.approx([s for s in measured if s], rel=1e-14)
    assert (new["dbh_cm"][:6], new["height_m"]) == (measured[:6], [18.5] * 60)
    assert [*discrepancies(database), *content_discrepancies(database)] == []
    with TestClient(create_app(Settings(database=str(database.path)))) as client:
        stored = client.get(f"{PLOTS}/submaps/p").json()["landmarks"]
        assert (
            client.put(f"{PLOTS}/submaps/p", json=body | {"map_pose": pose, "landmarks": stored}).json()["outcome"]
            == "unchanged"
        )


def test_the_command_tells_what_it_did(urquhart: Urquhart, tmp_path: Path) -> None:
    make_old(tmp_path / "old.db", OLD).dispose()
    said = urquhart("db", "upgrade", "--database", tmp_path / "old.db")
    assert (said.code, said.err) == (0, "")
    assert (
        said.out
        == f"{tmp_path / 'old.db'}: schema {migrations_runner.expected_revision()}, features of 3 submaps rebuilt\n"
    )
    assert "nothing to do" in urquhart("db", "upgrade", "--database", tmp_path / "old.db").out
    assert urquhart("db", "check", "--database", tmp_path / "old.db").out.endswith("clean\n")
