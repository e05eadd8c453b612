"""Exports: what a collection holds as files, over REST and by the command line, and read again."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from server.outputs.files import FORMATS
from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import ReadOptions
from tests.server.commands.cli_helpers import Urquhart, refused, write_observation
from tests.server.factories import forest, observed, points
from urquhart import SE2

PLOTS = "/v1/collections/plots"
FAR = (448_100.0, 5_411_000.0)
TREES = forest(1)
POSE = SE2(*FAR, 0.7)


def put_trees(client: httpx.Client, submap: str = "p", **pose: Any) -> None:
    """Store the forest with ids and diameters, at `POSE` unless another pose is given."""
    landmarks = [{"id": f"t{i}", "x": x, "y": y, "dbh_cm": 10.0 + i} for i, (x, y) in enumerate(points(TREES))]
    map_pose = {"x": POSE.x, "y": POSE.y, "yaw": POSE.yaw, "covariance": [0.0] * 9} | pose
    body = {"landmarks": landmarks, "session": "monday", "map_pose": map_pose}
    client.put(f"{PLOTS}/submaps/{submap}", json=body).raise_for_status()


def table(client: httpx.Client, name: str, **parameters: Any) -> list[dict[str, str]]:
    """The rows of an export as CSV."""
    response = client.get(f"{PLOTS}/exports/{name}", params=parameters, headers={"Accept": "text/csv"})
    assert response.status_code == 200, response.text
    assert response.headers["content-type"].startswith("text/csv")
    return list(csv.DictReader(io.StringIO(response.text)))


@pytest.mark.parametrize("form", [one.name for one in FORMATS])
def test_landmarks_in_every_format_are_read_again(client: httpx.Client, tmp_path: Path, form: str) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    put_trees(client)
    [kind] = [one for one in FORMATS if one.name == form]
    response = client.get(f"{PLOTS}/exports/landmarks", headers={"Accept": kind.media_type})
    assert (response.status_code, response.headers["vary"].split(",")[0]) == (200, "Accept")
    assert response.headers["content-type"].split(";")[0] == kind.media_type
    assert response.headers["content-disposition"] == f"attachment; filename*=UTF-8''plots-landmarks{kind.suffix}"
    named = client.get(f"{PLOTS}/exports/landmarks", params={"format": form})
    path = tmp_path / f"trees{kind.suffix}"
    for content in (response.content, named.content):
        path.write_bytes(content)
        found = read_stem_map(path, ReadOptions(project="EPSG:25832") if form == "geojson" else ReadOptions())
        assert found.ids == tuple(f"t{i}" for i in range(60))
        assert (found.crs, found.dbh_cm is None) == ("EPSG:25832", False)
        np.testing.assert_array_equal(found.dbh_cm, 10.0 + np.arange(60.0))
        np.testing.assert_allclose(found.xy, POSE.apply(TREES), atol=2e-4)


def test_what_a_row_of_a_landmark_and_of_a_submap_tells(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832", "origin": [1000.0, 2000.0]}).raise_for_status()
    put_trees(client)
    first = table(client, "landmarks")[0]
    assert list(first)[:4] == ["id", "x", "y", "dbh_cm"]
    assert (first["submap"], first["session"], first["frame_id"], first["crs"]) == ("p", "monday", "map", "EPSG:25832")
    assert (float(first["x_submap"]), float(first["y_submap"])) == tuple(TREES[0])
    [submap] = table(client, "submaps")
    assert (submap["id"], submap["landmarks"], submap["crs"]) == ("p", "60", "EPSG:25832")
    middle = POSE.apply(TREES).mean(axis=0) + (1000.0, 2000.0)
    assert (float(submap["x"]), float(submap["y"])) == pytest.approx(tuple(middle), abs=1e-3)
    features = client.get(f"{PLOTS}/exports/submaps", params={"format": "geojson"}).json()["features"]
    assert features[0]["geometry"]["type"] == "Polygon"


def test_the_submaps_can_be_chosen(client: httpx.Client) -> None:
    put_trees(client)
    put_trees(client, "q", x=0.0, y=0.0)
    assert len(table(client, "landmarks")) == 120
    assert {row["submap"] for row in table(client, "landmarks", bbox="-50,-50,50,50")} == {"q"}
    assert table(client, "landmarks", session="tuesday") == []
    refusal = client.get(f"{PLOTS}/exports/landmarks", params={"bbox": "1,2,3"})
    assert (refusal.status_code, refusal.json()["errors"][0]["parameter"]) == (422, "bbox")
    assert client.get(f"{PLOTS}/exports/trees").status_code == 422
    assert client.get("/v1/collections/none/exports/landmarks").status_code == 404


def test_one_file_has_one_system(client: httpx.Client) -> None:
    put_trees(client)
    put_trees(client, "q", frame_id="site")
    answer = client.get(f"{PLOTS}/exports/landmarks", params={"format": "csv"})
    [fault] = answer.json()["errors"]
    assert (answer.status_code, fault["parameter"]) == (422, "frame_id")
    assert "'map' (local), 'site' (local)" in answer.json()["detail"]
    assert len(table(client, "landmarks", frame_id="site")) == 60
    utm = {"site": {"crs": "EPSG:25832"}}
    client.patch(PLOTS, json={"crs": "EPSG:25832", "frames": utm}).raise_for_status()
    assert {row["frame_id"] for row in table(client, "landmarks")} == {"map", "site"}


def test_without_a_system_there_is_no_geojson(client: httpx.Client) -> None:
    put_trees(client)
    refusal = client.get(f"{PLOTS}/exports/landmarks", headers={"Accept": "application/geo+json"})
    assert refusal.status_code == 406
    assert "no longitude" in refusal.json()["detail"] or "has a crs" in refusal.json()["detail"]
    assert client.get(f"{PLOTS}/exports/landmarks", headers={"Accept": "image/png"}).status_code == 406


def test_a_submap_without_a_map_pose_is_not_left_out(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    put_trees(client)
    client.put(f"{PLOTS}/submaps/lost", json={"xy": points(TREES)}).raise_for_status()
    rows = [row for row in table(client, "landmarks") if row["submap"] == "lost"]
    assert len(rows) == 60
    assert (rows[0]["x"], rows[0]["crs"], float(rows[0]["x_submap"])) == ("", "", TREES[0, 0])
    features = client.get(f"{PLOTS}/exports/landmarks", params={"format": "geojson"}).json()["features"]
    assert (features[-1]["geometry"], features[-1]["properties"]["no_geometry"]) == (None, "it has no map_pose")


def test_matches_and_pairs_of_stored_queries(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    put_trees(client)
    seen, _ = observed(TREES, 2, sigma=0.01)
    answer = client.post(f"{PLOTS}/queries", json={"xy": seen, "store": True}).json()
    client.post(f"{PLOTS}/queries", json={"xy": [[0, 0], [1, 1]], "store": True}).raise_for_status()
    best = answer["candidates"][0]
    placed, lost = table(client, "matches")
    assert (placed["verdict"], placed["submap"], placed["crs"]) == ("matched", "p", "EPSG:25832")
    assert (float(placed["x"]), float(placed["y"])) == pytest.approx(tuple(best["survey"]["crs_position"]), abs=1e-3)
    assert float(placed["turn_degrees"]) == best["survey"]["turn_degrees"]
    assert (lost["verdict"], lost["reason"], lost["x"], lost["submap"]) == ("no_match", "too_few_landmarks", "", "")
    pairs = table(client, "pairs")
    assert list(pairs[0])[:5] == ["query", "query_landmark", "submap_landmark", "x", "y"]
    assert len(pairs) == best["inlier_count"]
    there = POSE.apply(TREES)
    for pair in pairs[:5]:
        tree = int(pair["submap_landmark"].removeprefix("t"))
        assert (float(pair["x"]), float(pair["y"])) == pytest.approx(tuple(there[tree]), abs=1e-3)
        assert float(pair["submap_dbh_cm"]) == 10.0 + tree
    client.put(f"{PLOTS}/submaps/p", json={"xy": points(forest(2))}).raise_for_status()
    assert {row["x"] for row in table(client, "pairs")} == {""}


# ----------------------------------------------------------------- the command


def indexed(urquhart: Urquhart, tmp_path: Path, *options: object) -> np.ndarray[Any, Any]:
    """Index 200 trees in overlapping discs; the trees."""
    trees = forest(3, 200, 60.0) + FAR
    write_observation(tmp_path / "als.csv", trees, np.arange(200.0) / 10.0 + 10.0)
    said = urquhart("index", "als.csv", "--collection", "c", "--radius", 25, "--spacing", 20, *options)
    assert said.code == 0, said.err
    return trees


def test_a_tree_of_overlapping_submaps_is_one_row(urquhart: Urquhart, tmp_path: Path) -> None:
    trees = indexed(urquhart, tmp_path, "--crs", "EPSG:25832")
    for suffix in ("csv", "gpkg", "parquet"):
        said = urquhart("export", "landmarks", f"out.{suffix}", "--collection", "c")
        assert said.out == f"out.{suffix}: 200 landmarks, in EPSG:25832\n", said.err
        found = read_stem_map(tmp_path / f"out.{suffix}")
        order = np.argsort([int(name.removeprefix("q")) for name in found.ids])
        np.testing.assert_allclose(found.xy[order], trees, atol=2e-4)
        assert found.crs == "EPSG:25832"
        assert found.dbh_cm is not None
        np.testing.assert_allclose(found.dbh_cm[order], np.arange(200.0) / 10.0 + 10.0)
    every = urquhart("export", "landmarks", "every.csv", "--collection", "c", "--every")
    assert int(every.out.split()[1]) > 400
    geo = urquhart("export", "submaps", "out.geojson", "--collection", "c")
    assert geo.out.endswith("submaps, in longitude and latitude\n")
    features = json.loads((tmp_path / "out.geojson").read_bytes())["features"]
    assert {one["geometry"]["type"] for one in features} == {"Polygon"}


def test_a_map_without_a_system_is_a_local_frame(urquhart: Urquhart, tmp_path: Path) -> None:
    indexed(urquhart, tmp_path)
    said = urquhart("export", "landmarks", "out.gpkg", "--collection", "c")
    assert said.out == "out.gpkg: 200 landmarks, in metres of the local frame 'als'\n"
    assert read_stem_map(tmp_path / "out.gpkg").crs == "als (local frame)"
    refused(urquhart("export", "landmarks", "out.geojson", "--collection", "c"), "crs", "GeoPackage")
    assert not (tmp_path / "out.geojson").exists()


def test_what_cannot_be_exported_is_one_line(urquhart: Urquhart, tmp_path: Path) -> None:
    indexed(urquhart, tmp_path)
    refused(urquhart("export", "landmarks", "out.shp", "--collection", "c"), ".csv", ".gpkg")
    refused(urquhart("export", "landmarks", "no/out.csv", "--collection", "c"), "no such directory")
    refused(urquhart("export", "landmarks", "out.csv", "--collection", "d"), "no collection 'd'")
    refused(urquhart("export", "landmarks", "out.csv", "--collection", "c", "--bbox", "1,2"), "--bbox", "four numbers")
    trees = forest(4, 60) + FAR
    write_observation(tmp_path / "two.csv", trees)
    assert urquhart("index", "two.csv", "--collection", "c", "--one-submap").code == 0
    refused(urquhart("export", "landmarks", "out.csv", "--collection", "c"), "--frame", "'als' (local), 'two' (local)")
    assert urquhart("export", "landmarks", "out.csv", "--collection", "c", "--frame", "two").code == 0
