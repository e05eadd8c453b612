"""Stands: what a stem map stored is replaced as a whole, in one transaction."""

import os
import signal
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.checks.database import discrepancies
from server.commands.index import ensure_collection
from server.config.settings import Limits
from server.schemas.collections import CollectionPut
from server.stem_maps import replacement
from server.stem_maps.reader import StemMap
from server.stem_maps.replacement import StandError
from server.stem_maps.stands import StandReport, cut_stand, store_stand
from server.store.repositories.stands import Stands
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps.bulk_ingest import LineOptions
from tests.server.commands.cli_helpers import Urquhart, refused, write_observation
from tests.server.factories import Client, points
from tests.server.forked import LoadedProcess
from urquhart import SE2

RADIUS, SPACING = 20.0, 14.0
OPTIONS = ["--collection", "c", "--radius", RADIUS, "--spacing", SPACING]


def stand_trees(count: int = 140) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(count, 2) float64, metres: a random stand of 64 m by 52 m."""
    return np.random.default_rng(7).uniform(0.0, (64.0, 52.0), (count, 2))


TURN = SE2(31.0, -12.0, 0.66)
"""The wrong orientation of the stand's first version."""


def as_map(xy: np.ndarray[Any, np.dtype[np.float64]], name: str = "stand") -> StemMap:
    return StemMap(name, tuple(str(i + 1) for i in range(len(xy))), xy)


def put_stand(database: Database, stem_map: StemMap, radius: float = RADIUS, spacing: float = SPACING) -> StandReport:
    return store_stand(
        database, "c", stem_map, cut_stand(stem_map, radius, spacing, Limits()), LineOptions(limits=Limits())
    )


def ids_in(path: Path) -> set[str]:
    with closing(sqlite3.connect(path)) as connection:
        return {row[0] for row in connection.execute("SELECT id FROM submaps")}


def poses_in(path: Path) -> set[tuple[str, float, float]]:
    with closing(sqlite3.connect(path)) as connection:
        return set(connection.execute("SELECT id, map_x, map_y FROM submaps").fetchall())


@pytest.fixture
def database(tmp_path: Path) -> Any:
    made = Database(tmp_path / "stands.db")
    migrations_runner.upgrade(made)
    ensure_collection(made, "c")
    yield made
    made.dispose()


# ---------------------------------------------------------------- the command


def test_a_corrected_stem_map_leaves_nothing_of_the_old_one(urquhart: Urquhart, tmp_path: Path) -> None:
    trees, here = stand_trees(), SE2(35.0, 15.0, 0.4)
    write_observation(tmp_path / "stand.csv", TURN.apply(trees))
    first = urquhart("index", "stand.csv", *OPTIONS)
    assert "0 removed" in first.out
    write_observation(tmp_path / "stand.csv", trees)
    second = urquhart("index", "stand.csv", *OPTIONS)
    old, new = (cut_stand(as_map(xy), RADIUS, SPACING, Limits()).discs for xy in (TURN.apply(trees), trees))
    removed = {disc.submap_id for disc in old} - {disc.submap_id for disc in new}
    assert removed, "the two grids must differ, or the test shows nothing"
    assert f"{len(removed)} removed" in second.out
    assert ids_in(tmp_path / "urquhart.db") == {disc.submap_id for disc in new}
    near = trees[np.hypot(*(trees - (here.x, here.y)).T) < 12.0]
    write_observation(tmp_path / "seen.csv", here.inverse().apply(near))
    found = urquhart("locate", "seen.csv", "--collection", "c", "--seed", 1)
    assert "pose in stand: x 35.000 m, y 15.000 m, yaw 22.92 deg" in found.out
    assert "clean" in urquhart("db", "check").out
    assert f"{len(new)} unchanged" in urquhart("index", "stand.csv", *OPTIONS).out


def test_another_grid_replaces_the_one_before_and_is_told(urquhart: Urquhart, tmp_path: Path) -> None:
    write_observation(tmp_path / "stand.csv", stand_trees())
    urquhart("index", "stand.csv", *OPTIONS)
    said = urquhart("index", "stand.csv", "--collection", "c", "--radius", 25, "--spacing", 30)
    assert "before, the radius was 20 m and the spacing 14 m" in said.out
    again = cut_stand(as_map(stand_trees()), 25.0, 30.0, Limits()).discs
    assert ids_in(tmp_path / "urquhart.db") == {disc.submap_id for disc in again}


def test_a_stand_that_shrank_and_one_under_two_names(urquhart: Urquhart, tmp_path: Path) -> None:
    trees = stand_trees()
    write_observation(tmp_path / "stand.csv", trees)
    urquhart("index", "stand.csv", *OPTIONS)
    write_observation(tmp_path / "other.csv", trees[::-1])
    assert "the stand 'stand' has the same trees" in urquhart("index", "other.csv", *OPTIONS).out
    write_observation(tmp_path / "stand.csv", trees[trees[:, 0] < 30.0])
    said = urquhart("index", "stand.csv", *OPTIONS)
    assert "same trees" not in said.out
    shrunk = cut_stand(as_map(trees[trees[:, 0] < 30.0]), RADIUS, SPACING, Limits()).discs
    mine = {name for name in ids_in(tmp_path / "urquhart.db") if name.startswith("stand-")}
    assert mine == {disc.submap_id for disc in shrunk}


@pytest.mark.parametrize("rows", [np.zeros((0, 2)), stand_trees(9)])
def test_a_file_without_a_disc_leaves_the_stand_as_it_was(urquhart: Urquhart, tmp_path: Path, rows: Any) -> None:
    write_observation(tmp_path / "stand.csv", stand_trees())
    urquhart("index", "stand.csv", *OPTIONS)
    before = poses_in(tmp_path / "urquhart.db")
    write_observation(tmp_path / "stand.csv", rows)
    refused(urquhart("index", "stand.csv", *OPTIONS), "stand.csv")
    assert poses_in(tmp_path / "urquhart.db") == before


def test_trees_in_a_row_do_not_take_the_place_of_a_stand(urquhart: Urquhart, tmp_path: Path) -> None:
    write_observation(tmp_path / "stand.csv", stand_trees())
    urquhart("index", "stand.csv", *OPTIONS)
    before = poses_in(tmp_path / "urquhart.db")
    write_observation(tmp_path / "stand.csv", np.array([(2.0 * i, float(i)) for i in range(40)]))
    refused(urquhart("index", "stand.csv", *OPTIONS), "none of the", "keeps the submaps it had")
    assert poses_in(tmp_path / "urquhart.db") == before


# ---------------------------------------------------------------- older databases, and others' submaps


def test_discs_of_a_version_without_stands_are_replaced_as_well(database: Database) -> None:
    trees = stand_trees()
    put_stand(database, as_map(TURN.apply(trees)))
    with database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET stand_key = NULL")
        connection.exec_driver_sql("DELETE FROM stands")
    old = len(ids_in(database.path))
    report = put_stand(database, as_map(trees))
    assert report.outcome.adopted == old
    assert ids_in(database.path) == {disc.submap_id for disc in report.cut.discs}
    assert list(discrepancies(database)) == []
    with database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE submaps SET stand_key = NULL")
    same = put_stand(database, as_map(trees)).outcome
    assert (same.unchanged, same.adopted, same.removed) == (len(report.cut.discs), len(report.cut.discs), 0)
    with database.read() as tx:
        stand = tx.stands(1).get("stand")
        assert stand is not None
        assert set(tx.stands(1).members(stand.key)) == ids_in(database.path)


def test_only_the_stand_itself_is_replaced(database: Database) -> None:
    """A stand whose name begins like another's, and submaps of robots in the stand's frame."""
    trees = stand_trees()
    for name in ("stand", "stand-0", "stand-0-1"):
        put_stand(database, as_map(trees, name))
    others = {name for name in ids_in(database.path) if not name.startswith("stand-") or name.count("-") != 2}
    put_stand(database, as_map(TURN.apply(trees)[:60]))
    assert others <= ids_in(database.path)
    assert list(discrepancies(database)) == []


def test_a_submap_that_somebody_else_stored_is_not_overwritten(service: Any, client: Client) -> None:
    client.put("/v1/collections/c", json={}).raise_for_status()
    trees = stand_trees()
    report = put_stand(service.database, as_map(trees))
    taken = report.cut.discs[3].submap_id
    body = {"xy": points(trees[:30]), "session": "robot-2"}
    client.put(f"/v1/collections/c/submaps/{taken}", json=body).raise_for_status()
    before = poses_in(service.database.path)
    with pytest.raises(StandError, match=f"the first '{taken}', do not belong to the stand 'stand'"):
        put_stand(service.database, as_map(TURN.apply(trees)))
    assert poses_in(service.database.path) == before
    assert client.get(f"/v1/collections/c/submaps/{taken}").json()["session"] == "robot-2"


# ---------------------------------------------------------------- one transaction


def test_readers_see_all_of_the_old_stand_until_all_of_the_new_one(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    trees = stand_trees()
    put_stand(database, as_map(TURN.apply(trees)))
    before, seen = poses_in(database.path), []
    for name in ("put", "adopt", "remove"):
        monkeypatch.setattr(Stands, name, _after(getattr(Stands, name), lambda: seen.append(poses_in(database.path))))
    monkeypatch.setattr(replacement, "_IN_MEMORY", 1000)  # the rest waits in the file
    report = put_stand(database, as_map(trees))
    assert seen == [before] * 3
    assert {name for name, _, _ in poses_in(database.path)} == {disc.submap_id for disc in report.cut.discs}
    assert [path.name for path in database.path.parent.iterdir() if not path.name.startswith("stands.db")] == []


def _after(method: Callable[..., Any], then: Callable[[], object]) -> Callable[..., Any]:
    def both(*arguments: Any, **named: Any) -> Any:
        result = method(*arguments, **named)
        then()
        return result

    return both


def _store_and_die(path: Path, method: str) -> None:
    setattr(Stands, method, _after(getattr(Stands, method), lambda: os.kill(os.getpid(), signal.SIGKILL)))
    put_stand(Database(path), as_map(stand_trees()))


@pytest.mark.parametrize("method", ["put", "adopt", "remove", "with_trees"])
def test_a_kill_leaves_the_old_stand(database: Database, method: str) -> None:
    put_stand(database, as_map(TURN.apply(stand_trees())))
    before = poses_in(database.path)
    process = LoadedProcess(target=_store_and_die, args=(database.path, method))
    process.start()
    process.join(timeout=300)
    assert process.exitcode == -signal.SIGKILL
    assert poses_in(database.path) == before
    assert list(discrepancies(database)) == []
    report = put_stand(database, as_map(stand_trees()))
    assert ids_in(database.path) == {disc.submap_id for disc in report.cut.discs}


def test_two_who_store_the_same_stand_at_once_leave_one_version(database: Database) -> None:
    versions = [as_map(stand_trees()), as_map(TURN.apply(stand_trees()))]
    expected = []
    for version in versions:
        discs = cut_stand(version, RADIUS, SPACING, Limits()).discs
        expected.append({(disc.submap_id, *disc.centre) for disc in discs})
    for _ in range(3):
        stores = [Database(database.path) for _ in versions]
        threads = [threading.Thread(target=put_stand, args=pair) for pair in zip(stores, versions, strict=True)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for store in stores:
            store.dispose()
        assert poses_in(database.path) in expected
    assert list(discrepancies(database)) == []


def test_a_running_service_answers_from_the_new_stand_only(service: Any, client: Client) -> None:
    client.put("/v1/collections/c", json=CollectionPut().model_dump(exclude_unset=True)).raise_for_status()
    trees, here = stand_trees(), SE2(35.0, 15.0, 0.4)
    near = points(here.inverse().apply(trees[np.hypot(*(trees - (here.x, here.y)).T) < 12.0]))
    for version, x in ((TURN.apply(trees), (TURN @ here).x), (trees, here.x)):
        put_stand(service.database, as_map(version))
        answer = client.post("/v1/collections/c/queries", json={"xy": near}).json()
        assert answer["verdict"] == "matched"
        assert {round(one["map_pose"]["x"], 3) for one in answer["candidates"] if not one["refused"]} == {round(x, 3)}
    assert client.get("/v1/collections/c").json()["counts"]["submaps"] == len(ids_in(service.database.path))
