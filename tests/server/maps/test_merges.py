"""Two map frames over HTTP: one is laid onto the other, once or not at all."""

from typing import Any

import httpx
import numpy as np
import pytest

from server.errors import StorageBusy
from server.jobs.types import merge_frames
from server.maps.merging import apply_merge
from tests.server.factories import forest, observed
from tests.server.jobs.test_jobs import finished
from tests.server.maps.test_map_jobs import URL, map_poses
from urquhart import SE2

SECOND_T_WORLD = SE2(30.0, -12.0, 2.1)
"""The frame of the second robot; that of the first one is the world's."""
COVARIANCE = [1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-6]


@pytest.fixture
def truth(client: httpx.Client) -> dict[str, SE2]:
    """Two robots see one place 4 and 5 times, each with poses in a map frame of its own; world_T_submap."""
    client.put(URL, json={}).raise_for_status()
    return {name: stored(client, name, number) for number, name in enumerate(["a", "b", "c", "d", *"vwxyz"])}


def stored(client: httpx.Client, name: str, number: int) -> SE2:
    seen, pose = observed(forest(1), number)
    at, frame = (pose, "first") if name < "m" else (SECOND_T_WORLD @ pose, "second")
    place = {"frame_id": frame, "x": at.x, "y": at.y, "yaw": at.yaw, "covariance": COVARIANCE}
    client.put(f"{URL}/submaps/{name}", json={"xy": seen, "map_pose": place}).raise_for_status()
    return pose


def merged(client: httpx.Client, **body: Any) -> dict[str, Any]:
    job = finished(client, client.post(f"{URL}/merges", json={"from": "second", "to": "first"} | body))
    assert job["state"] == "successful", job
    found: dict[str, Any] = client.get(f"{URL}/merges/{job['id']}").json()
    return found


def test_a_frame_is_laid_onto_another_and_its_submaps_move_there(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = merged(client)
    summary, at = told["summary"], told["summary"]["transform"]
    assert (summary["verdict"], summary["agreeing"], summary["submaps"]) == ("joined", 4, 5)
    assert summary["used"] == 20 and summary["refused"] == 0 and told["map_version"] is None
    shift, turn = SE2(at["x"], at["y"], at["yaw"]).distance(SECOND_T_WORLD.inverse())
    assert shift < 0.1 and turn < 0.003
    assert len(told["pairs"]) == 20 and all(
        pair["refused"] is None and pair["distance"] < 4.1 for pair in told["pairs"]
    )
    assert {pair["from_submap"] for pair in told["pairs"]} == set("vwxyz")
    before = client.get(URL).json()["revision"]
    assert {place["frame_id"] for place in map_poses(client).values()} == {"first", "second"}
    # Applied, but the first transaction fails after all poses were written: none is there, then all are, once.
    calls = list[int]()

    def broken(*given: Any) -> int:
        version = apply_merge(*given)
        calls.append(version)
        if len(calls) == 1:
            raise StorageBusy("locked")
        return version

    monkeypatch.setattr(merge_frames, "apply_merge", broken)
    told = merged(client, apply=True)
    assert told["map_version"] == client.get(URL).json()["revision"] == before + 1 and len(calls) == 2
    places = map_poses(client)
    assert {place["frame_id"] for place in places.values()} == {"first"}
    for name, pose in truth.items():
        assert SE2(places[name]["x"], places[name]["y"], places[name]["yaw"]).distance(pose)[0] < 0.1
    covariance = client.get(f"{URL}/submaps/v").json()["map_pose"]["covariance"]
    assert 1e-4 < covariance[0] < 0.01
    # The frame has no submaps any more.
    answer = client.post(f"{URL}/merges", json={"from": "second", "to": "first"})
    assert answer.status_code == 422 and answer.json()["errors"][0]["pointer"] == "/from"


def test_a_frame_that_contradicts_itself_joins_nothing(client: httpx.Client, truth: dict[str, SE2]) -> None:
    """Half of the second robot's map is 15 m away from the other half."""
    merged(client)
    moves = []
    for name in "wxyz"[1:]:
        at = SE2(15.0, 0.0, 0.0) @ SECOND_T_WORLD @ truth[name]
        place = {"frame_id": "second", "x": at.x, "y": at.y, "yaw": at.yaw, "covariance": COVARIANCE}
        moves.append({"id": name, "map_pose": place})
    client.post(f"{URL}/poses", json={"poses": moves}).raise_for_status()
    told = merged(client)
    assert told["summary"]["verdict"] in ("undecided", "unconnected") and told["summary"]["transform"] is None
    assert {pair["refused"] for pair in told["pairs"]} == {"unconfirmed"}
    job = finished(client, client.post(f"{URL}/merges", json={"from": "second", "to": "first", "apply": True}))
    assert job["state"] == "failed" and job["problem"]["status"] == 409
    assert "cannot be laid onto 'first'" in job["problem"]["detail"]
    assert {place["frame_id"] for place in map_poses(client).values()} == {"first", "second"}


def test_a_pair_that_disagrees_is_named(client: httpx.Client, truth: dict[str, SE2]) -> None:
    merged(client)  # a query that finds maps which contradict each other is ambiguous, so the matches come first
    at = SE2(9.0, 0.0, 0.0) @ SECOND_T_WORLD @ truth["z"]
    place = {"frame_id": "second", "x": at.x, "y": at.y, "yaw": at.yaw, "covariance": COVARIANCE}
    client.patch(f"{URL}/submaps/z", json={"map_pose": place}).raise_for_status()
    told = merged(client)
    assert told["summary"]["verdict"] == "joined"
    refused = [pair for pair in told["pairs"] if pair["refused"]]
    assert {pair["from_submap"] for pair in refused} == {"z"} and len(refused) == 4
    assert all(pair["refused"] == "contradicted" and pair["shift"] == pytest.approx(9.0, abs=0.3) for pair in refused)
    assert np.median([pair["distance"] for pair in refused]) > 10.0


def test_what_cannot_be_merged_is_refused(client: httpx.Client, truth: dict[str, SE2]) -> None:
    assert truth
    for change, status, pointer in (
        ({"to": "second"}, 422, "/to"),
        ({"to": "nowhere"}, 422, "/to"),
        ({"from": "nowhere"}, 422, "/from"),
        ({"least": 2}, 422, "/least"),
    ):
        answer = client.post(f"{URL}/merges", json={"from": "second", "to": "first"} | change)
        assert answer.status_code == status and answer.json()["errors"][0]["pointer"] == pointer
    assert client.post("/v1/collections/none/merges", json={"from": "a", "to": "b"}).status_code == 404
    assert client.get(f"{URL}/merges/nothing").status_code == 404
