"""Constraints that a collection keeps: found by jobs, posted as odometry, listed, exported, deleted, used by maps."""

from typing import Any

import httpx
import numpy as np
import pytest

from tests.server.factories import forest, observed
from tests.server.jobs.test_jobs import finished
from tests.server.maps.test_map_jobs import URL, built, failed
from urquhart import SE2

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

ROWS = f"{URL}/constraints"


@pytest.fixture
def truth(client: httpx.Client) -> dict[str, SE2]:
    """One place seen four times, and another one seen once; world_T_submap."""
    client.put(URL, json={}).raise_for_status()
    return {
        name: stored(client, name, seed, number)
        for number, (name, seed) in enumerate(zip("abcdx", "11112", strict=True))
    }


def stored(client: httpx.Client, name: str, seed: str, number: int) -> SE2:
    seen, pose = observed(forest(int(seed)), number)
    body = {"xy": seen, "session": "mon", "stamp": f"2026-05-04T09:0{number % 10}:00Z"}
    client.put(f"{URL}/submaps/{name}", json=body).raise_for_status()
    return pose


def kept(client: httpx.Client, **wanted: Any) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = client.get(ROWS, params=wanted).json()["constraints"]
    return rows


def edge(truth: dict[str, SE2], first: str, second: str, by: float = 0.0) -> dict[str, Any]:
    step = truth[first].inverse() @ truth[second]
    covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]
    return {"from": first, "to": second, "x": step.x + by, "y": step.y, "yaw": step.yaw, "covariance": covariance}


def test_a_job_keeps_what_it_finds_and_looks_up_only_what_changed(client: httpx.Client, truth: dict[str, SE2]) -> None:
    job = finished(client, client.post(ROWS, json={}))
    assert job["done"] == 5
    rows = kept(client)
    assert len(rows) == 6 and {(row["kind"], row["source"], row["state"]) for row in rows} == {
        ("match", "job", "active")
    }
    assert {row["job"] for row in rows} == {job["id"]} and all(row["inlier_count"] > 20 for row in rows)
    for row in rows:
        at = row["transform"]
        shift, _ = (truth[row["from"]] @ SE2(at["x"], at["y"], at["yaw"])).distance(truth[row["to"]])
        assert shift < 0.1
    # Pages, and one submap.
    first = client.get(ROWS, params={"limit": 4}).json()
    rest = client.get(ROWS, params={"limit": 4, "cursor": first["next"]}).json()
    assert first["constraints"] + rest["constraints"] == rows and "next" not in rest
    assert len(kept(client, submap="a")) == 3
    # Nothing is left to look up.
    again = finished(client, client.post(ROWS, json={"changed_only": True}))
    assert again["done"] == 0 and kept(client) == rows
    # A submap gets other landmarks: its constraints are stale, and found again by looking it up alone.
    stored(client, "c", "1", 7)
    assert [row["state"] for row in kept(client, submap="c")] == ["stale"] * 3
    assert len(kept(client, state="active")) == 3 and len(kept(client, state="stale")) == 3
    third = finished(client, client.post(ROWS, json={"changed_only": True}))
    assert third["done"] == 1
    assert [row["state"] for row in kept(client)] == ["active"] * 6
    assert {row["job"] for row in kept(client, submap="c")} == {third["id"]}
    # Deleted, it stays as stale until the next search.
    client.delete(f"{URL}/submaps/d").raise_for_status()
    assert len(kept(client, state="stale")) == 3
    finished(client, client.post(ROWS, json={}))
    assert len(kept(client)) == 3


def test_odometry_is_stored_whole_or_not_at_all(client: httpx.Client, truth: dict[str, SE2]) -> None:
    good = edge(truth, "d", "x")
    refused: list[tuple[dict[str, Any], str]] = [
        ({"to": "nobody"}, "/edges/1/to"),
        ({"to": "d"}, "/edges/1/to"),
        ({"covariance": [0.0] * 9}, "/edges/1/covariance"),
        ({"from": "x", "to": "d"}, "/edges/1/to"),
    ]
    for change, pointer in refused:
        answer = client.post(f"{URL}/odometry", json={"edges": [good, good | change]})
        assert answer.status_code == 422 and answer.json()["errors"][0]["pointer"] == pointer
    assert client.post("/v1/collections/none/odometry", json={"edges": [good]}).status_code == 404
    assert kept(client) == []
    key = {"Idempotency-Key": "once"}
    for _ in range(2):
        assert client.post(f"{URL}/odometry", json={"edges": [good]}, headers=key).json() == {"stored": 1}
    # The same two submaps in the other direction: replaced, not added.
    client.post(f"{URL}/odometry", json={"edges": [edge(truth, "x", "d")]}).raise_for_status()
    (row,) = kept(client)
    assert (row["kind"], row["from"], row["to"], row["rank"], row["job"]) == ("odometry", "x", "d", None, None)
    assert row["information"][0] == pytest.approx(100.0) and row["transform"]["covariance"][0] == 0.01
    assert client.delete(f"{ROWS}/{row['id']}").status_code == 204
    assert client.delete(f"{ROWS}/{row['id']}").status_code == client.delete(f"{ROWS}/x").status_code == 404
    assert kept(client) == []


def test_maps_are_built_from_what_is_kept(client: httpx.Client, truth: dict[str, SE2]) -> None:
    client.post(f"{URL}/odometry", json={"edges": [edge(truth, "d", "x")]}).raise_for_status()
    told = built(client, {})
    assert told["summary"]["parts"] == [5]
    kinds = [(one["kind"], one["id"] is not None) for one in told["constraints"]]
    assert kinds == [("odometry", True), *[("match", True)] * 6]
    # The second map looks nothing up.
    again = finished(client, client.post(f"{URL}/maps", json={}))
    assert again["done"] == 0 and again["state"] == "successful"
    # Odometry that lies: refused, and the row says so and by which map.
    client.post(f"{URL}/odometry", json={"edges": [edge(truth, "a", "c", by=9.0)]}).raise_for_status()
    told = built(client, {})
    (row,) = kept(client, state="refused")
    assert (row["from"], row["to"], row["refused"], row["refused_by"]) == ("a", "c", "contradicted", told["id"])
    assert [one["outcome"] for one in told["contradictions"]] == ["refused"]
    # Each map judges again: without the lie, nothing is refused.
    client.delete(f"{ROWS}/{row['id']}").raise_for_status()
    assert not [one for one in built(client, {})["constraints"] if one["refused"]]
    # Two odometry edges of one map contradict each other, one of them kept: nothing is applied.
    problem = failed(client, {"apply": True, "odometry": [edge(truth, "d", "x", by=5.0)]})
    assert problem["status"] == 409 and "odometry contradicts itself" in problem["detail"]
    assert {row["refused"] for row in kept(client, state="refused")} <= {"undecided"}


def test_constraints_in_every_format(client: httpx.Client, truth: dict[str, SE2]) -> None:
    client.post(f"{URL}/odometry", json={"edges": [edge(truth, "d", "x")]}).raise_for_status()
    built(client, {"apply": True})
    rows = kept(client)
    assert client.get(ROWS, params={"format": "json"}).json()["constraints"] == rows
    assert len(client.get(ROWS, params={"format": "ndjson"}).text.splitlines()) == 7
    g2o = client.get(ROWS, params={"format": "g2o"}).text.splitlines()
    assert [sum(line.startswith(word) for line in g2o) for word in ("VERTEX_SE2", "EDGE_SE2")] == [5, 7]
    assert len(client.get(ROWS, params={"format": "matrices"}).text.splitlines()) == 7
    tum = np.loadtxt(client.get(ROWS, params={"format": "tum"}).text.splitlines())
    kitti = np.loadtxt(client.get(ROWS, params={"format": "kitti"}).text.splitlines())
    assert tum.shape == (5, 8) and kitti.shape == (5, 12)
    assert tum[:, 1] == pytest.approx(kitti[:, 3]) and np.diff(tum[:, 0]).tolist() == [60.0] * 4
    for place, name in zip(tum, "abcdx", strict=True):
        pose = truth["a"] @ SE2(place[1], place[2], 2.0 * float(np.arctan2(place[6], place[7])))
        assert pose.distance(truth[name])[0] < 0.1
    assert client.get(ROWS, params={"format": "tum", "frame_id": "none"}).status_code == 422
    assert client.get(ROWS, params={"kind": "birds"}).status_code == 422
    assert client.get(ROWS, params={"cursor": "x"}).status_code == 422


def test_a_trajectory_needs_a_common_frame_and_stamps(client: httpx.Client, truth: dict[str, SE2]) -> None:
    stored(client, "y", "2", 8)
    finished(client, client.post(ROWS, json={}))
    assert len(kept(client)) == 7
    answer = client.get(ROWS, params={"format": "kitti"})
    assert answer.status_code == 422 and "2 groups of submaps" in answer.json()["detail"]
    client.patch(f"{URL}/submaps/y", json={"stamp": None}).raise_for_status()
    answer = client.get(ROWS, params={"format": "tum", "submap": "y"})
    assert answer.status_code == 422 and "1 submaps have no stamp, such as 'y'" in answer.json()["detail"]
    assert len(client.get(ROWS, params={"format": "kitti", "submap": "y"}).text.splitlines()) == 2
