"""Submaps: stored, replaced, read, moved, listed, drawn."""

import math
from typing import Any

import httpx
import numpy as np
import pytest

from server.checks.derived_columns import content_discrepancies
from server.service_parts import Service
from tests.server.factories import forest, points, put_submap

PLOTS = "/v1/collections/plots"
FULL: dict[str, Any] = {
    "frame_id": "plot_7",
    "stamp": "2026-05-04T11:30:00.25+02:00",
    "session": "drive-2",
    "landmarks": [
        {"id": "a", "x": 0.0, "y": 0.0, "dbh_cm": 30.0, "height_m": 18.0, "species": "Picea abies"},
        {"id": "b", "x": 10.0, "y": 0.5},
        {"x": 4.0, "y": 9.0, "dbh_cm": 20.0},
        {"x": 11.0, "y": 12.0},
    ],
    "map_pose": {"x": 100.0, "y": 50.0, "yaw": math.pi / 2, "covariance": [1, 0, 0, 0, 1, 0, 0, 0, 0.01]},
    "properties": {"observer": {"name": "robot-2"}},
}


def test_everything_that_is_posted_comes_back(client: httpx.Client) -> None:
    put = client.put(f"{PLOTS}/submaps/p7", json=FULL)
    assert put.status_code == 201
    assert put.headers["Location"] == f"{PLOTS}/submaps/p7"
    receipt = put.json()
    assert (receipt["outcome"], receipt["revision"], receipt["counts"]["landmarks"]) == ("created", 1, 4)
    submap = client.get(put.headers["Location"]).json()
    assert submap["landmarks"] == [
        FULL["landmarks"][0],
        FULL["landmarks"][1] | {"dbh_cm": None, "height_m": None, "species": None},
        {"id": "2", "dbh_cm": 20.0, "height_m": None, "species": None, "x": 4.0, "y": 9.0},
        {"id": "3", "dbh_cm": None, "height_m": None, "species": None, "x": 11.0, "y": 12.0},
    ]
    assert submap["stamp"] == "2026-05-04T09:30:00.250000Z"
    placed = {"frame_id": "map", "covariance_frame": "map", "about": "submap_origin"}
    assert submap["map_pose"] == FULL["map_pose"] | placed
    assert (submap["frame_id"], submap["session"], submap["properties"]) == ("plot_7", "drive-2", FULL["properties"])
    assert put.headers["ETag"] == f'"{submap["etag"]}"'


def test_positions_keep_every_bit(client: httpx.Client) -> None:
    xy = points(forest(3) + np.array([412_345.678901234, 5_812_345.678901234]))
    client.put(f"{PLOTS}/submaps/utm", json={"xy": xy}).raise_for_status()
    landmarks = client.get(f"{PLOTS}/submaps/utm").json()["landmarks"]
    assert [[tree["x"], tree["y"]] for tree in landmarks] == xy


def test_put_is_idempotent_and_replaces(client: httpx.Client) -> None:
    first = put_submap(client, "plots", "p1", 1)
    again = put_submap(client, "plots", "p1", 1)
    assert (again.status_code, again.json()["outcome"], again.json()["revision"]) == (200, "unchanged", 1)
    assert again.headers["ETag"] == first.headers["ETag"]
    other = put_submap(client, "plots", "p1", 2)
    assert (other.status_code, other.json()["outcome"], other.json()["revision"]) == (200, "replaced", 2)
    renamed = put_submap(client, "plots", "p1", 2, session="s")
    assert (renamed.json()["outcome"], renamed.json()["counts"]) == ("replaced", other.json()["counts"])
    collection = client.get(PLOTS).json()
    assert (collection["counts"]["submaps"], collection["counts"]["landmarks"], collection["revision"]) == (1, 60, 3)
    assert client.get(f"{PLOTS}/submaps/p1").json()["session"] == "s"


def test_stamps_are_kept_to_the_microsecond(client: httpx.Client, document: dict[str, Any]) -> None:
    """Robots send nine digits. What is cut off makes no other moment."""
    first = put_submap(client, "plots", "p1", 1, stamp="2026-05-04T09:30:00.123456789Z")
    assert client.get(f"{PLOTS}/submaps/p1").json()["stamp"] == "2026-05-04T09:30:00.123456Z"
    for same in ("2026-05-04T09:30:00.123456Z", "2026-05-04T11:30:00.1234561+02:00"):
        again = put_submap(client, "plots", "p1", 1, stamp=same)
        assert (again.json()["outcome"], again.headers["ETag"]) == ("unchanged", first.headers["ETag"])
    other = put_submap(client, "plots", "p1", 1, stamp="2026-05-04T09:30:00.123457Z")
    assert other.json()["outcome"] == "replaced"
    assert "Stored to the microsecond" in str(document)


def test_a_stamp_is_the_same_moment_in_every_offset(client: httpx.Client, service: Service) -> None:
    first = put_submap(client, "plots", "p1", 1, stamp="2026-05-04T11:30:00+02:00")
    again = put_submap(client, "plots", "p1", 1, stamp="2026-05-04T09:30:00Z")
    assert (again.json()["outcome"], again.headers["ETag"]) == ("unchanged", first.headers["ETag"])
    assert list(content_discrepancies(service.database)) == []
    there = client.get(f"{PLOTS}/submaps/p1").json()
    patched = client.patch(f"{PLOTS}/submaps/p1", json={"properties": {}}, headers={"If-Match": first.headers["ETag"]})
    back = client.patch(f"{PLOTS}/submaps/p1", json={"properties": None})
    assert (there["stamp"], patched.status_code) == ("2026-05-04T09:30:00Z", 200)
    assert back.json()["etag"] == first.json()["etag"]


def test_what_is_stored_makes_the_entity_tag_that_was_told(client: httpx.Client, service: Service) -> None:
    pose = {"x": -0.0, "y": 1e-300, "yaw": -0.0, "covariance": [1, -0.0, 0, -0.0, 1, 0, 0, 0, 1]}
    properties = {"b": -0.0, "a": [1e22, 2**64 - 1, -(2**63), 1.0, 5e-324], "\u00e9": {"\U0001f332": None}}
    put_submap(client, "plots", "p1", 1, map_pose=pose, properties=properties).raise_for_status()
    put_submap(client, "plots", "p2", 2).raise_for_status()
    client.patch(f"{PLOTS}/submaps/p2", json={"map_pose": pose, "properties": properties}).raise_for_status()
    assert list(content_discrepancies(service.database)) == []


def test_preconditions_of_put_and_delete(client: httpx.Client) -> None:
    url, body = f"{PLOTS}/submaps/p1", {"xy": points(forest(1))}
    assert client.put(url, json=body, headers={"If-Match": "*"}).status_code == 412
    made = client.put(url, json=body, headers={"If-None-Match": "*"})
    assert made.status_code == 201
    etag = made.headers["ETag"]
    refused = client.put(url, json={"xy": points(forest(2))}, headers={"If-None-Match": "*"})
    assert (refused.status_code, refused.headers["ETag"], refused.json()["etag"]) == (412, etag, etag.strip('"'))
    assert client.put(url, json={"xy": points(forest(2))}, headers={"If-Match": '"other", "two"'}).status_code == 412
    replaced = client.put(url, json={"xy": points(forest(2))}, headers={"If-Match": f'"x", {etag}'})
    assert replaced.status_code == 200
    assert client.delete(url, headers={"If-Match": etag}).status_code == 412
    assert client.delete(url, headers={"If-Match": replaced.headers["ETag"]}).status_code == 204
    assert client.delete(url).status_code == 404
    assert client.get(PLOTS).json()["counts"] == {"submaps": 0, "landmarks": 0, "polygons": 0}


def test_conditional_get(client: httpx.Client) -> None:
    etag = put_submap(client, "plots", "p1", 1).headers["ETag"]
    current = client.get(f"{PLOTS}/submaps/p1", headers={"If-None-Match": f"W/{etag}"})
    assert (current.status_code, current.content, current.headers["ETag"]) == (304, b"", etag)
    assert client.get(f"{PLOTS}/submaps/p1", headers={"If-None-Match": '"other"'}).status_code == 200


def test_patch_moves_without_indexing(client: httpx.Client) -> None:
    before = put_submap(client, "plots", "p1", 1, properties={"a": 1}).json()
    moved = client.patch(f"{PLOTS}/submaps/p1", json={"map_pose": {"x": 5, "y": 6, "yaw": 0.5}})
    assert moved.status_code == 200
    expected = {"frame_id": "map", "x": 5.0, "y": 6.0, "yaw": 0.5, "covariance": None}
    assert moved.json()["map_pose"] == expected | {"covariance_frame": "map", "about": "submap_origin"}
    assert moved.json()["properties"] == {"a": 1}
    assert moved.headers["ETag"] != f'"{before["etag"]}"'
    assert moved.json()["revision"] == 2
    same = client.patch(f"{PLOTS}/submaps/p1", json={"map_pose": {"x": 5, "y": 6, "yaw": 0.5}})
    assert same.json()["revision"] == 2
    cleared = client.patch(f"{PLOTS}/submaps/p1", json={"map_pose": None, "properties": None}).json()
    assert (cleared["map_pose"], cleared["properties"]) == (None, None)
    assert put_submap(client, "plots", "p1", 1).json()["outcome"] == "unchanged"
    assert client.patch(f"{PLOTS}/submaps/nope", json={}).status_code == 404
    stale = client.patch(f"{PLOTS}/submaps/p1", json={"properties": {}}, headers={"If-Match": '"old"'})
    assert stale.status_code == 412


def test_pages_and_filters(client: httpx.Client) -> None:
    for i in range(7):
        fields: dict[str, Any] = {"session": f"s{i % 2}", "stamp": f"2026-05-0{i + 1}T00:00:00Z"}
        if i != 6:
            fields["map_pose"] = {"frame_id": "m" if i < 5 else "n", "x": 200.0 * i, "y": 0.0, "yaw": 0.1}
        put_submap(client, "plots", f"p{i}", i, **fields).raise_for_status()

    def ids(**parameters: Any) -> list[str]:
        page = client.get(f"{PLOTS}/submaps", params=parameters)
        assert page.status_code == 200, page.text
        return [submap["id"] for submap in page.json()["submaps"]]

    assert ids() == [f"p{i}" for i in range(7)]
    assert ids(session="s1") == ["p1", "p3", "p5"]
    assert ids(session="none") == []
    assert ids(bbox="150,-50,450,50") == ["p1", "p2"]
    assert ids(bbox="-1e6,-1e6,1e6,1e6") == [f"p{i}" for i in range(6)]
    assert ids(bbox="-1e6,-1e6,1e6,1e6", frame_id="n") == ["p5"]
    assert ids(datetime="2026-05-03T00:00:00Z") == ["p2"]
    assert ids(datetime="2026-05-03T00:00:00Z/2026-05-04T01:00:00+01:00") == ["p2", "p3"]
    assert ids(datetime="../2026-05-02T00:00:00Z", session="s0") == ["p0"]
    assert ids(datetime="2026-05-06T00:00:00Z/..") == ["p5", "p6"]

    first = client.get(f"{PLOTS}/submaps", params={"limit": 2, "session": "s0"})
    assert [submap["id"] for submap in first.json()["submaps"]] == ["p0", "p2"]
    assert "landmarks" not in first.json()["submaps"][0]
    following = client.get(first.links["next"]["url"])
    assert [submap["id"] for submap in following.json()["submaps"]] == ["p4", "p6"]
    assert "next" not in following.json()
    assert "next" not in following.links


@pytest.mark.parametrize(
    "parameters",
    [
        {"bbox": "1,2,3"},
        {"bbox": "3,0,1,2"},
        {"bbox": "a,b,c,d"},
        {"bbox": "nan,0,1,1"},
        {"datetime": "yesterday"},
        {"datetime": "2026-05-01"},
        {"datetime": "../.."},
        {"datetime": "2026-05-02T00:00:00Z/2026-05-01T00:00:00Z"},
        {"limit": "1e3"},
        {"cursor": "WyJjb2xsZWN0aW9ucyIsMV0"},
    ],
)
def test_filters_that_cannot_be(client: httpx.Client, parameters: dict[str, str]) -> None:
    response = client.get(f"{PLOTS}/submaps", params=parameters)
    assert response.status_code == 422
    assert response.json()["errors"][0]["parameter"] == next(iter(parameters))


def test_geojson_of_a_collection_with_crs(client: httpx.Client) -> None:
    put_submap(client, "plots", "placed", 1, map_pose={"x": 0.0, "y": 0.0, "yaw": 0.0}).raise_for_status()
    put_submap(client, "plots", "lost", 2).raise_for_status()
    accept = {"Accept": "application/geo+json"}
    refused = client.get(f"{PLOTS}/submaps", headers=accept)
    assert refused.status_code == 406
    assert "crs" in refused.json()["detail"]
    client.patch(PLOTS, json={"crs": "EPSG:32633", "origin": [500_000.0, 5_000_000.0]}).raise_for_status()
    response = client.get(f"{PLOTS}/submaps", headers=accept)
    assert response.headers["Content-Type"] == "application/geo+json"
    placed, lost = response.json()["features"]
    assert (placed["id"], lost["id"], lost["geometry"]) == ("placed", "lost", None)
    ring = np.array(placed["geometry"]["coordinates"][0])
    assert ring[0].tolist() == ring[-1].tolist()
    # 500 km east is the zone's central meridian; 5,000 km north is about 45.15 degrees, by 111 km to the degree.
    assert np.abs(ring[:, 0] - 15.0).max() < 40 / 78_000
    assert np.abs(ring[:, 1] - 45.1535).max() < 40 / 111_000 + 0.001
    x, y = ring[:-1].T
    assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0
    assert client.get(f"{PLOTS}/submaps", headers={"Accept": "text/csv"}).status_code == 406


def test_tessellation_in_its_three_forms(client: httpx.Client) -> None:
    put_submap(client, "plots", "p1", 1).raise_for_status()
    url = f"{PLOTS}/submaps/p1/tessellation"
    response = client.get(url)
    seen = response.json()
    assert len(seen["triangles"]) == seen["counts"]["triangles"]
    assert len(seen["polygons"]) == seen["counts"]["polygons"] > 0
    xy = np.array([[tree["x"], tree["y"]] for tree in seen["landmarks"]])
    for shape in [*seen["triangles"], *(polygon["vertices"] for polygon in seen["polygons"])]:
        x, y = xy[shape].T
        assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0
    assert client.get(url, headers={"If-None-Match": response.headers["ETag"]}).status_code == 304

    drawing = client.get(url, headers={"Accept": "image/svg+xml"})
    assert drawing.headers["Content-Type"] == "image/svg+xml"
    assert drawing.text.lstrip().startswith("<svg")
    assert drawing.headers["ETag"] != response.headers["ETag"]

    accept = {"Accept": "application/geo+json"}
    others = ["application/json", "image/svg+xml"]
    without_crs = client.get(url, headers=accept)
    assert (without_crs.status_code, without_crs.json()["offered"]) == (406, others)
    client.patch(PLOTS, json={"crs": "EPSG:32633", "origin": [500_000.0, 5_000_000.0]}).raise_for_status()
    unplaced = client.get(url, headers=accept)
    assert (unplaced.status_code, unplaced.json()["offered"]) == (406, others)
    client.patch(f"{PLOTS}/submaps/p1", json={"map_pose": {"x": 0, "y": 0, "yaw": 1}}).raise_for_status()
    features = client.get(url, headers=accept).json()["features"]
    assert [feature["properties"]["vertices"] for feature in features] == [p["vertices"] for p in seen["polygons"]]
    nowhere = client.patch(f"{PLOTS}/submaps/p1", json={"map_pose": {"x": 9e7, "y": 9e7, "yaw": 1}})
    assert (nowhere.status_code, nowhere.json()["errors"][0]["pointer"]) == (422, "/map_pose")


def test_unknown_submaps(client: httpx.Client) -> None:
    for path in ("submaps/nope", "submaps/nope/tessellation"):
        assert client.get(f"{PLOTS}/{path}").status_code == 404
    assert client.get("/v1/collections/nope/submaps").status_code == 404
    assert put_submap(client, "nope", "p1", 1).status_code == 404
