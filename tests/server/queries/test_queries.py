"""Queries: the verdict and its evidence; stored answers and drawings."""

from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI
from sqlalchemy import update

from server.app import create_app
from server.config.settings import Limits, Settings
from server.schemas.constraints import ConstraintsInput
from server.schemas.queries import Exclude, QueryInput
from server.store.tables import SubmapRow
from tests.server.factories import TestClient, forest, observed, points, put_submap
from tests.server.served import together
from urquhart import SE2

PLOTS = "/v1/collections/plots"
QUERIES = f"{PLOTS}/queries"


def ask(client: httpx.Client, **body: Any) -> dict[str, Any]:
    """The answer to a query that must be answered."""
    response = client.post(QUERIES, json=body)
    assert response.status_code == 200, response.text
    answer: dict[str, Any] = response.json()
    return answer


def test_the_right_one_of_several(client: httpx.Client) -> None:
    for i in range(5):
        put_submap(client, "plots", f"p{i}", i, session=f"s{i}", frame_id=f"f{i}").raise_for_status()
    seen, _ = observed(forest(3), 1)
    answer = ask(client, xy=seen, frame_id="base_link", stamp="2026-05-04T09:30:00Z", seed=1)
    assert (answer["verdict"], answer["frame_id"], answer["stamp"]) == ("matched", "base_link", "2026-05-04T09:30:00Z")
    assert (answer["id"], answer["landmark_count"], answer["revision"]) == (None, 60, 5)
    best = answer["candidates"][0]
    assert (best["submap_id"], best["session"], best["frame_id"], best["rank"]) == ("p3", "s3", "f3", 1)
    assert best["refused"] is None
    assert best["map_pose"] is None
    assert best["links"] == {"submap": f"{PLOTS}/submaps/p3", "match": None}
    assert {stage["name"] for stage in answer["stages"]}
    assert all(stage["milliseconds"] >= 0 for stage in answer["stages"])


def test_landmark_ids_of_both_sides(client: httpx.Client) -> None:
    trees = forest(1)
    landmarks = [{"id": f"tree-{i}", "x": x, "y": y} for i, (x, y) in enumerate(points(trees))]
    client.put(f"{PLOTS}/submaps/p", json={"landmarks": landmarks}).raise_for_status()
    answer = ask(client, xy=points(trees), ids=[f"seen-{i}" for i in range(60)])
    pairs = {(pair["query"], pair["submap"]) for pair in answer["candidates"][0]["inliers"]}
    assert len(pairs) > 50
    assert pairs <= {(f"seen-{i}", f"tree-{i}") for i in range(60)}


def test_pose_in_the_map(client: httpx.Client) -> None:
    covariance = [0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.001]
    pose = {"frame_id": "site", "x": 100.0, "y": -30.0, "yaw": 0.7, "covariance": covariance}
    put_submap(client, "plots", "p", 1, map_pose=pose).raise_for_status()
    seen, submap_T_query = observed(forest(1), 2, sigma=0.01)
    candidate = ask(client, xy=seen)["candidates"][0]
    map_T_query = SE2(100.0, -30.0, 0.7) @ submap_T_query
    placed = candidate["map_pose"]
    assert placed["frame_id"] == "site"
    assert (placed["x"], placed["y"]) == pytest.approx((map_T_query.x, map_T_query.y), abs=0.05)
    assert placed["yaw"] == pytest.approx(map_T_query.yaw, abs=0.01)
    lever = submap_T_query.x**2 + submap_T_query.y**2
    composed = np.reshape(placed["covariance"], (3, 3))
    assert np.trace(composed[:2, :2]) == pytest.approx(1.0 + 0.001 * lever, rel=0.05)
    for told, frame in ((candidate["transform"], "submap"), (placed, "map")):
        assert (told["covariance_frame"], told["about"]) == (frame, "query_origin")
        middle = told["middle"]
        at = SE2(told["x"], told["y"], told["yaw"]).apply(np.array([middle["source"]]))[0]
        np.testing.assert_allclose(at, middle["target"], atol=1e-9)
        product = np.reshape(middle["covariance"], (3, 3)) @ np.reshape(middle["information"], (3, 3))
        np.testing.assert_allclose(product, np.eye(3), atol=1e-9)
    # A pose in the map can be stored as it was answered.
    put_submap(client, "plots", "q", 2, map_pose=placed).raise_for_status()
    again = client.get(f"{PLOTS}/submaps/q").json()["map_pose"]
    assert {name: again[name] for name in pose} == {name: placed[name] for name in pose}
    client.delete(f"{PLOTS}/submaps/q").raise_for_status()
    client.patch(f"{PLOTS}/submaps/p", json={"map_pose": pose | {"covariance": None}}).raise_for_status()
    unsure = ask(client, xy=seen)["candidates"][0]["map_pose"]
    assert (unsure["covariance"], unsure["middle"]) == (None, None)


def test_the_confidence_of_the_gate_is_answered_as_it_was_given(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 2)
    assert ask(client, xy=seen)["gates"]["confidence"] == pytest.approx(0.998993, abs=1e-6)
    for given in (0.9, 0.95, 0.9999, 0.51):
        assert ask(client, xy=seen, min_confidence=given)["gates"]["confidence"] == given


def test_null_is_the_same_as_leaving_a_member_out(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, map_pose={"x": 0.0, "y": 0.0, "yaw": 0.0, "frame_id": None}).raise_for_status()
    near = {"x": 0.0, "y": 0.0, "radius": 50.0}
    seen, _ = observed(forest(1), 2)
    names = set(QueryInput.model_fields) - {"xy"}
    plain, nulls = ask(client, xy=seen), ask(client, xy=seen, **dict.fromkeys(names))
    inner = ask(client, xy=seen, near=near | {"frame_id": None}, exclude=dict.fromkeys(Exclude.model_fields))
    for answer in (plain, nulls, inner):
        assert (answer["verdict"], answer["effort"], answer["method"]) == ("matched", "full", "robust")
    refused = client.post(f"{PLOTS}/queries", json={"xy": seen, "near": near | {"radius": None}})
    assert (refused.status_code, refused.json()["errors"][0]["pointer"]) == (422, "/near/radius")
    job = client.post(f"{PLOTS}/constraints", json=dict.fromkeys(ConstraintsInput.model_fields))
    assert job.status_code == 202


@pytest.mark.parametrize(
    ("sent", "pointer", "detail"),
    [
        ({"min_confidence": "x"}, "/min_confidence", "must be a number, not a string"),
        ({"min_confidence": True}, "/min_confidence", "must be a number, not a boolean"),
        ({"limit": []}, "/limit", "must be a whole number, not an array"),
        ({"limit": {}}, "/limit", "must be a whole number, not an object"),
        ({"xy": [[1, None]]}, "/xy/0/1", "must be a number, not null"),
        ({"xy": [[1, 2], [3]]}, "/xy/1", "must have 2 entries, not 1"),
        ({"xy": [[1, 2], []]}, "/xy/1", "must have 2 entries, not 0"),
        ({"xy": [[1, 2, 3]]}, "/xy/0", "must have 2 entries, not 3"),
    ],
)
def test_what_is_said_of_a_value_of_the_wrong_type(
    shared_client: httpx.Client, sent: dict[str, Any], pointer: str, detail: str
) -> None:
    answer = shared_client.post(f"{PLOTS}/queries", json={"xy": []} | sent)
    [refused] = answer.json()["errors"]
    assert (answer.status_code, refused["pointer"], refused["detail"]) == (422, pointer, detail)


def test_a_number_that_is_not_finite_is_not_taken_for_a_landmark(shared_client: httpx.Client) -> None:
    answer = shared_client.post(
        f"{PLOTS}/queries", content=b'{"xy": [], "min_confidence": NaN}', headers={"Content-Type": "application/json"}
    )
    assert answer.json()["detail"].endswith("leave out the member, or the landmark, that has no value.")


@pytest.mark.parametrize("sigma_yaw", [1e-3, 0.05, 3.0])
def test_a_pose_in_an_answer_can_be_posted_however_far_its_origin_is(client: httpx.Client, sigma_yaw: float) -> None:
    """From an origin 5,400 km away a turn of a thousandth already moves the position by kilometres."""
    seen, _ = observed(forest(1), 2)
    pose = {"x": 448_100.0, "y": 5_411_000.0, "yaw": 0.5, "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, sigma_yaw**2]}
    client.put(f"{PLOTS}/submaps/p", json={"xy": seen, "map_pose": pose}).raise_for_status()
    full = points(forest(1) + [448_100.0, 5_411_000.0])
    answer = client.post(f"{PLOTS}/queries", json={"xy": full, "pairs": False}).json()
    assert answer["verdict"] == "matched"
    told = answer["candidates"][0]["map_pose"]
    assert max(told["covariance"]) > 1e7
    stored = client.put(f"{PLOTS}/submaps/q", json={"xy": full, "map_pose": told})
    assert stored.status_code == 201, stored.text
    kept = client.get(f"{PLOTS}/submaps/q").json()["map_pose"]
    assert kept["covariance"] == told["covariance"]
    lopsided = told["covariance"][:2] + [2.0 * told["covariance"][2]] + told["covariance"][3:]
    refused = client.put(f"{PLOTS}/submaps/q", json={"xy": full, "map_pose": told | {"covariance": lopsided}})
    assert refused.status_code == 422
    assert "is not symmetric" in refused.text
    impossible = list(told["covariance"])
    impossible[1] = impossible[3] = 2.0 * (impossible[0] * impossible[4]) ** 0.5
    refused = client.put(f"{PLOTS}/submaps/q", json={"xy": full, "map_pose": told | {"covariance": impossible}})
    assert refused.status_code == 422
    assert "positive semidefinite" in refused.text


def test_what_older_versions_took_for_a_covariance_gives_none_with_negative_eigenvalues(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, map_pose={"x": 1.0, "y": 2.0, "yaw": 0.5}).raise_for_status()
    with client.app.state.service.database.write_connection() as connection:  # type: ignore[attr-defined]
        connection.execute(update(SubmapRow).values(map_yaw=90.0, map_covariance=[1, 5, 0, 5, 1, 0, 0, 0, 1]))
    seen, _ = observed(forest(1), 2, sigma=0.01)
    placed = ask(client, xy=seen)["candidates"][0]["map_pose"]
    for values in (placed["covariance"], placed["middle"]["covariance"]):
        assert np.linalg.eigvalsh(np.reshape(values, (3, 3)))[0] >= 0.0
    kept = client.get(f"{PLOTS}/submaps/p").json()["map_pose"]
    assert (kept["yaw"], kept["covariance"]) == (90.0, [1, 5, 0, 5, 1, 0, 0, 0, 1])


def test_exclusions_leave_out_what_all_of_them_hold_for(client: httpx.Client) -> None:
    """Not my own last minute, but everybody else now."""
    now = "2026-05-04T10:00:00Z"
    for name, session, stamp in (("old", "me", "09:00:00"), ("mine", "me", "09:59:30"), ("yours", "you", "09:59:50")):
        put_submap(client, "plots", name, 1, session=session, stamp=f"2026-05-04T{stamp}Z").raise_for_status()
    seen, _ = observed(forest(1), 2)

    def found(**exclude: Any) -> set[str]:
        answer = ask(client, xy=seen, stamp=now, exclude=exclude)
        return {one["submap_id"] for one in answer["candidates"]}

    assert found(session="me", within_seconds=60) == {"old", "yours"}
    assert found(session="me") == {"yours"}
    assert found(within_seconds=60) == {"old"}
    assert found(session="me", within_seconds=60, submap_ids=["old"]) == {"yours"}


@pytest.mark.parametrize(
    ("xy", "reason"),
    [
        ([], "too_few_landmarks"),
        ([[1, 2]], "too_few_landmarks"),
        ([[1, 2], [3, 4]], "too_few_landmarks"),
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "collinear_landmarks"),
    ],
)
def test_too_little_to_see_is_an_answer(client: httpx.Client, xy: list[list[float]], reason: str) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    answer = ask(client, xy=xy)
    assert (answer["verdict"], answer["reason"], answer["candidates"]) == ("no_match", reason, [])


def test_an_empty_collection_and_a_foreign_forest(client: httpx.Client) -> None:
    assert ask(client, xy=points(forest(9)))["reason"] == "empty_collection"
    put_submap(client, "plots", "p", 1).raise_for_status()
    assert ask(client, xy=points(forest(9)))["verdict"] == "no_match"


def test_by_submap_id_it_never_finds_itself(client: httpx.Client) -> None:
    trees = forest(1)
    put_submap(client, "plots", "first", 1, frame_id="f", stamp="2026-05-04T09:30:00Z").raise_for_status()
    alone = ask(client, submap_id="first")
    assert (alone["verdict"], alone["candidates"]) == ("no_match", [])
    assert (alone["frame_id"], alone["stamp"]) == ("f", "2026-05-04T09:30:00Z")
    seen, _ = observed(trees, 2)
    client.put(f"{PLOTS}/submaps/second", json={"xy": seen}).raise_for_status()
    again = ask(client, submap_id="first")
    assert (again["verdict"], again["candidates"][0]["submap_id"]) == ("matched", "second")
    assert ask(client, submap_id="first", exclude={"submap_ids": ["second", "unknown"]})["candidates"] == []
    assert client.post(QUERIES, json={"submap_id": "nope"}).status_code == 404


def test_limit_exclude_and_seed(client: httpx.Client) -> None:
    for i in range(4):
        client.put(f"{PLOTS}/submaps/p{i}", json={"xy": observed(forest(1), i)[0]}).raise_for_status()
    seen = points(forest(1))
    assert len(ask(client, xy=seen, limit=2)["candidates"]) == 2
    found = {c["submap_id"] for c in ask(client, xy=seen, exclude={"submap_ids": ["p0", "p1"]})["candidates"]}
    assert found == {"p2", "p3"}
    one, two = (ask(client, xy=seen, seed=5, method="paper")["candidates"] for _ in range(2))
    assert one == two


def test_a_query_that_is_kept_is_kept_once_for_its_key(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, stamp="2026-05-04T09:30:00.25Z").raise_for_status()
    body = {"xy": points(forest(1)), "store": True, "frame_id": "robot"}
    key = {"Idempotency-Key": "robot-2/17"}
    first = client.post(QUERIES, json=body, headers=key)
    put_submap(client, "plots", "q", 2).raise_for_status()
    again = client.post(QUERIES, json=body, headers=key)
    assert (again.status_code, again.content) == (first.status_code, first.content)
    assert again.headers["Location"] == first.headers["Location"]
    assert "Idempotency-Replayed" not in first.headers
    assert again.headers["Idempotency-Replayed"] == "true"
    assert client.post(QUERIES, json=body).json()["id"] == "2"
    other = client.post(QUERIES, json=body | {"limit": 2}, headers=key)
    assert (other.status_code, other.json()["type"]) == (422, "/problems/idempotency-key-reused")
    explained = client.post(QUERIES, json=body | {"explain": True}, headers={"Idempotency-Key": "b"}).json()
    assert client.post(QUERIES, json=body | {"explain": True}, headers={"Idempotency-Key": "b"}).json() == explained
    assert explained["findings"]
    # One that is not kept does nothing that could be done twice: it is asked again.
    plain = {"xy": body["xy"]}
    assert client.post(QUERIES, json=plain, headers=key).json()["revision"] == 2
    assert "Idempotency-Replayed" not in client.post(QUERIES, json=plain, headers=key).headers
    answers = together(8, lambda _: client.post(QUERIES, json=body, headers={"Idempotency-Key": "c"}).json()["id"])
    assert len(answers) == 8
    assert len(set(answers)) == 1


def test_a_stored_answer_is_read_and_drawn(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 2)
    response = client.post(QUERIES, json={"xy": seen, "store": True, "explain": True})
    answer = response.json()
    assert answer["id"] == "1"
    assert response.headers["Location"] == answer["links"]["self"] == f"{QUERIES}/1"
    assert client.get(f"{QUERIES}/1").json() == answer
    url = answer["candidates"][0]["links"]["match"]
    drawing = client.get(url, headers={"Accept": "image/svg+xml"})
    assert drawing.headers["Content-Type"] == "image/svg+xml"
    assert "<svg" in drawing.text
    match = client.get(url, headers={"Accept": "application/json"}).json()
    assert match["candidate"] == answer["candidates"][0]
    assert match["query_landmarks"] == seen
    assert match["submap_landmarks"] == points(forest(1))
    assert client.get(url, headers={"Accept": "image/png"}).status_code == 406
    for path in (f"{QUERIES}/2", f"{QUERIES}/x", f"{QUERIES}/0", f"{QUERIES}/1/candidates/9/match"):
        assert client.get(path).status_code == 404
    assert client.get(f"{QUERIES}/1/candidates/0/match").status_code == 422
    assert client.get(PLOTS).json()["revision"] == 1


def test_a_match_is_gone_when_the_submap_changed(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    url = ask(client, xy=points(forest(1)), store=True)["candidates"][0]["links"]["match"]
    put_submap(client, "plots", "p", 1, session="renamed").raise_for_status()
    assert client.get(url).status_code == 200
    put_submap(client, "plots", "p", 2).raise_for_status()
    assert client.get(url).status_code == 410
    url = ask(client, xy=points(forest(2)), store=True)["candidates"][0]["links"]["match"]
    client.delete(f"{PLOTS}/submaps/p").raise_for_status()
    gone = client.get(url)
    assert (gone.status_code, gone.json()["type"]) == (410, "/problems/gone")


def test_only_the_newest_answers_are_kept(settings: Settings) -> None:
    few = settings.model_copy(update={"limits": Limits(stored_queries=2)})
    app: FastAPI = create_app(few)
    with TestClient(app) as client:
        for collection in ("plots", "other"):
            client.put(f"/v1/collections/{collection}", json={}).raise_for_status()
        ids = [ask(client, xy=[], store=True)["id"] for _ in range(4)]
        assert ids == ["1", "2", "3", "4"]
        statuses = [client.get(f"{QUERIES}/{i}").status_code for i in range(6)]
        assert statuses == [404, 410, 410, 200, 200, 404]
        assert client.get("/v1/collections/other/queries/1").status_code == 404


def test_writes_are_seen_by_the_next_query(client: httpx.Client) -> None:
    seen = points(forest(1))
    assert ask(client, xy=seen)["verdict"] == "no_match"
    put_submap(client, "plots", "p", 1).raise_for_status()
    assert ask(client, xy=seen)["verdict"] == "matched"
    put_submap(client, "plots", "p", 2).raise_for_status()
    assert ask(client, xy=seen)["verdict"] == "no_match"
    assert ask(client, xy=points(forest(2)))["verdict"] == "matched"
    client.delete(f"{PLOTS}/submaps/p").raise_for_status()
    assert ask(client, xy=points(forest(2)))["reason"] == "empty_collection"
    put_submap(client, "plots", "p", 1).raise_for_status()
    assert ask(client, xy=seen)["verdict"] == "matched"
    client.delete(PLOTS).raise_for_status()
    assert client.post(QUERIES, json={"xy": seen}).status_code == 404
    client.put(PLOTS, json={}).raise_for_status()
    assert ask(client, xy=seen)["reason"] == "empty_collection"
