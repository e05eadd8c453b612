"""A CRS and an origin for each map frame: where submaps are on Earth, and what cannot be there."""

from typing import Any

import httpx
import numpy as np
import orjson
import pytest
from pyproj import Transformer

from server.collections.georeference import Georeference
from server.store.records import FrameReference
from server.store.submap_records import Place
from tests.server.factories import forest, points, put_submap

PLOTS = "/v1/collections/plots"
GEOJSON = {"Accept": "application/geo+json"}
UTM_33: dict[str, Any] = {"crs": "EPSG:32633", "origin": [450_000.0, 5_411_000.0]}


def place(client: httpx.Client, submap: str, frame_id: str, x: float, y: float, seed: int = 1) -> httpx.Response:
    return put_submap(client, "plots", submap, seed, map_pose={"frame_id": frame_id, "x": x, "y": y, "yaw": 0.0})


def middles(client: httpx.Client) -> dict[str, tuple[float, float] | None]:
    """Longitude and latitude of the middle of each submap's footprint; None without geometry."""
    found: dict[str, tuple[float, float] | None] = {}
    response = client.get(f"{PLOTS}/submaps", headers=GEOJSON)
    assert response.status_code == 200, response.text
    for feature in response.json()["features"]:
        geometry = feature["geometry"]
        assert (geometry is None) == ("no_geometry" in feature["properties"])
        if geometry is None:
            found[feature["id"]] = None
        else:
            ring = np.array(geometry["coordinates"][0])
            low, high = ring.min(axis=0), ring.max(axis=0)
            found[feature["id"]] = (float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2)
    return found


def test_each_map_frame_has_its_own_place_on_earth(client: httpx.Client) -> None:
    """Two local stands that both begin at (0, 0), and a map in full UTM coordinates."""
    for frame_id, x, y in (("a", 100.0, 50.0), ("b", 100.0, 50.0), ("utm", 448_125.0, 5_411_179.0)):
        place(client, f"{frame_id}-0-0", frame_id, x, y).raise_for_status()
    frames = {"a": UTM_33, "b": {"crs": "EPSG:32632", "origin": [500_000.0, 5_300_000.0]}, "utm": {"crs": "EPSG:32633"}}
    assert client.get(f"{PLOTS}/submaps", headers=GEOJSON).status_code == 406
    changed = client.patch(PLOTS, json={"frames": frames})
    assert changed.status_code == 200, changed.text
    assert changed.json()["frames"] == {name: {"origin": None} | frame for name, frame in frames.items()}
    found = middles(client)
    for name, zone, east, north in (
        ("a-0-0", "EPSG:32633", 450_100.0, 5_411_050.0),
        ("b-0-0", "EPSG:32632", 500_100.0, 5_300_050.0),
        ("utm-0-0", "EPSG:32633", 448_125.0, 5_411_179.0),
    ):
        lon, lat = Transformer.from_crs(zone, "OGC:CRS84", always_xy=True).transform(east, north)
        middle = found[name]
        assert middle is not None
        assert middle == pytest.approx((lon, lat), abs=1e-4)


def test_a_frame_without_crs_has_no_geometry_and_says_so(client: httpx.Client) -> None:
    """The collection's own crs is that of the frame `map`, and of no other."""
    client.patch(PLOTS, json=UTM_33).raise_for_status()
    place(client, "here", "map", 0.0, 0.0).raise_for_status()
    place(client, "local", "stand-7", 0.0, 0.0).raise_for_status()
    put_submap(client, "plots", "lost", 3).raise_for_status()
    found = middles(client)
    assert (found["here"] is None, found["local"], found["lost"]) == (False, None, None)
    features = client.get(f"{PLOTS}/submaps", headers=GEOJSON).json()["features"]
    assert features[1]["properties"]["no_geometry"] == (
        "the map frame 'stand-7' has no crs: set it in the collection's frames"
    )
    refused = client.get(f"{PLOTS}/submaps/local/tessellation", headers=GEOJSON)
    assert refused.status_code == 406
    assert "'stand-7' has no crs" in refused.json()["detail"]
    before = client.get(f"{PLOTS}/submaps/local/tessellation").headers["ETag"]
    client.patch(PLOTS, json={"frames": {"stand-7": UTM_33}}).raise_for_status()
    assert client.get(f"{PLOTS}/submaps/local/tessellation", headers=GEOJSON).status_code == 200
    assert client.get(f"{PLOTS}/submaps/local/tessellation").headers["ETag"] != before
    assert middles(client)["local"] == middles(client)["here"]


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"crs": "EPSG:32633", "origin": [450_000.0, 5_411_000.0]}, "/crs"),
        ({"frames": {"a/b~c": {"crs": "EPSG:32633"}}}, "/frames/a~1b~0c"),
        ({"frames": {"a/b~c": {"crs": "EPSG:2154"}}}, "/frames/a~1b~0c"),
    ],
)
def test_a_crs_that_puts_submaps_elsewhere_names_frame_submap_and_place(
    client: httpx.Client, body: dict[str, Any], pointer: str
) -> None:
    place(client, "als-0-0", "map", 448_125.0, 5_411_179.0).raise_for_status()
    place(client, "local-0-0", "a/b~c", 0.0, 0.0).raise_for_status()
    before = client.get(PLOTS).json()
    refused = client.patch(PLOTS, json=body)
    assert refused.status_code == 422, refused.text
    (error,) = refused.json()["errors"]
    assert error["pointer"] == pointer
    frame, submap = ("map", "als-0-0") if pointer == "/crs" else ("a/b~c", "local-0-0")
    for word in (f"submap '{submap}'", f"map frame '{frame}'", " E, " if frame == "map" else ", ", "area of use of"):
        assert word in error["detail"], error["detail"]
    assert client.get(PLOTS).json() == before


def test_a_pose_that_the_crs_does_not_reach_is_refused_wherever_it_comes_in(client: httpx.Client) -> None:
    client.patch(PLOTS, json=UTM_33).raise_for_status()
    pose = {"x": 448_125.0, "y": 5_411_179.0, "yaw": 0.0}
    body = {"xy": points(forest(1)), "map_pose": pose}
    put_submap(client, "plots", "there", 1, map_pose=pose | {"x": 0.0, "y": 0.0}).raise_for_status()
    for refused in (
        client.put(f"{PLOTS}/submaps/new", json=body),
        client.post(f"{PLOTS}/submaps", json=body),
        client.patch(f"{PLOTS}/submaps/there", json={"map_pose": pose}),
    ):
        assert refused.status_code == 422, refused.text
        (error,) = refused.json()["errors"]
        assert error["pointer"] == "/map_pose"
        assert "map frame 'map' at " in error["detail"]
        assert "outside the area of use of WGS 84 / UTM zone 33N" in error["detail"]
        assert "leave out the origin" in error["detail"]
    assert client.get(PLOTS).json()["counts"]["submaps"] == 1
    # A frame with another name is not concerned, and a PATCH of something else leaves the pose alone.
    assert place(client, "local", "stand", 448_125.0, 5_411_179.0).status_code == 201
    assert client.patch(f"{PLOTS}/submaps/there", json={"properties": {"a": 1}}).is_success


def test_lines_of_an_import_are_refused_one_by_one(client: httpx.Client) -> None:
    client.patch(PLOTS, json=UTM_33).raise_for_status()
    lines = b"\n".join(
        orjson.dumps({"id": f"s{i}", "xy": points(forest(i)), "map_pose": {"x": x, "y": 0.0, "yaw": 0.0}})
        for i, x in enumerate([0.0, 9e7])
    )
    job = client.post(f"{PLOTS}/imports", content=lines, headers={"Content-Type": "application/x-ndjson"}).json()
    done = client.get(f"/v1/jobs/{job['id']}", params={"wait": 25}).json()
    assert done["counts"] == {"created": 1, "refused": 1}


@pytest.mark.parametrize(
    ("crs", "reason"),
    [
        ("EPSG:3857", "not true to scale"),
        ("EPSG:3395", "not true to scale"),
        ("EPSG:32662", "not true to scale"),
        ("ESRI:54009", "not true to scale"),
        ("EPSG:4326", "gives degrees"),
        ("EPSG:4979", "gives degrees"),
        ("EPSG:2264", "is in US survey foot"),
        ("EPSG:2048", "axes that point west and south"),
        ("EPSG:4978", "is not projected"),
        ("EPSG:5773", "is not projected"),
        ("EPSG:3857+5773", "not true to scale"),
        ("EPSG:4326+5773", "gives degrees"),
        ("EPSG:2264+5773", "is in US survey foot"),
    ],
)
def test_systems_that_cannot_hold_submaps_are_refused_with_the_reason(
    shared_client: httpx.Client, crs: str, reason: str
) -> None:
    for body, pointer in (({"crs": crs}, "/crs"), ({"frames": {"stand": {"crs": crs}}}, "/frames/stand/crs")):
        refused = shared_client.patch(PLOTS, json=body)
        assert refused.status_code == 422, crs
        (error,) = refused.json()["errors"]
        assert (error["code"], error["pointer"]) == ("crs", pointer)
        assert reason in error["detail"]
        assert "Use the UTM zone" in error["detail"]
    assert shared_client.put("/v1/collections/new", json={"crs": crs}).status_code == 422


@pytest.mark.parametrize(
    "crs",
    ["EPSG:32633", "EPSG:25832", "EPSG:31467", "EPSG:2154", "EPSG:3035", "EPSG:3577", "EPSG:5514", "EPSG:2193",
     "EPSG:32701", "EPSG:5070", "EPSG:32633+5773", "EPSG:5555", "+proj=utm +zone=33"],
)  # fmt: skip
def test_national_grids_are_taken(client: httpx.Client, crs: str) -> None:
    assert client.patch(PLOTS, json={"frames": {"stand": {"crs": crs}}}).status_code == 200


@pytest.mark.parametrize(
    ("crs", "x", "y", "fault"),
    [
        ("EPSG:32633+5773", 448_100.0, 5_411_000.0, None),
        ("EPSG:32633+5773", 1_500_000.0, 5_411_000.0, "outside the area of use"),
        ("+proj=utm +zone=33", 448_100.0, 5_411_000.0, None),
        ("+proj=utm +zone=33", -2e7, 0.0, "nowhere on Earth"),
        ("+proj=laea +lat_0=50 +lon_0=10", 1e5, 1e5, None),
        ("+proj=laea +lat_0=50 +lon_0=10", 2e7, 0.0, "nowhere on Earth"),
        ("+proj=tmerc +k=10", 0.0, 0.0, "off by a factor of 10"),
    ],
)
def test_poses_in_systems_with_heights_or_without_a_known_area_are_checked(
    client: httpx.Client, crs: str, x: float, y: float, fault: str | None
) -> None:
    assert client.patch(PLOTS, json={"frames": {"stand": {"crs": crs}}}).status_code == 200
    response = place(client, "one", "stand", x, y)
    if fault is None:
        assert response.status_code == 201
        assert middles(client)["one"] is not None
    else:
        assert response.status_code == 422
        assert fault in response.json()["errors"][0]["detail"]


def test_frames_of_a_collection_agree_or_are_changed(client: httpx.Client) -> None:
    body = {"frames": {"a": UTM_33, "b": {"crs": "EPSG:25833"}}}
    assert client.put("/v1/collections/c", json=body).status_code == 201
    assert client.put("/v1/collections/c", json=body).status_code == 200
    assert client.put("/v1/collections/c", json={"frames": {"a": UTM_33}}).status_code == 200
    assert client.put("/v1/collections/c", json={"frames": {"a": {"crs": "EPSG:32633"}}}).status_code == 409
    assert client.put("/v1/collections/c", json={"frames": {"c": UTM_33}}).status_code == 409
    first = client.get("/v1/collections/c")
    unchanged = client.patch("/v1/collections/c", json={"frames": {"a": UTM_33, "z": None}})
    assert unchanged.headers["ETag"] == first.headers["ETag"]
    changed = client.patch("/v1/collections/c", json={"frames": {"a": None, "c": UTM_33}})
    assert changed.headers["ETag"] != first.headers["ETag"]
    assert changed.json()["frames"] == {"b": {"crs": "EPSG:25833", "origin": None}, "c": UTM_33}
    own = client.patch("/v1/collections/c", json={"frames": {"map": UTM_33}})
    assert (own.status_code, own.json()["errors"][0]["pointer"]) == (422, "/frames/map")
    assert "frames" not in client.get("/v1/collections").json()["collections"][0]
    assert client.delete("/v1/collections/c").status_code == 204
    assert client.put("/v1/collections/c", json={}).json()["frames"] == {}


@pytest.mark.parametrize("trees", [[], [[1.0, 2.0]], [[1.0, 2.0], [5.0, 9.0]], [[float(i), 0.0] for i in range(5)]])
def test_a_footprint_without_area_is_its_points(trees: list[list[float]]) -> None:
    """A clearing with hardly a tree, and trees in a row."""
    place = Place("map", 0.0, 0.0, 0.0, None, 0.0, 0.0, 5.0, 9.0)
    reference = FrameReference("EPSG:32633", (500_000.0, 5_000_000.0))
    footprint = Georeference(reference).footprint(place, np.array(trees).reshape(-1, 2))
    assert footprint is not None
    assert footprint["type"] == "MultiPoint"
    assert len(footprint["coordinates"]) == max(1, len(trees))
    assert footprint["coordinates"][0] == pytest.approx((15.0, 45.153), abs=0.001)


def test_a_submap_on_the_other_side_of_the_date_line(client: httpx.Client) -> None:
    """New Zealand's grid reaches from 160 degrees east to 171 degrees west."""
    east, north = Transformer.from_crs("OGC:CRS84", "EPSG:2193", always_xy=True).transform(178.9, -38.0)
    client.patch(PLOTS, json={"frames": {"nz": {"crs": "EPSG:2193"}}}).raise_for_status()
    assert place(client, "nz", "nz", east, north).status_code == 201
    assert middles(client)["nz"] == pytest.approx((178.9, -38.0), abs=1e-3)
