"""A stored match tree by tree, against all trees of the map, as CSV and as GeoJSON."""

import csv
import io

import httpx
import numpy as np

from tests.server.factories import forest, points

PLOTS = "/v1/collections/plots"
EAST, NORTH = 448_000.0, 5_411_000.0


def test_every_tree_of_a_match_is_listed_with_its_partner_in_the_map(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    trees = forest(1, count=120)
    dbh = np.arange(120) + 8.0
    for name, side in (("west", trees[:, 0] < 8.0), ("east", trees[:, 0] > -8.0)):
        listed = [
            {"id": f"t{i}", "x": x, "y": y, "dbh_cm": dbh[i]} for i, (x, y) in enumerate(points(trees)) if side[i]
        ]
        pose = {"x": EAST, "y": NORTH, "yaw": 0.0}
        client.put(f"{PLOTS}/submaps/{name}", json={"landmarks": listed, "map_pose": pose}).raise_for_status()
    away = np.hypot(*trees.T)
    gone = np.argsort(away)[:2].tolist()
    seen = np.setdiff1d(np.flatnonzero(away < 20.0), gone)
    body = {
        "xy": [*points(trees[seen] - (3.0, 1.0)), [0.7, 25.0]],
        "ids": [f"q{i}" for i in seen] + ["new"],
        "store": True,
    }
    answer = client.post(f"{PLOTS}/queries", json=body).json()
    assert answer["verdict"] == "matched"
    match = answer["candidates"][0]["links"]["match"]
    told = client.get(match, headers={"Accept": "text/csv"})
    assert (told.status_code, told.headers["content-type"].split(";")[0]) == (200, "text/csv")
    rows = list(csv.DictReader(io.StringIO(told.text)))
    both = [row for row in rows if row["seen"] == "both"]
    assert [(row["tag"], row["partner"]) for row in both] == [(f"q{i}", f"t{i}") for i in seen]
    assert [float(row["partner_dbh_cm"]) for row in both] == dbh[seen].tolist()
    assert [row["tag"] for row in rows if row["seen"] == "query"] == ["new"]
    assert {int(row["partner"][1:]) for row in rows if row["seen"] == "map"} >= set(gone)
    assert abs(float(both[0]["x"]) - EAST - trees[seen[0], 0]) < 0.05
    features = client.get(match, headers={"Accept": "application/geo+json"}).json()["features"]
    assert len(features) == len(rows)
    longitude, latitude = features[0]["geometry"]["coordinates"]
    assert (round(longitude), round(latitude)) == (8, 49)
    assert client.get(match, headers={"Accept": "image/png"}).status_code == 406
