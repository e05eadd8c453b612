"""Maps over HTTP: a job builds one, applies it once or not at all, and its trees are read in any format."""

from typing import Any

import httpx
import numpy as np
import orjson
import pytest

from server.errors import StorageBusy
from server.jobs.types import build_map
from server.maps import whole_searches
from server.maps.applying import apply_map
from server.maps.selection import choose
from tests.server.factories import forest, observed
from tests.server.jobs.test_jobs import finished
from urquhart import SE2

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

URL = "/v1/collections/drives"


@pytest.fixture
def truth(client: httpx.Client) -> dict[str, SE2]:
    """One place seen by two drives, twice each; another place seen by one of them; world_T_submap."""
    poses = {}
    views = [("a", 1, "mon"), ("b", 1, "mon"), ("c", 1, "tue"), ("d", 1, "tue"), ("x", 2, "tue")]
    client.put(URL, json={}).raise_for_status()
    for number, (name, seed, session) in enumerate(views):
        seen, poses[name] = observed(forest(seed), number)
        body = {"xy": seen, "session": session, "stamp": f"2026-05-04T09:0{number}:00Z"}
        client.put(f"{URL}/submaps/{name}", json=body).raise_for_status()
    return poses


def built(client: httpx.Client, body: Any) -> dict[str, Any]:
    """The map that a job builds."""
    job = finished(client, client.post(f"{URL}/maps", json=body))
    assert job["state"] == "successful", job
    answer = client.get(f"{URL}/maps/{job['id']}")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def failed(client: httpx.Client, body: Any) -> dict[str, Any]:
    job = finished(client, client.post(f"{URL}/maps", json=body))
    assert job["state"] == "failed", job
    problem: dict[str, Any] = job["problem"]
    return problem


def map_poses(client: httpx.Client) -> dict[str, Any]:
    return {one["id"]: one["map_pose"] for one in client.get(f"{URL}/submaps").json()["submaps"]}


def check(truth: dict[str, SE2], poses: dict[str, Any], first: str) -> None:
    """The poses are true in the frame of the submap `first`."""
    for name, pose in truth.items():
        if poses.get(name) is not None:
            at = poses[name]
            shift, turn = (truth[first] @ SE2(at["x"], at["y"], at["yaw"])).distance(pose)
            assert shift < 0.1 and turn < 0.01, name


def test_a_map_is_built_read_and_applied(client: httpx.Client, truth: dict[str, SE2]) -> None:
    told = built(client, {})
    summary = told["summary"]
    assert (summary["submaps"], summary["parts"], summary["trees"]) == (5, [4, 1], 120)
    assert (summary["constraints"], summary["contradicted"], summary["unconfirmed"]) == (6, 0, 0)
    assert told["map_version"] is None and set(map_poses(client).values()) == {None}
    poses = {one["id"]: one["map_pose"] for one in told["poses"]}
    assert poses["x"] is None
    check(truth, poses, "a")
    assert all(one["refused"] is None and one["support"] >= 2 for one in told["constraints"])

    applied = built(client, {"apply": True, "map_frame_id": "site"})
    revision = client.get(URL).json()["revision"]
    assert applied["map_version"] == revision
    stored = map_poses(client)
    assert stored["x"] is None and {stored[name]["frame_id"] for name in "abcd"} == {"site"}
    check(truth, stored, "a")
    # A query answers in the map.
    seen, world_T_query = observed(forest(1), 99)
    best = client.post(f"{URL}/queries", json={"xy": seen}).json()["candidates"][0]["map_pose"]
    check({"q": world_T_query, "a": truth["a"]}, {"q": best}, "a")
    # Building it again moves nothing by more than rounding, and other submaps of its frame are not left behind.
    again = built(client, {"apply": True, "map_frame_id": "site"})
    assert again["poses"][1]["map_pose"]["x"] == pytest.approx(poses["b"]["x"], abs=1e-6)
    problem = failed(client, {"apply": True, "map_frame_id": "site", "sessions": ["mon"]})
    assert problem["status"] == 409 and "2 submaps that are not in this map" in problem["detail"]
    assert client.get(URL).json()["revision"] == again["map_version"]


def test_the_trees_of_a_map_in_every_format(client: httpx.Client, truth: dict[str, SE2]) -> None:
    told = built(client, {"sessions": ["mon", "tue"]})
    url = f"{URL}/maps/{told['id']}/landmarks"
    part = client.get(url).json()
    assert (part["part"], part["frame_id"], len(part["trees"])) == (1, "map", 60)
    assert {tree["observed"] for tree in part["trees"]} == {4}
    xy = truth["a"].apply(np.array([(tree["x"], tree["y"]) for tree in part["trees"]]))
    assert np.hypot(*(xy[:, None] - forest(1)[None]).transpose(2, 0, 1)).min(axis=1).max() < 0.2
    lines = client.get(url, params={"format": "csv"}).text.splitlines()
    assert len(lines) == 61 and lines[0].startswith("id,x,y,sigma_m,dbh_cm")
    assert client.get(url, params={"format": "geojson"}).json()["type"] == "FeatureCollection"
    missing = client.get(url, params={"part": 2})
    assert missing.status_code == 404
    results = client.get(f"/v1/jobs/{told['id']}/results").content.splitlines()
    assert orjson.loads(results[0])["of"] == "map" and len(results) == 1 + 5 + 6 + 120
    assert client.get(f"{URL}/maps/nothing").status_code == 404


def test_odometry_and_priors(client: httpx.Client, truth: dict[str, SE2]) -> None:
    step = truth["d"].inverse() @ truth["x"]
    edge = {"from": "d", "to": "x", "x": step.x, "y": step.y, "yaw": step.yaw}
    edge["covariance"] = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]
    at = truth["b"]
    prior = {
        "frame_id": "gnss",
        "x": at.x,
        "y": at.y,
        "yaw": at.yaw,
        "covariance": [1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-6],
    }
    client.patch(f"{URL}/submaps/b", json={"map_pose": prior}).raise_for_status()
    told = built(client, {"odometry": [edge], "use_map_poses": True, "agreeing": 1})
    assert told["summary"]["parts"] == [5]
    assert [one["kind"] for one in told["constraints"]] == ["odometry", *["match"] * 6, "prior"]
    for one in told["poses"]:
        pose = one["map_pose"]
        shift, _ = SE2(pose["x"], pose["y"], pose["yaw"]).distance(truth[one["id"]])
        assert pose["frame_id"] == "gnss" and shift < 0.1
    for change, pointer in (
        ({"to": "nobody"}, "/odometry/0/to"),
        ({"to": "d"}, "/odometry/0/to"),
        ({"covariance": [0.0] * 9}, "/odometry/0/covariance"),
    ):
        problem = failed(client, {"odometry": [edge | change]})
        assert problem["status"] == 422 and problem["errors"][0]["pointer"] == pointer
    assert client.post(f"{URL}/maps", json={"odometry": [edge | {"yaw": 90.0}]}).status_code == 422


def test_odometry_that_contradicts_itself_is_named_and_not_applied(client: httpx.Client, truth: dict[str, SE2]) -> None:
    step = truth["d"].inverse() @ truth["x"]
    edges = [
        {"from": "d", "to": "x", "x": step.x + shift, "y": step.y, "yaw": step.yaw}
        | {"covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]}
        for shift in (0.0, 3.0)
    ]
    told = built(client, {"odometry": edges})
    assert [one["refused"] for one in told["constraints"]] == ["undecided"] * 2 + [None] * 6
    (one,) = told["contradictions"]
    assert (one["odometry"], one["against"], one["outcome"]) == ([0, 1], [], "undecided") and one["distance"] > 5.5
    assert (told["summary"]["undecided"], told["summary"]["contradictions"]) == (2, 1)
    assert told["summary"]["parts"] == [4, 1]
    problem = failed(client, {"odometry": edges, "apply": True})
    assert problem["status"] == 409 and "odometry contradicts itself by" in problem["detail"]
    assert "d - x, d - x" in problem["detail"] and set(map_poses(client).values()) == {None}


def test_a_map_is_applied_whole_or_not_at_all(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The transaction fails after all poses were written: none is there, and the job goes on and applies them once."""
    assert truth
    calls, before = list[int](), client.get(URL).json()["revision"]

    def broken(tx: Any, collection_id: str, made: Any) -> int:
        version = apply_map(tx, collection_id, made)
        calls.append(version)
        if len(calls) == 1:
            assert isinstance(client.get(URL).json()["revision"], int)
            assert client.get(URL).json()["revision"] == before  # a reader sees the state of before
            raise StorageBusy("locked")
        return version

    monkeypatch.setattr(build_map, "apply_map", broken)
    job = finished(client, client.post(f"{URL}/maps", json={"apply": True}))
    assert job["state"] == "successful", job
    assert len(calls) == 2
    assert client.get(URL).json()["revision"] == before + 1 == job["counts"]["map_version"]


def test_submaps_that_change_meanwhile_stop_the_map(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert truth

    def late(*given: Any) -> Any:
        chosen = choose(*given)
        client.put(f"{URL}/submaps/c", json={"xy": observed(forest(1), 50)[0]}).raise_for_status()
        client.delete(f"{URL}/submaps/d").raise_for_status()
        return chosen

    monkeypatch.setattr(build_map, "choose", late)
    problem = failed(client, {"apply": True})
    assert problem["status"] == 409 and "2 submaps were deleted or got other landmarks" in problem["detail"]
    assert set(map_poses(client).values()) == {None}


@pytest.mark.parametrize(
    ("body", "status"),
    [({"sessions": []}, 422), ({"submap_ids": ["nobody"]}, 422), ({"agreeing": 3}, 422), ({"aply": True}, 422)],
)
def test_what_no_map_can_be_built_from_is_refused(client: httpx.Client, body: Any, status: int) -> None:
    client.put(URL, json={}).raise_for_status()
    assert client.post(f"{URL}/maps", json=body).status_code == status
    assert client.post("/v1/collections/none/maps", json={}).status_code == 404


def test_a_map_of_no_submaps_and_of_one(client: httpx.Client) -> None:
    client.put(URL, json={}).raise_for_status()
    assert built(client, {"apply": True})["summary"]["parts"] == []
    client.put(f"{URL}/submaps/a", json={"xy": forest(1).tolist()}).raise_for_status()
    told = built(client, {"apply": True})
    assert told["summary"]["parts"] == [1] and told["poses"][0]["map_pose"]["frame_id"] == "map"
    assert client.get(f"{URL}/submaps/a").json()["map_pose"]["frame_id"] == "map"
    assert client.get(f"{URL}/maps/{told['id']}/landmarks").json()["trees"]


def test_poses_are_written_all_or_none(client: httpx.Client) -> None:
    client.put(URL, json={}).raise_for_status()
    for name in "ab":
        client.put(f"{URL}/submaps/{name}", json={"xy": forest(1).tolist()}).raise_for_status()
    before = client.get(URL).json()["revision"]
    etag = client.get(f"{URL}/submaps/a").json()["etag"].strip('"')
    pose = {"frame_id": "site", "x": 1.0, "y": 2.0, "yaw": 0.5}
    moves = [{"id": "a", "map_pose": pose, "if_match": etag}, {"id": "b", "map_pose": pose | {"x": 3.0}}]
    refused: list[tuple[Any, int, str]] = [
        ([moves[0], {"id": "nobody", "map_pose": pose}], 422, "/poses/1/id"),
        ([moves[0], moves[0]], 422, "/poses/1/id"),
        ([moves[1], moves[0] | {"if_match": "other"}], 412, ""),
        ([moves[0], {"id": "b", "map_pose": pose | {"yaw": 90.0}}], 422, "/poses/1/map_pose/yaw"),
        ([], 422, "/poses"),
    ]
    for body, status, pointer in refused:
        answer = client.post(f"{URL}/poses", json={"poses": body})
        assert answer.status_code == status, answer.text
        assert not pointer or answer.json()["errors"][0]["pointer"] == pointer
    assert client.get(URL).json()["revision"] == before and set(map_poses(client).values()) == {None}
    key = {"Idempotency-Key": "once"}
    answers = [client.post(f"{URL}/poses", json={"poses": moves}, headers=key).json() for _ in range(2)]
    assert answers == [{"map_version": before + 1, "changed": 2}] * 2
    assert {name: one["x"] for name, one in map_poses(client).items()} == {"a": 1.0, "b": 3.0}
    removed = client.post(f"{URL}/poses", json={"poses": [{"id": "a", "map_pose": None}]}).json()
    assert removed == {"map_version": before + 2, "changed": 1} and map_poses(client)["a"] is None


def test_a_map_of_many_submaps_is_optimised_in_another_process(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    """GTSAM keeps Python's lock: in this process, no request would be answered meanwhile."""
    here = built(client, {})
    monkeypatch.setattr(whole_searches, "_SMALL", 0)
    apart = built(client, {})
    assert apart["poses"] == here["poses"] and apart["constraints"] == here["constraints"]
