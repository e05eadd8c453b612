"""A query of several keyframes gets one verdict, over HTTP and with the client's body."""

import httpx
import numpy as np
import pytest

from tests.server.factories import forest, observed
from urquhart import SE2

URL = "/v1/collections/plots"


def test_keyframes_are_one_query(client: httpx.Client) -> None:
    client.put(URL, json={}).raise_for_status()
    seen, world_T_submap = observed(forest(1), 0)
    client.put(f"{URL}/submaps/p", json={"xy": seen}).raise_for_status()
    # Two halves of the place, in frames of their own.
    trees, poses = forest(1), [SE2(3.0, 1.0, 0.4), SE2(-5.0, 2.0, -1.0)]
    halves = [trees[trees[:, 0] < 5.0], trees[trees[:, 0] > -5.0]]
    keyframes = [
        {
            "landmarks": [
                {"id": f"t{i}", "x": x, "y": y, "dbh_cm": 20.0}
                for i, (x, y) in enumerate(pose.inverse().apply(half).tolist())
            ],
            "pose": {"x": pose.x, "y": pose.y, "yaw": pose.yaw},
        }
        for half, pose in zip(halves, poses, strict=True)
    ]
    answer = client.post(f"{URL}/queries", json={"keyframes": keyframes, "store": True}).json()
    assert answer["verdict"] == "matched" and answer["landmark_count"] == len(trees)
    best = answer["candidates"][0]
    at = best["transform"]
    shift, _ = (world_T_submap @ SE2(at["x"], at["y"], at["yaw"])).distance(SE2.identity())
    assert shift < 0.1
    names = {pair["query"] for pair in best["inliers"]}
    assert {name.split("/")[0] for name in names} == {"0", "1"} and len(names) == len(best["inliers"])
    assert client.get(f"{URL}/queries/{answer['id']}").json()["landmark_count"] == len(trees)


@pytest.mark.parametrize(
    "body",
    [
        {"keyframes": []},
        {"keyframes": [{"xy": [[1.0, 2.0]]}]},
        {"keyframes": [{"xy": [[1.0, 2.0]], "pose": {"x": 0.0, "y": 0.0, "yaw": 90.0}}]},
        {"keyframes": [{"xy": [[1.0, 2.0]], "pose": {"x": 0.0, "y": 0.0, "yaw": 0.0}}], "xy": [[1.0, 2.0]]},
        {"keyframes": [{"xy": [[1.0, 2.0]], "pose": {"x": 0.0, "y": 0.0, "yaw": 0.0}}], "submap_id": "p"},
    ],
)
def test_keyframes_that_cannot_be_are_refused(client: httpx.Client, body: dict[str, object]) -> None:
    client.put(URL, json={}).raise_for_status()
    assert client.post(f"{URL}/queries", json=body).status_code == 422


def test_few_trees_in_keyframes_are_no_error(client: httpx.Client) -> None:
    client.put(URL, json={}).raise_for_status()
    client.put(f"{URL}/submaps/p", json={"xy": np.round(forest(1), 2).tolist()}).raise_for_status()
    body = {"keyframes": [{"xy": [], "pose": {"x": 0.0, "y": 0.0, "yaw": 0.0}}] * 2}
    answer = client.post(f"{URL}/queries", json=body)
    assert answer.status_code == 200 and answer.json()["reason"] == "too_few_landmarks"
