"""Landmarks as binary columns: every tree where it is in the map, thinned evenly, and sent again only if it changed."""

import json
import math
import struct
from dataclasses import dataclass
from typing import Any

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.server.factories import forest, points, put_submap
from urquhart import SE2

PATH = "/v1/collections/plots/landmarks"


@dataclass(frozen=True)
class SentColumns:
    head: dict[str, Any]
    boxes: NDArray[np.float64]
    counts: NDArray[np.uint32]
    xy: NDArray[np.float64]


def read(answer: httpx.Response) -> SentColumns:
    """As the route's description says that they lie."""
    assert answer.status_code == 200, answer.text
    data = answer.content
    assert data[:8] == b"URQCOL1\n"
    (length,) = struct.unpack("<I", data[8:12])
    head = json.loads(data[12 : 12 + length])
    count, at = len(head["submaps"]), 12 + length
    assert at % 4 == 0
    boxes = np.frombuffer(data, "<f4", 4 * count, at).reshape(-1, 4)
    counts = np.frombuffer(data, "<u4", count, at + 16 * count)
    xy = np.frombuffer(data, "<f4", -1, at + 20 * count).reshape(-1, 2)
    assert counts.sum() == len(xy)
    return SentColumns(head, boxes + np.tile(head["origin"], 2), counts, xy + np.array(head["origin"]))


@pytest.fixture
def poses(client: httpx.Client) -> dict[str, SE2]:
    """Three submaps of 60 trees in a map with coordinates of a national grid, and one that has no place."""
    made = {f"p{seed}": SE2(448_000.0 + 100 * seed, 5_411_000.0, 0.3 * seed) for seed in (1, 2, 3)}
    for seed, (name, pose) in enumerate(made.items(), start=1):
        place = {"frame_id": "map", "x": pose.x, "y": pose.y, "yaw": pose.yaw}
        session = None if seed == 3 else "drive"
        put_submap(client, "plots", name, seed, map_pose=place, session=session).raise_for_status()
    put_submap(client, "plots", "nowhere", 4).raise_for_status()
    return made


def test_every_tree_is_where_it_is_in_the_map(client: httpx.Client, poses: dict[str, SE2]) -> None:
    columns = read(client.get(PATH, params={"frame_id": "map"}))
    assert columns.head["submaps"] == list(poses)
    assert (columns.head["landmarks"], columns.head["every"]) == (180, 1)
    assert [columns.head["sessions"], columns.head["session_of"]] == [["drive"], [0, 0, -1]]
    assert len(columns.head["stamps"]) == 3
    expected = np.concatenate([pose.apply(forest(seed)) for seed, pose in enumerate(poses.values(), start=1)])
    # Millimetres, although float32 has half a metre between neighbours at a northing of five million.
    assert np.abs(columns.xy - expected).max() < 1e-3
    for box, part in zip(columns.boxes, np.split(columns.xy, np.cumsum(columns.counts)[:-1]), strict=True):
        assert np.allclose(box, [*part.min(axis=0), *part.max(axis=0)], atol=1e-2)


def test_more_trees_than_asked_for_are_thinned_evenly(client: httpx.Client, poses: dict[str, SE2]) -> None:
    whole = read(client.get(PATH, params={"frame_id": "map"}))
    for limit in (1, 7, 60, 100, 179):
        some = read(client.get(PATH, params={"frame_id": "map", "limit": limit}))
        every = some.head["every"]
        assert math.log2(every).is_integer()
        assert limit / 2 - 1 <= len(some.xy) <= limit
        assert np.array_equal(some.xy, whole.xy[::every])
        assert some.head["landmarks"] == 180


def test_a_box_and_a_session_choose(client: httpx.Client, poses: dict[str, SE2]) -> None:
    box = "448250,5410900,448500,5411100"
    assert read(client.get(PATH, params={"frame_id": "map", "bbox": box})).head["submaps"] == ["p3"]
    one = read(client.get(PATH, params={"frame_id": "map", "session": "drive"}))
    assert one.head["submaps"] == ["p1", "p2"]
    none = read(client.get(PATH, params={"frame_id": "other"}))
    assert (none.head["submaps"], len(none.xy), none.head["origin"]) == ([], 0, [0.0, 0.0])


def test_what_did_not_change_is_not_sent_again(client: httpx.Client, poses: dict[str, SE2]) -> None:
    first = client.get(PATH, params={"frame_id": "map"})
    same = {"If-None-Match": first.headers["ETag"]}
    again = client.get(PATH, params={"frame_id": "map"}, headers=same)
    assert (again.status_code, again.content) == (304, b"")
    assert first.headers["Cache-Control"] == again.headers["Cache-Control"] == "private, no-cache"
    assert client.get(PATH, params={"frame_id": "map", "limit": 5}, headers=same).status_code == 200
    move = {"map_pose": {"frame_id": "map", "x": 0.0, "y": 0.0, "yaw": 0.0}}
    client.patch("/v1/collections/plots/submaps/p1", json=move).raise_for_status()
    changed = client.get(PATH, params={"frame_id": "map"}, headers=same)
    assert changed.headers["ETag"] != first.headers["ETag"]
    assert np.allclose(read(changed).xy[:60], points(forest(1)), atol=0.3)


def test_bad_parameters_are_refused(client: httpx.Client) -> None:
    assert client.get(PATH).status_code == 422
    assert client.get(PATH, params={"frame_id": "map", "limit": 0}).status_code == 422
    assert client.get(PATH, params={"frame_id": "map", "bbox": "1,2"}).status_code == 422
    assert client.get("/v1/collections/none/landmarks", params={"frame_id": "map"}).status_code == 404
