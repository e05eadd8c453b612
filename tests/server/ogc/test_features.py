"""OGC API - Features: what a GIS reads, page by page, while others write."""

import importlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from server.ogc import items
from server.ogc.boxes import DegreeBox, read_box
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from tests.server.factories import forest, points
from tests.server.served import Threaded, starting

pyogrio: Any = importlib.import_module("pyogrio")

PLOTS = "/v1/collections/plots"
LANDMARKS = "/ogc/collections/plots:landmarks"
SUBMAPS = "/ogc/collections/plots:submaps"
FAR = np.array([448_100.0, 5_411_000.0])
TREES = forest(1)


def put_trees(client: httpx.Client, submap: str = "p", offset: float = 0.0, **members: Any) -> None:
    """Store the forest with ids and diameters, `offset` metres east of `FAR`."""
    landmarks = [{"id": f"t/{i}", "x": x, "y": y, "dbh_cm": 10.0 + i} for i, (x, y) in enumerate(points(TREES))]
    pose = {"x": FAR[0] + offset, "y": FAR[1], "yaw": 0.0}
    body = {"landmarks": landmarks, "map_pose": pose, **members}
    client.put(f"{PLOTS}/submaps/{submap}", json=body).raise_for_status()


def placed(client: httpx.Client) -> None:
    """Say where the map is, and store two submaps in it, a kilometre apart."""
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    put_trees(client)
    put_trees(client, "q", 1000.0, stamp="2026-05-04T09:30:00Z")


def followed(client: httpx.Client, path: str, **parameters: Any) -> Iterator[dict[str, Any]]:
    """The pages from the first on, by their links."""
    url: str | None = f"{path}?{httpx.QueryParams(parameters)}"
    while url is not None:
        response = client.get(url)
        assert response.status_code == 200, response.text
        assert response.headers["content-type"] == "application/geo+json"
        page = response.json()
        assert page["numberReturned"] == len(page["features"])
        yield page
        url = next((link["href"] for link in page["links"] if link["rel"] == "next"), None)


def ids_of(client: httpx.Client, path: str, **parameters: Any) -> list[str]:
    return [one["id"] for page in followed(client, path, **parameters) for one in page["features"]]


def test_links_lead_from_the_landing_page_to_a_feature(client: httpx.Client) -> None:
    placed(client)

    def leads(document: dict[str, Any], relation: str) -> Any:
        [href] = [link["href"] for link in document["links"] if link["rel"] == relation]
        assert urlsplit(href).scheme == "http"
        return client.get(href)

    landing = client.get("/ogc").json()
    assert client.get("/ogc/").json() == landing
    assert leads(landing, "service-desc").json()["openapi"].startswith("3.1")
    assert leads(landing, "service-doc").status_code == 200
    classes = leads(landing, "conformance").json()["conformsTo"]
    assert [one.rsplit("/", 1)[1] for one in classes] == ["core", "geojson"]
    listed = leads(landing, "data").json()["collections"]
    assert [one["id"] for one in listed] == ["plots:landmarks", "plots:submaps"]
    assert leads(listed[0], "self").json() == listed[0]
    [(west, south, east, north)] = listed[0]["extent"]["spatial"]["bbox"]
    assert 8.28 < west < 8.30 < east < 8.32
    assert 48.84 < south < north < 48.86
    page = leads(listed[0], "items").json()
    first = page["features"][0]
    assert (first["id"], first["geometry"]["type"], first["properties"]["dbh_cm"]) == ("p:t/0", "Point", 10.0)
    feature = client.get(f"{LANDMARKS}/items/p%3At%2F0").json()
    assert {name: feature[name] for name in first} == first
    assert leads(feature, "self").json() == feature
    outline = client.get(f"{SUBMAPS}/items/q").json()
    assert (outline["geometry"]["type"], outline["properties"]["landmarks"]) == ("Polygon", 60)
    for path in (
        f"{LANDMARKS}/items/p:none",
        f"{LANDMARKS}/items/p",
        f"{SUBMAPS}/items/p:t/0",
        f"{SUBMAPS}/items/none",
    ):
        assert client.get(path).status_code == 404


def test_pages_do_not_move_while_others_write(client: httpx.Client) -> None:
    placed(client)
    expected = [f"{submap}:t/{i}" for submap in "pq" for i in range(60)]
    for limit in (7, 60, 1000):
        assert ids_of(client, f"{LANDMARKS}/items", limit=limit) == expected
    found = []
    for number, page in enumerate(followed(client, f"{LANDMARKS}/items", limit=25)):
        found += [one["id"] for one in page["features"]]
        if number < 3:
            put_trees(client, f"new{number}", 500.0)
        if number == 1:
            client.delete(f"{PLOTS}/submaps/p").raise_for_status()
    # After two pages of 25, `p` was gone.
    assert found[:110] == expected[:50] + expected[60:]
    assert [one for one in found[110:] if one.endswith(":t/0")] == ["new0:t/0", "new1:t/0", "new2:t/0"]
    assert len(set(found)) == len(found)


def test_a_box_and_an_interval_choose(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    placed(client)
    [(west, south, east, north)] = client.get(SUBMAPS).json()["extent"]["spatial"]["bbox"]
    middle = (west + east) / 2
    assert ids_of(client, f"{SUBMAPS}/items", bbox=f"{west},{south},{middle},{north}") == ["p"]
    right = ids_of(client, f"{LANDMARKS}/items", bbox=f"{middle},{south},{east},{north}", limit=7)
    assert right == [f"q:t/{i}" for i in range(60)]
    assert len(ids_of(client, f"{LANDMARKS}/items", bbox="-180,-90,180,90")) == 120
    assert ids_of(client, f"{LANDMARKS}/items", bbox="170,-90,-170,90") == []
    assert ids_of(client, f"{SUBMAPS}/items", datetime="2026-05-01T00:00:00Z/..") == ["q"]
    [one] = next(followed(client, f"{LANDMARKS}/items", limit=1))["features"]
    x, y = one["geometry"]["coordinates"]
    tight = ids_of(client, f"{LANDMARKS}/items", bbox=f"{x - 1e-6},{y - 1e-6},0,{x + 1e-6},{y + 1e-6},9")
    assert tight == [one["id"]]
    monkeypatch.setattr(items, "_MOST", 1)
    assert ids_of(client, f"{SUBMAPS}/items") == ["p", "q"]


def test_a_frame_without_a_system_has_no_geometry(client: httpx.Client) -> None:
    put_trees(client)
    client.put(f"{PLOTS}/submaps/lost", json={"xy": points(TREES)}).raise_for_status()
    about = client.get(LANDMARKS).json()
    assert "extent" not in about
    assert "'map' have no geometry" in about["description"]
    pages = list(followed(client, f"{LANDMARKS}/items", limit=100))
    features = [one for page in pages for one in page["features"]]
    assert len(features) == 120
    assert {one["geometry"] for one in features} == {None}
    assert "'map' has no crs" in features[0]["properties"]["no_geometry"]
    assert features[-1]["properties"]["no_geometry"] == "it has no map_pose"
    assert features[0]["properties"]["x_submap"] == TREES[0, 0]
    assert ids_of(client, f"{LANDMARKS}/items", bbox="-180,-90,180,90") == []


@pytest.mark.parametrize(
    "query",
    ["limit=0", "limit=x", "bbox=1,2,3", "bbox=0,50,1,40", "bbox=0,0,200,1", "bbox=nan,0,1,1", "cursor=x", "any=1",
     "limit=1&limit=2", "datetime=yesterday"],
)  # fmt: skip
def test_bad_parameters_are_400(shared_client: httpx.Client, query: str) -> None:
    refusal = shared_client.get(f"{LANDMARKS}/items?{query}")
    assert (refusal.status_code, refusal.json()["type"]) == (400, "/problems/invalid-parameter")
    assert query.split("=")[0] in refusal.json()["detail"]


def test_what_is_not_there(shared_client: httpx.Client) -> None:
    for path in ("/ogc/collections/none:landmarks", "/ogc/collections/none:landmarks/items", "/ogc/collections/plots"):
        assert shared_client.get(path).status_code == 404, path
    assert shared_client.get(f"{LANDMARKS}/items", headers={"Accept": "text/html"}).status_code == 406
    # More than the largest page is no error.
    assert shared_client.get(f"{LANDMARKS}/items", params={"limit": 10**9}).status_code == 200


def test_a_key_sees_its_collections_only(client: httpx.Client, app: FastAPI) -> None:
    client.put("/v1/collections/theirs", json={}).raise_for_status()
    ring = app.state.service.database
    secret, _ = api_keys.make(ring, "mine", [Scope.READ], ["plots"])
    app.state.authenticator = Authenticator(app.state.service.settings, ring)
    for path in ("/ogc", "/ogc/conformance", "/ogc/collections", LANDMARKS):
        assert client.get(path).status_code == 401
    client.headers["Authorization"] = f"Bearer {secret}"
    assert client.get("/ogc").status_code == client.get("/ogc/conformance").status_code == 200
    listed = client.get("/ogc/collections").json()["collections"]
    assert [one["id"] for one in listed] == ["plots:landmarks", "plots:submaps"]
    for path in ("", "/items", "/items/p:t"):
        assert client.get(f"/ogc/collections/theirs:landmarks{path}").status_code == 404


def test_boxes() -> None:
    outline = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    assert DegreeBox(0.9, 0.9, 5.0, 5.0).touches(outline)
    assert not DegreeBox(1.1, 1.1, 5.0, 5.0).touches(outline)
    assert DegreeBox(-1.0, -1.0, 3.0, 3.0).touches(outline)
    around = read_box("179,-1,-179,1")
    assert around is not None
    inside = around.contains(np.array([[179.5, 0.0], [-179.5, 0.0], [0.0, 0.0], [np.nan, 0.0], [179.5, 2.0]]))
    assert inside.tolist() == [True, True, False, False, False]


# ----------------------------------------------------------------- with GDAL


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Threaded]:
    """A service with two placed submaps, on a real socket."""
    with starting(tmp_path_factory.mktemp("gdal")) as start:
        running = start()
        placed(running.client)
        yield running


READ = """
import json, sys
import numpy as np, pyogrio
from pyogrio import raw
address = sys.argv[1]
meta, _, shapes, values = raw.read(address, layer="plots:landmarks")
x = [float(np.frombuffer(one[5:13], "<f8")[0]) for one in shapes]
found = dict(zip(meta["fields"].tolist(), values))
right = raw.read(address, layer="plots:landmarks", bbox=(sum(x) / len(x), 48.0, 9.0, 49.0))[2]
outlines = raw.read(address, layer="plots:submaps")[2]
layers = sorted(pyogrio.list_layers(address)[:, 0].tolist())
print(json.dumps([layers, meta["geometry_type"], x, found["dbh_cm"].tolist(), len(right), len(outlines)]))
"""
"""GDAL waits for answers without letting other threads of its process run, so it has a process of its own."""


def output_of(*command: object) -> str:
    """What a program prints that ends well."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.skipif("OAPIF" not in pyogrio.list_drivers(), reason="the installed GDAL has no driver for OGC API")
def test_gdal_opens_the_service_by_its_address(server: Threaded) -> None:
    told = json.loads(output_of(sys.executable, "-c", READ, f"OAPIF:{server.url}/ogc"))
    layers, shape, x, diameters, right, outlines = told
    assert (layers, shape) == (["plots:landmarks", "plots:submaps"], "Point")
    assert 8.28 < min(x) < max(x) < 8.32
    assert sorted(diameters) == sorted([10.0 + i for i in range(60)] * 2)
    assert (right, outlines) == (60, 2)


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="ogrinfo is not installed (Debian: gdal-bin)")
def test_ogrinfo_lists_a_served_collection(server: Threaded, tmp_path: Path) -> None:
    listed = output_of("ogrinfo", "-so", "-al", f"OAPIF:{server.url}/ogc")
    layers = re.findall(r"Layer name: (\S+)\n(?:.*\n)*?Geometry: (\w+)\nFeature Count: (\d+)\n", listed)
    assert sorted(layers) == [("plots:landmarks", "Point", "120"), ("plots:submaps", "Polygon", "2")]
    out = tmp_path / "out.geojson"
    output_of("ogr2ogr", "-f", "GeoJSON", out, f"OAPIF:{server.url}/ogc", "plots:landmarks")
    assert len(json.loads(out.read_bytes())["features"]) == 120
