"""Submaps that change: landmarks alone, what a PUT clears, and answers that are those of the caller's own write."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import numpy as np
import pytest

from tests.server.factories import forest, observed, points, put_submap

COLLECTION = "/v1/collections/plots"
SUBMAPS = f"{COLLECTION}/submaps"
REST: dict[str, Any] = {
    "frame_id": "plot",
    "stamp": "2026-05-04T09:30:00Z",
    "session": "monday",
    "map_pose": {"frame_id": "map", "x": 100.0, "y": 50.0, "yaw": 0.5, "covariance": None},
    "properties": {"observer": "robot-2"},
}


def rest_of(submap: dict[str, Any]) -> dict[str, Any]:
    rest = {name: submap[name] for name in REST}
    if rest["map_pose"] is not None:  # the answer says what frame the covariance is in, too
        rest["map_pose"] = {name: rest["map_pose"][name] for name in REST["map_pose"]}
    return rest


def test_landmarks_alone_are_updated_and_the_rest_stays(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, **REST).raise_for_status()
    before = client.get(f"{SUBMAPS}/p").json()
    grown = np.vstack([forest(1), [[60.0, 60.0]]])
    answer = client.patch(f"{SUBMAPS}/p", json={"xy": points(grown)}, headers={"If-Match": f'"{before["etag"]}"'})
    assert answer.status_code == 200
    after = answer.json()
    assert rest_of(after) == rest_of(before) == REST
    assert [(one["x"], one["y"]) for one in after["landmarks"]] == [tuple(one) for one in points(grown)]
    assert (after["counts"]["landmarks"], after["revision"]) == (61, before["revision"] + 1)
    assert answer.headers["ETag"].removeprefix("W/") == f'"{after["etag"]}"' != f'"{before["etag"]}"'
    stored = client.get(f"{SUBMAPS}/p")
    assert stored.json() == after
    # As if all of it had been PUT.
    same = client.put(f"{SUBMAPS}/p", json={"xy": points(grown), **REST})
    assert (same.json()["outcome"], same.json()["etag"]) == ("unchanged", after["etag"])
    assert client.get(COLLECTION).json()["counts"]["landmarks"] == 61
    # The footprint in the map grew with it.
    for box, found in (("120,128,130,140", ["p"]), ("300,300,310,310", [])):
        listed = client.get(SUBMAPS, params={"bbox": box, "frame_id": "map"}).json()["submaps"]
        assert [one["id"] for one in listed] == found


def test_the_new_landmarks_are_found_and_the_old_ones_are_not(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    put_submap(client, "plots", "other", 7).raise_for_status()
    assert client.patch(f"{SUBMAPS}/p", json={"xy": points(forest(2))}).status_code == 200
    for seed, found in ((1, []), (2, ["p"])):
        answer = client.post(f"{COLLECTION}/queries", json={"xy": observed(forest(seed), 4)[0]}).json()
        matched = [one["submap_id"] for one in answer["candidates"]] if answer["verdict"] == "matched" else []
        assert matched == found


def test_ids_and_diameters_come_with_the_landmarks(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, ids=[f"t{i}" for i in range(60)], session="monday").raise_for_status()
    trees = [{"id": f"n{i}", "x": x, "y": y, "dbh_cm": 30.0 + i / 10} for i, (x, y) in enumerate(points(forest(1)))]
    after = client.patch(f"{SUBMAPS}/p", json={"landmarks": trees}).json()
    assert [(one["id"], one["dbh_cm"]) for one in after["landmarks"]] == [(one["id"], one["dbh_cm"]) for one in trees]
    assert after["session"] == "monday"
    moved = client.patch(f"{SUBMAPS}/p", json={"session": None, "map_pose": REST["map_pose"]}).json()
    assert (moved["session"], moved["map_pose"]["x"]) == (None, 100.0)
    assert moved["landmarks"] == after["landmarks"]


@pytest.mark.parametrize("name", ["session", "stamp", "frame_id", "map_pose", "properties"])
def test_null_clears_a_member_and_only_that(client: httpx.Client, name: str) -> None:
    put_submap(client, "plots", "p", 1, **REST).raise_for_status()
    assert rest_of(client.patch(f"{SUBMAPS}/p", json={name: None}).json()) == REST | {name: None}
    assert rest_of(client.patch(f"{SUBMAPS}/p", json={name: REST[name]}).json()) == REST


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({"xy": None}, 422),
        ({"landmarks": None}, 422),
        ({"ids": ["a"]}, 422),
        ({"xy": [[0, 0], [1, 1]]}, 422),
        ({"xy": [[0, 0], [1, 1], [2, 2]]}, 422),
        ({"xy": [[0, 0], [1, 1], [2, 0]], "landmarks": []}, 422),
    ],
)
def test_landmarks_that_cannot_be(client: httpx.Client, sent: dict[str, Any], status: int) -> None:
    put_submap(client, "plots", "p", 1, **REST).raise_for_status()
    before = client.get(f"{SUBMAPS}/p").json()
    refused = client.patch(f"{SUBMAPS}/p", json=sent)
    assert (refused.status_code, bool(refused.json()["errors"])) == (status, True)
    assert client.get(f"{SUBMAPS}/p").json() == before
    stale = client.patch(f"{SUBMAPS}/p", json={"xy": points(forest(2))}, headers={"If-Match": '"old"'})
    assert stale.status_code == 412
    assert client.get(f"{SUBMAPS}/p").json() == before


def test_a_put_tells_what_it_cleared(client: httpx.Client) -> None:
    trees = [{"id": f"t{i}", "x": x, "y": y, "dbh_cm": 30.0, "species": "oak"} for i, (x, y) in enumerate(forest(1))]
    made = client.put(f"{SUBMAPS}/p", json={"landmarks": trees, **REST}).json()
    assert (made["outcome"], made["cleared"]) == ("created", [])
    fewer = client.put(f"{SUBMAPS}/p", json={"landmarks": trees, **REST, "session": None}).json()
    assert (fewer["outcome"], fewer["cleared"]) == ("replaced", ["session"])
    bare = client.put(f"{SUBMAPS}/p", json={"xy": points(forest(1))}).json()
    assert bare["cleared"] == ["frame_id", "stamp", "map_pose", "properties", "ids", "dbh_cm", "species"]
    assert client.put(f"{SUBMAPS}/p", json={"xy": points(forest(2)), **REST}).json()["cleared"] == []


@pytest.mark.parametrize("what", ["submap", "collection"])
def test_a_patch_answers_with_its_own_state(client: httpx.Client, what: str) -> None:
    """Whoever else writes. Where a service reads after it wrote, some are told of another's value."""
    put_submap(client, "plots", "p", 1).raise_for_status()

    def change(number: int) -> bool:
        if what == "collection":
            answer = client.patch(COLLECTION, json={"title": str(number)})
            return bool(answer.json()["title"] == str(number))
        answer = client.patch(f"{SUBMAPS}/p", json={"properties": {"n": number}})
        tag = answer.headers["ETag"].removeprefix("W/")
        return bool(answer.json()["properties"] == {"n": number} and tag == f'"{answer.json()["etag"]}"')

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(change, range(100)))


# -------------------------------------------------- asked, and not stored


@pytest.mark.parametrize(
    ("xy", "reason"),
    [
        ([], "too_few_landmarks"),
        ([[0, 0], [1, 2]], "too_few_landmarks"),
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "collinear_landmarks"),
    ],
)
@pytest.mark.parametrize("method", ["PUT", "POST"])
def test_in_a_clearing_the_question_has_an_answer(
    client: httpx.Client, method: str, xy: list[list[float]], reason: str
) -> None:
    url = SUBMAPS if method == "POST" else f"{SUBMAPS}/q"
    for headers in ({}, {"Idempotency-Key": "k"}, {"Idempotency-Key": "k"}):
        answer = client.request(method, url, json={"xy": xy, "query": {}}, headers=headers)
        receipt = answer.json()
        assert (answer.status_code, receipt["outcome"], receipt["reason"]) == (200, "not_stored", reason)
        assert (receipt["query"]["verdict"], receipt["query"]["reason"]) == ("no_match", reason)
        assert (receipt["etag"], receipt["id"]) == (None, None if method == "POST" else "q")
        assert receipt["detail"]
        assert "Location" not in answer.headers
    assert client.get(SUBMAPS).json()["submaps"] == []
    assert client.request(method, url, json={"xy": xy}).status_code == 422
    faulty = client.request(method, url, json={"xy": [[0, 0], [1, 2], [1, 2], [3, 1]], "query": {}})
    assert faulty.status_code == 422  # the same tree twice is a fault of the caller's


def test_what_is_stored_stays_where_the_next_view_is_empty(client: httpx.Client) -> None:
    etag = put_submap(client, "plots", "p", 1, **REST).json()["etag"]
    answer = client.put(f"{SUBMAPS}/p", json={"xy": [[0, 0]], "query": {}})
    assert (answer.json()["outcome"], answer.json()["etag"]) == ("not_stored", etag)
    assert answer.headers["ETag"].removeprefix("W/") == f'"{etag}"'
    assert client.get(f"{SUBMAPS}/p").json()["session"] == "monday"
    conditional = client.put(f"{SUBMAPS}/p", json={"xy": [[0, 0]], "query": {}}, headers={"If-None-Match": "*"})
    assert conditional.status_code == 412
