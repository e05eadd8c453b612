"""Maps of two drives, from the command line to the file."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

from server.store.sqlite.database import Database
from server.store.submap_records import SubmapFilter, SubmapMetadata
from tests.server.commands.cli_helpers import Urquhart, refused
from tests.server.maps.conftest import TREES, store_drives
from urquhart import SE2

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")


def rows_of(database: Database) -> dict[str, SubmapMetadata]:
    with database.read() as tx:
        collection = tx.collections.get("drives")
        assert collection is not None
        submaps = tx.submaps(collection.key)
        return {row.id: row for row in submaps.some(submaps.matching(SubmapFilter()), SubmapMetadata)}


def lines(path: Path) -> list[dict[str, Any]]:
    return [orjson.loads(line) for line in path.read_bytes().splitlines()]


def test_two_drives_become_one_map(urquhart: Urquhart, database: Database, tmp_path: Path) -> None:
    truth = store_drives(database)
    said = urquhart(
        *("map", "build", "drives", "--trees", "trees.csv", "--poses", "poses.ndjson"),
        *("--constraints", "constraints.ndjson", "--apply"),
    )
    assert said.code == 0, said.err
    assert said.out.startswith("12 submaps: 1 connected parts (11)\n1 submaps that nothing connects")
    # The poses are those of the truth, in the frame of the first submap, with covariances that say so.
    poses = {one["id"]: one["map_pose"] for one in lines(tmp_path / "poses.ndjson")}
    assert poses["elsewhere"] is None
    world_T_map = truth["mon-0"]
    for name, pose in truth.items():
        shift, turn = (world_T_map @ SE2(poses[name]["x"], poses[name]["y"], poses[name]["yaw"])).distance(pose)
        assert shift < 0.2 and turn < 0.01
        assert 0.0 <= poses[name]["covariance"][0] < 0.04
    edges = lines(tmp_path / "constraints.ndjson")
    assert {edge["kind"] for edge in edges} == {"match"} and not [edge for edge in edges if edge["refused"]]
    assert all(edge["distance"] < 4.1 and edge["shift"] < 0.3 for edge in edges)
    # One entry for each tree, where it stands, with its diameter.
    with (tmp_path / "trees.csv").open() as file:
        trees = list(csv.DictReader(file))
    xy = world_T_map.apply(np.array([(float(tree["x"]), float(tree["y"])) for tree in trees]))
    away = np.hypot(*(xy[:, None] - TREES[None]).transpose(2, 0, 1))
    nearest = away.argmin(axis=1)
    assert away.min(axis=1).max() < 0.5
    assert len(np.unique(nearest)) == len(trees)
    assert [float(tree["dbh_cm"]) for tree in trees] == [20.0 + tree % 30 for tree in nearest.tolist()]
    assert {tree["crs"] for tree in trees} == {""}
    assert {tree["first_seen"][:10] for tree in trees} == {"2026-05-04", "2026-05-05"}
    # All poses were written under one revision.
    stored = rows_of(database)
    placed = [row for row in stored.values() if row.place is not None]
    assert len(placed) == 11 and len({row.revision for row in placed}) == 1
    for name in truth:
        place = stored[name].place
        assert place is not None and (place.map_x, place.map_y) == (poses[name]["x"], poses[name]["y"])
    assert f"poses applied: revision {placed[0].revision} of drives" in said.out


def test_a_map_is_not_applied_without_being_asked(urquhart: Urquhart, database: Database, tmp_path: Path) -> None:
    store_drives(database)
    before = rows_of(database)
    assert urquhart("map", "build", "drives", "--session", "mon", "--trees", "trees.csv").code == 0
    assert rows_of(database) == before
    # What has no file format, session or collection is refused before anything is matched.
    refused(urquhart("map", "build", "drives", "--trees", "trees.dwg"), "trees.dwg", ".gpkg")
    refused(urquhart("map", "build", "drives", "--session", "wed"), "session 'wed'")
    refused(urquhart("map", "build", "other"), "other")
    refused(urquhart("map", "build", "drives", "--use-map-poses"), "none of the chosen submaps has a map pose")
    (tmp_path / "odometry.ndjson").write_text('{"from": "mon-0", "to": "mon-1", "x": 1, "y": 0, "yaw": 90}\n')
    refused(urquhart("map", "build", "drives", "--odometry", "odometry.ndjson"), "line 1", "radians")


def test_the_trees_of_a_map_as_a_geopackage(urquhart: Urquhart, database: Database, tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio", reason="the extra gis is not installed")
    store_drives(database)
    assert urquhart("map", "build", "drives", "--session", "mon", "--trees", "trees.gpkg").code == 0
    assert pyogrio.list_layers(tmp_path / "trees.gpkg").tolist() == [["trees", "Point"]]
    info = pyogrio.read_info(tmp_path / "trees.gpkg")
    assert info["features"] > 60
    assert {"dbh_cm", "observed", "sigma_m"} <= set(info["fields"])


def test_a_time_that_cannot_be_used_names_its_option(urquhart: Urquhart, database: Database) -> None:
    store_drives(database)
    refused(urquhart("map", "build", "drives", "--datetime", "yesterday"), "--datetime: must be an instant")
