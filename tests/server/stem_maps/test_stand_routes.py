"""`/v1/collections/{collection}/stands`: listed, read and deleted over HTTP."""

from typing import Any

import numpy as np
import pytest

from server.checks.database import discrepancies
from tests.server.factories import Client, points
from tests.server.stem_maps.test_stands import as_map, put_stand, stand_trees
from urquhart import SE2

STANDS = "/v1/collections/c/stands"
HERE = SE2(35.0, 15.0, 0.4)


@pytest.fixture
def stands(service: Any, client: Client) -> Client:
    """A client of a service with the collection `c`, in which the stands b, a and c are stored, in this order."""
    client.put("/v1/collections/c", json={}).raise_for_status()
    put_stand(service.database, as_map(stand_trees(), "b"))
    for name, count in (("a", 100), ("c", 60)):
        other = np.random.default_rng(count).uniform(0.0, (64.0, 52.0), (count, 2))
        put_stand(service.database, as_map(other, name))
    return client


def near() -> list[list[float]]:
    """What is seen from `HERE` of all 140 trees."""
    trees = stand_trees()
    return points(HERE.inverse().apply(trees[((trees - (HERE.x, HERE.y)) ** 2).sum(axis=1) < 144.0]))


def test_they_are_listed_in_pages_as_they_were_stored(stands: Client) -> None:
    first = stands.get(STANDS, params={"limit": 2}).json()
    assert [one["name"] for one in first["stands"]] == ["b", "a"]
    last = stands.get(STANDS, params={"cursor": first["next"]}).json()
    assert ([one["name"] for one in last["stands"]], "next" in last) == (["c"], False)
    assert stands.get(STANDS, params={"limit": 2}).headers["Link"].endswith('rel="next"')
    counts = [one["submaps"] for one in stands.get(STANDS).json()["stands"]]
    assert sum(counts) == stands.get("/v1/collections/c").json()["counts"]["submaps"]
    collection = stands.get("/v1/collections/c").json()
    assert collection["stands"] == {"stands": 3, "trees": 300}
    assert collection["counts"]["landmarks"] > 300  # circles overlap
    cursor = stands.get("/v1/collections/c/submaps", params={"limit": 1}).json()["next"]
    assert stands.get(STANDS, params={"cursor": cursor}).status_code == 422


def test_a_stand_says_where_its_frame_is_and_its_tag_follows_what_it_says(stands: Client) -> None:
    answer = stands.get(f"{STANDS}/a")
    assert (answer.json()["trees"], answer.json()["frame_id"], answer.json()["crs"]) == (100, "a", None)
    tag = answer.headers["ETag"]
    assert tag == f'"{answer.json()["etag"]}"'
    assert stands.get(f"{STANDS}/a", headers={"If-None-Match": tag}).status_code == 304
    frames = {"a": {"crs": "EPSG:32633", "origin": [415200.0, 5821500.0]}}
    stands.patch("/v1/collections/c", json={"frames": frames}).raise_for_status()
    listed = {one["id"]: one for one in stands.get("/v1/collections").json()["collections"]}
    assert listed["c"]["systems"] == ["EPSG:32633"]
    moved = stands.get(f"{STANDS}/a", headers={"If-None-Match": tag})
    assert (moved.json()["crs"], moved.json()["origin"]) == ("EPSG:32633", [415200.0, 5821500.0])
    taken = stands.get("/v1/collections/c/submaps", params={"frame_id": "a"}).json()["submaps"][0]["id"]
    stands.put(f"/v1/collections/c/submaps/{taken}", json={"xy": near()}).raise_for_status()
    fewer = stands.get(f"{STANDS}/a", headers={"If-None-Match": moved.headers["ETag"]})
    assert fewer.json()["submaps"] == answer.json()["submaps"] - 1


def test_what_is_deleted_is_found_no_more_and_only_that(service: Any, stands: Client) -> None:
    query = {"xy": near()}
    assert stands.post("/v1/collections/c/queries", json=query).json()["verdict"] == "matched"
    before = stands.get("/v1/collections/c").json()["counts"]["submaps"]
    gone = stands.get(f"{STANDS}/b").json()["submaps"]
    answer = stands.delete(f"{STANDS}/b")
    assert (answer.status_code, answer.content) == (204, b"")
    assert stands.post("/v1/collections/c/queries", json=query).json()["verdict"] != "matched"
    assert stands.get("/v1/collections/c").json()["counts"]["submaps"] == before - gone
    assert [one["name"] for one in stands.get(STANDS).json()["stands"]] == ["a", "c"]
    assert list(discrepancies(service.database)) == []
    again = stands.delete(f"{STANDS}/b")
    assert (again.status_code, again.json()["detail"]) == (404, "There is no stand 'b' here.")


def test_a_repeated_deletion_does_not_delete_what_was_stored_since(service: Any, stands: Client) -> None:
    key = {"Idempotency-Key": "k1"}
    assert stands.delete(f"{STANDS}/b", headers=key).status_code == 204
    put_stand(service.database, as_map(stand_trees(), "b"))
    again = stands.delete(f"{STANDS}/b", headers=key)
    assert (again.status_code, again.headers["Idempotency-Replayed"]) == (204, "true")
    assert stands.get(f"{STANDS}/b").status_code == 200


def test_a_stand_that_was_replaced_meanwhile_stays(service: Any, stands: Client) -> None:
    tag = stands.get(f"{STANDS}/b").headers["ETag"]
    put_stand(service.database, as_map(stand_trees(), "b"))
    assert stands.delete(f"{STANDS}/b", headers={"If-Match": tag}).status_code == 412
    assert stands.delete(f"{STANDS}/b", headers={"If-Match": stands.get(f"{STANDS}/b").headers["ETag"]}).is_success


def test_what_is_not_there_is_404(stands: Client) -> None:
    for path in (f"{STANDS}/z", "/v1/collections/z/stands", "/v1/collections/z/stands/a"):
        assert stands.get(path).status_code == 404
    assert stands.delete("/v1/collections/z/stands/a").status_code == 404
