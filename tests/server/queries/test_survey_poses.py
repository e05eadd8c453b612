"""Poses as surveyors read them: shift and turn at the middle of the trees, wherever the origin is."""

import math

import httpx
import numpy as np
import pytest

from tests.server.factories import Points, forest, observed, points, put_submap
from tests.server.queries.test_queries import PLOTS, ask
from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty, least_squares

FAR = np.array([448_100.0, 5_411_000.0])
TURN, SHIFT = math.radians(-1.49), np.array([-4.2, 2.71])


def displaced(trees: Points) -> Points:
    """The trees as a survey has them that the shift and then the turn about their middle put right."""
    middle = trees.mean(axis=0)
    return np.asarray(SE2(0.0, 0.0, -TURN).apply(trees - middle) + middle - SHIFT)


def test_shift_and_turn_of_coordinates_far_from_the_origin(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832"}).raise_for_status()
    trees = forest(1)
    pose = {"x": FAR[0], "y": FAR[1], "yaw": 0.0, "covariance": [0.0] * 9}
    client.put(f"{PLOTS}/submaps/p", json={"xy": points(trees), "map_pose": pose}).raise_for_status()
    survey = ask(client, xy=points(displaced(trees + FAR)))["candidates"][0]["survey"]
    assert (survey["frame_id"], survey["crs"], survey["crs_unit"]) == ("map", "EPSG:25832", "metre")
    assert (survey["axes"], survey["covariance_frame"], survey["about"]) == (["east", "north"], "map", "query_centre")
    assert survey["shift"] == pytest.approx(SHIFT, abs=1e-6)
    assert survey["turn_degrees"] == pytest.approx(-1.49, abs=1e-5)
    assert survey["position"] == pytest.approx(trees.mean(axis=0) + FAR, abs=1e-6)
    assert survey["crs_position"] == survey["position"]
    assert survey["crs_shift"] == survey["shift"]
    covariance = np.reshape(survey["covariance"], (3, 3))
    assert survey["shift_sigma"] == pytest.approx(np.sqrt(np.diag(covariance))[:2])
    assert survey["turn_sigma_degrees"] == pytest.approx(math.degrees(math.sqrt(covariance[2, 2])))
    # All trees are inliers, so their middle is that of the fit, and the errors there are independent.
    assert abs(covariance[0, 2]) < 1e-6 * math.sqrt(covariance[0, 0] * covariance[2, 2])
    assert max(survey["shift_sigma"]) < 0.1


def test_the_origin_of_a_frame_is_in_the_shift_of_its_system(client: httpx.Client) -> None:
    client.patch(PLOTS, json={"crs": "EPSG:25832", "origin": FAR.tolist()}).raise_for_status()
    trees = forest(1)
    pose = {"x": 0.0, "y": 0.0, "yaw": 0.0, "covariance": [0.0] * 9}
    client.put(f"{PLOTS}/submaps/p", json={"xy": points(trees), "map_pose": pose}).raise_for_status()
    survey = ask(client, xy=points(displaced(trees + FAR)))["candidates"][0]["survey"]
    assert survey["crs_position"] == pytest.approx(trees.mean(axis=0) + FAR, abs=1e-6)
    # Surveyed in the system, so the shift there is small; the one to the frame holds its origin.
    assert survey["crs_shift"] == pytest.approx(SHIFT, abs=1e-6)
    assert survey["shift"] == pytest.approx(SHIFT - FAR, abs=1e-6)


def test_a_frame_without_a_system_has_x_and_y(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, map_pose={"frame_id": "site", "x": 100.0, "y": 0.0, "yaw": 0.7})
    seen, _ = observed(forest(1), 2, sigma=0.01)
    candidate = ask(client, xy=seen)["candidates"][0]
    survey, placed = candidate["survey"], candidate["map_pose"]
    assert (survey["frame_id"], survey["crs"], survey["axes"]) == ("site", None, ["x", "y"])
    assert survey["position"] == pytest.approx(
        SE2(placed["x"], placed["y"], placed["yaw"]).apply(np.mean([seen], 1))[0]
    )
    assert survey["turn_degrees"] == pytest.approx(math.degrees(math.remainder(placed["yaw"], math.tau)))
    assert (survey["covariance"], survey["shift_sigma"], survey["turn_sigma_degrees"]) == (None, None, None)


def test_a_submap_without_a_map_pose_has_the_pose_in_its_own_frame(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1)
    seen, submap_T_query = observed(forest(1), 2, sigma=0.01)
    survey = ask(client, xy=seen)["candidates"][0]["survey"]
    assert (survey["frame_id"], survey["covariance_frame"]) == (None, "submap")
    assert survey["position"] == pytest.approx(submap_T_query.apply(np.mean([seen], axis=1))[0], abs=0.02)
    assert survey["covariance"] is not None


def test_rounding_does_not_grow_with_the_distance_to_the_origin() -> None:
    trees = forest(1)
    near = SE2(0.0, 0.0, TURN)
    far = SE2.shift(FAR + SHIFT) @ near @ SE2.shift(-FAR)
    fitted = least_squares(trees, near, 1e-4)
    moved = PoseUncertainty(fitted.source + FAR, fitted.target + FAR + SHIFT, fitted.covariance, fitted.information)
    point = trees[:7].mean(axis=0)
    expected = near.apply(point[None])[0] - point + SHIFT
    np.testing.assert_allclose(moved.shift_of(far, point + FAR), expected, atol=4e-9)
    np.testing.assert_allclose(moved.position_of(far, point + FAR) - FAR, point + expected, atol=4e-9)
    np.testing.assert_allclose(
        moved.covariance_about(far, point + FAR), fitted.covariance_about(near, point), rtol=1e-7, atol=1e-15
    )
