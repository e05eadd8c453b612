"""Submaps that fit alike and put the query at different places of one map are never `matched`."""

from typing import Any

import httpx
import numpy as np
import pytest
from pyproj import Transformer

from server.jobs.types.find_constraints import CONTRADICTING
from tests.server.factories import forest, observed, points
from tests.server.jobs.test_jobs import finished
from urquhart import SE2

PLOTS = "/v1/collections/plots"
EXACT = [0.0] * 9
METRES = [4.0, 0, 0, 0, 4.0, 0, 0, 0, 0.01]


def place(client: httpx.Client, name: str, off: SE2, seed: int, **fields: Any) -> SE2:
    """Store what is seen of one forest, placed in the map where it is, or `off` that; map_T_submap."""
    seen, world_T_submap = observed(forest(1), seed)
    pose = off @ world_T_submap
    placed = {"frame_id": "stand", "x": pose.x, "y": pose.y, "yaw": pose.yaw} | fields
    session = {"session": name}
    client.put(f"{PLOTS}/submaps/{name}", json={"xy": seen, "map_pose": placed} | session).raise_for_status()
    return pose


def ask(client: httpx.Client, **body: Any) -> Any:
    seen, _ = observed(forest(1), 99)
    response = client.post(f"{PLOTS}/queries", json={"xy": seen, **body})
    assert response.status_code == 200, response.text
    return response.json()


RIGHT = SE2(0.0, 0.0, 0.0)
CORRECTED = SE2(-10.5, 20.5, 0.66)


@pytest.mark.parametrize("body", [{}, {"limit": 1}, {"per_session": True}, {"limit": 1, "method": "paper"}])
def test_an_old_version_beside_the_new_one_is_not_matched(client: httpx.Client, body: Any) -> None:
    place(client, "new-1", RIGHT, 1, covariance=EXACT)
    place(client, "new-2", RIGHT, 2, covariance=EXACT)
    assert ask(client, **body)["verdict"] == "matched"
    place(client, "old", CORRECTED, 3, covariance=EXACT)
    answer = ask(client, **body, explain=True)
    assert (answer["verdict"], answer["reason"]) == ("ambiguous", "contradicting_maps")
    assert answer["candidates"][0]["refused"] == "contradicting_maps"
    assert len(answer["candidates"]) <= body.get("limit", 5)
    named = {answer["candidates"][0]["submap_id"]} | {one["submap_id"] for one in answer["rivals"]}
    assert named >= {"new-1", "new-2", "old"}
    assert "contradicting_maps" in answer["sentences"]
    client.delete(f"{PLOTS}/submaps/old").raise_for_status()
    assert ask(client, **body)["verdict"] == "matched"


@pytest.mark.parametrize(
    ("off", "fields", "verdict"),
    [
        (SE2(0.3, 0.0, 0.0), {"covariance": EXACT}, "matched"),
        (SE2(3.0, 0.0, 0.0), {"covariance": EXACT}, "ambiguous"),
        (SE2(0.0, 0.0, 0.2), {"covariance": EXACT}, "ambiguous"),
        (SE2(3.0, 0.0, 0.0), {"covariance": METRES}, "matched"),
        (SE2(40.0, 0.0, 0.0), {"covariance": METRES}, "ambiguous"),
        (SE2(8.0, 0.0, 0.0), {}, "matched"),
        (SE2(40.0, 0.0, 0.0), {}, "ambiguous"),
        (SE2(40.0, 0.0, 0.0), {"frame_id": "another", "covariance": EXACT}, "matched"),
    ],
)
def test_poses_contradict_each_other_beyond_their_covariances(
    client: httpx.Client, off: SE2, fields: Any, verdict: str
) -> None:
    place(client, "one", RIGHT, 1, covariance=EXACT)
    place(client, "two", off, 2, **fields)
    assert ask(client)["verdict"] == verdict


def test_maps_far_from_their_origin_contradict_each_other_as_near_ones_do(client: httpx.Client) -> None:
    """The pose of the query's origin would swing by metres with a turn that does not matter."""
    far = SE2(4e6, 3e6, 0.0)
    for name, seed, off in (("one", 1, far), ("two", 2, far @ SE2(0.05, 0.0, 5e-4))):
        place(client, name, off, seed, covariance=EXACT)
    assert ask(client)["verdict"] == "matched"
    place(client, "three", far @ SE2(3.0, 0.0, 0.0), 3, covariance=EXACT)
    assert ask(client)["verdict"] == "ambiguous"


@pytest.mark.parametrize("frame", [{}, {"covariance": METRES}])
@pytest.mark.parametrize(
    ("off", "verdict"), [((0.0, 9.0), "matched"), ((200.0, 0.0), "ambiguous"), ((0.0, 30.0), "ambiguous")]
)
def test_poses_of_submaps_in_full_coordinates_contradict_each_other_as_local_ones_do(
    client: httpx.Client, off: tuple[float, float], verdict: str, frame: Any
) -> None:
    """What is not known of such a pose is about its trees: about an origin 5,400 km away, all poses would agree."""
    full = points(forest(1) + [448_100.0, 5_411_000.0])
    covariance = frame and {"covariance": [4.0, 0, 0, 0, 4.0, 0, 0, 0, 0]}
    for name, (east, north) in (("old", (0.0, 0.0)), ("new", off)):
        pose = {"x": east, "y": north, "yaw": 0.0} | covariance
        client.put(f"{PLOTS}/submaps/{name}", json={"xy": full, "map_pose": pose}).raise_for_status()
    assert ask(client)["verdict"] == verdict


@pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:32632"])
@pytest.mark.parametrize(
    ("off", "turn", "verdict"), [(0.0, 0.0, "matched"), (250.0, 0.0, "ambiguous"), (0.0, 1.0, "ambiguous")]
)
def test_frames_with_a_system_are_compared_on_earth(
    client: httpx.Client, crs: str, off: float, turn: float, verdict: str
) -> None:
    """The north of one UTM zone is turned by degrees from the north of the next, and its eastings begin elsewhere."""
    frames = {"z33": {"crs": "EPSG:32633", "origin": [300_000.0, 5_411_000.0]}, "other": {"crs": crs}}
    client.patch(PLOTS, json={"frames": frames}).raise_for_status()
    place(client, "one", RIGHT, 1, covariance=EXACT, frame_id="z33")
    to_other = Transformer.from_crs("EPSG:32633", crs, always_xy=True)
    seen, z33_T_submap = observed(forest(1), 2)
    z33_T_submap = SE2(off, 0.0, turn) @ z33_T_submap
    ends = z33_T_submap.apply(np.array([[0.0, 0.0], [1.0, 0.0]])) + [300_000.0, 5_411_000.0]
    here, ahead = np.column_stack(to_other.transform(*ends.T))
    pose = {"frame_id": "other", "x": here[0], "y": here[1], "yaw": float(np.arctan2(*(ahead - here)[::-1]))}
    client.put(f"{PLOTS}/submaps/two", json={"xy": seen, "map_pose": pose | {"covariance": EXACT}}).raise_for_status()
    assert ask(client)["verdict"] == verdict
    client.patch(PLOTS, json={"frames": {"other": None}}).raise_for_status()
    assert ask(client)["verdict"] == "matched"  # nobody says how the frames lie to each other


def test_a_search_for_constraints_tells_how_often_maps_contradict_each_other(client: httpx.Client) -> None:
    for name, seed, off in (("new-1", 1, RIGHT), ("new-2", 2, RIGHT), ("old", 3, CORRECTED)):
        place(client, name, off, seed, covariance=EXACT)
    job = finished(client, client.post(f"{PLOTS}/constraints", json={}))
    # Seen from the old one, both new ones agree; from either new one, the other and the old one do not.
    assert job["counts"] == {"constraints": 2, "inconsistent": 0, CONTRADICTING: 2}
