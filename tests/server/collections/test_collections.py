"""Collections: made once, read, changed, dropped."""

import httpx
import pytest

from tests.server.factories import put_submap


def test_put_makes_and_then_finds(client: httpx.Client) -> None:
    body = {"title": "North", "crs": "EPSG:32633", "origin": [412000.0, 5820000.0], "config": {}}
    made = client.put("/v1/collections/north", json=body)
    assert made.status_code == 201
    assert made.headers["Location"] == "/v1/collections/north"
    again = client.put("/v1/collections/north", json=body)
    assert again.status_code == 200
    assert again.json() == made.json()
    assert client.put("/v1/collections/north", json={}).status_code == 200
    assert made.json()["counts"] == {"submaps": 0, "landmarks": 0, "polygons": 0}
    assert made.json()["extent"] == {"spatial": [], "temporal": None}


@pytest.mark.parametrize(
    "other", [{"config": {"gate": 20.0}}, {"title": "B"}, {"crs": "EPSG:25833"}, {"origin": [1, 2]}]
)
def test_put_with_something_else_is_a_conflict(client: httpx.Client, other: dict[str, object]) -> None:
    client.put("/v1/collections/a", json={"title": "A", "crs": "EPSG:32633", "origin": [0, 0]})
    response = client.put("/v1/collections/a", json=other)
    assert response.status_code == 409
    assert response.json()["type"] == "/problems/conflict"


def test_configuration_is_kept_whole_and_checked(client: httpx.Client) -> None:
    made = client.put("/v1/collections/own", json={"config": {"gate": 12.5}}).json()
    assert made["config"]["gate"] == 12.5
    assert len(made["config"]) > 5
    refused = client.put("/v1/collections/bad", json={"config": {"gates": 1}})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["pointer"] == "/config/gates"
    assert "gates" in refused.json()["detail"]
    for config in ({"gate": -1}, {"squared": 1}, {"samples": 1.5}):
        wrong = client.put("/v1/collections/bad", json={"config": config}).json()["errors"][0]
        assert wrong["pointer"] == f"/config/{next(iter(config))}"
    assert client.get("/v1/collections/bad").status_code == 404


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:999999", "no such thing", "EPSG:2225"])
def test_a_crs_must_be_projected_in_metres(shared_client: httpx.Client, crs: str) -> None:
    response = shared_client.put("/v1/collections/c", json={"crs": crs})
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == "/crs"


def test_patch_changes_what_is_given(client: httpx.Client) -> None:
    before = client.get("/v1/collections/plots")
    changed = client.patch("/v1/collections/plots", json={"title": "T", "crs": "EPSG:32633", "origin": [1, 2]})
    assert changed.status_code == 200
    assert (changed.json()["title"], changed.json()["origin"]) == ("T", [1.0, 2.0])
    assert changed.headers["ETag"] != before.headers["ETag"]
    assert changed.json()["revision"] == before.json()["revision"] + 1
    cleared = client.patch("/v1/collections/plots", json={"title": None}).json()
    assert (cleared["title"], cleared["crs"]) == (None, "EPSG:32633")
    same = client.patch("/v1/collections/plots", json={"title": None})
    assert same.json()["revision"] == cleared["revision"]
    assert client.patch("/v1/collections/plots", json={"config": {"gate": 50.0}}).status_code == 409
    assert client.patch("/v1/collections/plots", json={"config": {}}).status_code == 200
    assert client.patch("/v1/collections/plots", json={"crs": "EPSG:4326"}).status_code == 422


def test_preconditions_and_conditional_get(client: httpx.Client) -> None:
    etag = client.get("/v1/collections/plots").headers["ETag"]
    assert client.get("/v1/collections/plots", headers={"If-None-Match": etag}).status_code == 304
    stale = client.patch("/v1/collections/plots", json={"title": "x"}, headers={"If-Match": '"0-0"'})
    assert stale.status_code == 412
    assert stale.headers["ETag"] == etag
    assert client.delete("/v1/collections/plots", headers={"If-Match": '"0-0"'}).status_code == 412
    assert client.patch("/v1/collections/plots", json={"title": "x"}, headers={"If-Match": etag}).status_code == 200


def test_delete_drops_everything(client: httpx.Client) -> None:
    put_submap(client, "plots", "p1", 1).raise_for_status()
    assert client.delete("/v1/collections/plots").status_code == 204
    assert client.get("/v1/collections/plots").status_code == 404
    assert client.delete("/v1/collections/plots").status_code == 404
    assert client.get("/v1/collections/plots/submaps/p1").status_code == 404
    client.put("/v1/collections/plots", json={}).raise_for_status()
    assert client.get("/v1/collections/plots").json()["counts"]["submaps"] == 0


def test_pages_of_collections(client: httpx.Client) -> None:
    for i in range(6):
        client.put(f"/v1/collections/c{i}", json={}).raise_for_status()
    seen, cursor = [], None
    while True:
        page = client.get("/v1/collections", params={"limit": 3} | ({"cursor": cursor} if cursor else {})).json()
        seen += [collection["id"] for collection in page["collections"]]
        if "next" not in page:
            break
        cursor = page["next"]
    assert seen == ["plots", *(f"c{i}" for i in range(6))]
    for parameters in ({"limit": 0}, {"limit": 51}, {"limit": "x"}, {"cursor": "?"}, {"cursor": "WzEsMl0"}):
        assert client.get("/v1/collections", params=parameters).status_code == 422


@pytest.mark.parametrize("name", ["a", "Übersee-3", "森", "a.b_c~d-e", "x" * 128])
def test_ids_that_are_possible(client: httpx.Client, name: str) -> None:
    made = client.put(f"/v1/collections/{name}", json={})
    assert made.status_code == 201
    assert client.get(made.headers["Location"]).json()["id"] == name


@pytest.mark.parametrize("name", ["a b", "a%00", "x" * 129, "a:b", "U\u0308bersee", "a%2Bb", "%ff", "😀"])
def test_ids_that_are_not(shared_client: httpx.Client, name: str) -> None:
    response = shared_client.put(f"/v1/collections/{name}", json={})
    assert response.status_code == 422
    assert response.json()["errors"][0]["parameter"] == "collection"


def test_counts_and_extent(client: httpx.Client) -> None:
    pose = {"frame_id": "north", "x": 100.0, "y": 0.0, "yaw": 0.0}
    put_submap(client, "plots", "a", 1, map_pose=pose, stamp="2026-05-04T09:30:00+02:00").raise_for_status()
    put_submap(client, "plots", "b", 2, stamp="2026-05-05T00:00:00Z").raise_for_status()
    collection = client.get("/v1/collections/plots").json()
    assert collection["counts"]["submaps"] == 2
    assert collection["counts"]["landmarks"] == 120
    assert collection["counts"]["polygons"] > 0
    assert collection["revision"] == 2
    (extent,) = collection["extent"]["spatial"]
    assert extent["frame_id"] == "north"
    assert 60 <= extent["bbox"][0] < extent["bbox"][2] <= 140
    assert collection["extent"]["temporal"] == ["2026-05-04T07:30:00Z", "2026-05-05T00:00:00Z"]
