"""Covariances and information hold what repeated measurement shows, wherever the origin lies."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty, compose, least_squares, positive
from urquhart.se2 import fit

TREES = np.random.default_rng(0).uniform(-25.0, 25.0, (50, 2)) * (1.0, 0.6)
ROWS = np.arange(len(TREES))
SIGMA = 0.1
FAR = {"at the trees": 0.0, "50 m": 50.0, "300 m": 300.0, "20 km": 20_000.0, "UTM": 5_000_000.0}


def measured(offset: float, count: int) -> tuple[NDArray[np.float64], SE2, list[SE2]]:
    """Trees `offset` metres from their frame's origin, the true transform, and what repeated measurement finds."""
    rng = np.random.default_rng(3)
    trees = TREES + np.array([0.6, -0.8]) * offset
    truth = SE2.shift(np.array([-0.28, 0.96]) * offset) @ SE2(4.0, -7.0, 1.1) @ SE2.shift(-trees.mean(axis=0))
    exact, middle = truth.apply(trees), trees.mean(axis=0)
    found = []
    for _ in range(count):
        seen = exact + rng.normal(0.0, SIGMA, trees.shape)
        away = seen.mean(axis=0)
        near = SE2(*fit(trees - middle, seen - away, ROWS, ROWS))
        found.append(SE2.shift(away) @ near @ SE2.shift(-middle))
    return trees, truth, found


def tangent(error: SE2) -> NDArray[np.float64]:
    """log of a transform (3,), as GTSAM has it."""
    half = 0.5 * error.yaw
    stretch = half / math.tan(half) if abs(half) > 1e-12 else 1.0
    return np.array([stretch * error.x + half * error.y, -half * error.x + stretch * error.y, error.yaw])


@pytest.mark.parametrize("offset", FAR.values(), ids=FAR.keys())
def test_the_information_weighs_an_error_right_from_any_origin(offset: float) -> None:
    """Squared errors in the frame that an edge leads to, weighed by the information, are three on average (NEES)."""
    trees, truth, found = measured(offset, 2000)
    squared = []
    for one in found:
        information = least_squares(trees, one, SIGMA**2).source_information(one)
        off = tangent(one.inverse() @ truth)
        squared.append(float(off @ information @ off))
    assert 2.8 < np.mean(squared) < 3.2
    # A gate of 99 % keeps 99 %.
    assert 0.98 < np.mean(np.array(squared) < 11.34) < 0.998


@pytest.mark.parametrize("offset", FAR.values(), ids=FAR.keys())
def test_the_covariance_about_the_trees_can_be_inverted_at_any_origin(offset: float) -> None:
    trees, truth, found = measured(offset, 2000)
    squared, turns = [], []
    for one in found:
        sure = least_squares(trees, one, SIGMA**2)
        off = np.append(sure.target - truth.apply(sure.source[None])[0], one.yaw - truth.yaw)
        squared.append(float(off @ np.linalg.inv(sure.covariance) @ off))
        turns.append(off[2] ** 2 / sure.covariance[2, 2])
        np.testing.assert_allclose(sure.covariance @ sure.information, np.eye(3), atol=1e-9)
    assert 2.8 < np.mean(squared) < 3.2
    assert 0.9 < np.mean(turns) < 1.1


@pytest.mark.parametrize("offset", FAR.values(), ids=FAR.keys())
def test_the_covariance_about_the_origin_is_what_repeated_measurement_shows(offset: float) -> None:
    """Also where the second order of the turn is what counts: 5,000 km away it is metres."""
    trees, truth, found = measured(offset, 4000)
    off = np.array([(one.x - truth.x, one.y - truth.y, one.yaw - truth.yaw) for one in found])
    covariance = least_squares(trees, truth, SIGMA**2).origin_covariance(truth)
    shown = off.T @ off / len(off)
    scale = np.sqrt(np.diag(shown))
    np.testing.assert_allclose(covariance / np.outer(scale, scale), shown / np.outer(scale, scale), atol=0.12)
    arm = truth.apply(trees.mean(axis=0)[None])[0] - (truth.x, truth.y)
    if offset:
        along = np.append(arm / math.hypot(*arm), 0.0)
        assert along @ covariance @ along == pytest.approx(along @ shown @ along, rel=0.35)
    assert np.linalg.eigvalsh(covariance)[0] >= 0.0


def test_an_origin_is_far_where_its_covariance_is_of_little_use() -> None:
    far = {
        name: least_squares(*measured(offset, 0)[:2], SIGMA**2).is_far(measured(offset, 0)[1])
        for name, offset in FAR.items()
    }
    assert far == {"at the trees": False, "50 m": False, "300 m": False, "20 km": True, "UTM": True}


@pytest.mark.parametrize("offset", [0.0, 300.0, 20_000.0])
def test_composed_errors_are_what_repeated_measurement_shows(offset: float) -> None:
    rng = np.random.default_rng(5)
    trees, b_T_c, found = measured(offset, 4000)
    a_T_b = SE2(30.0, -20.0, 0.7)
    root = rng.normal(size=(3, 3)) * (0.2, 0.2, 1e-3)
    covariance = root.T @ root
    composed = compose(a_T_b, covariance, b_T_c, least_squares(trees, b_T_c, SIGMA**2))
    truth, middle = a_T_b @ b_T_c, trees.mean(axis=0)[None]
    off = []
    for one, (x, y, yaw) in zip(found, rng.multivariate_normal(np.zeros(3), covariance, len(found)), strict=True):
        pose = SE2(a_T_b.x + x, a_T_b.y + y, a_T_b.yaw + yaw) @ one
        off.append([*(pose.apply(middle) - truth.apply(middle))[0], pose.yaw - truth.yaw])
    shown = np.cov(np.array(off).T)
    scale = np.sqrt(np.diag(shown))
    np.testing.assert_allclose(composed.covariance / np.outer(scale, scale), shown / np.outer(scale, scale), atol=0.1)
    np.testing.assert_allclose(composed.target, truth.apply(middle)[0], atol=1e-6)


entries = st.floats(-1e8, 1e8).map(lambda value: value if abs(value) > 1e-12 else 0.0)


@given(st.lists(entries, min_size=9, max_size=9), st.floats(-1e8, 1e8), st.floats(-7.0, 7.0))
def test_no_answer_has_a_negative_eigenvalue(values: list[float], away: float, yaw: float) -> None:
    """Whatever was stored as the covariance of a submap's pose."""
    given_covariance = np.reshape(values, (3, 3))
    sure = least_squares(TREES + away, SE2(away, -away, yaw), 0.01)
    composed = compose(SE2(away, away, yaw), given_covariance, SE2(away, -away, yaw), sure)
    assert np.linalg.eigvalsh(positive(given_covariance))[0] >= 0.0
    for matrix in (composed.covariance, composed.origin_covariance(SE2(away, -away, yaw)), sure.covariance):
        assert np.isfinite(matrix).all()
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] >= 0.0


def test_two_trees_are_enough() -> None:
    sure = least_squares(np.array([[0.0, 0.0], [4.0, 0.0]]), SE2(1.0, 2.0, 0.5), 0.01)
    np.testing.assert_allclose(np.diag(sure.covariance), [0.005, 0.005, 0.01 / 8.0])
    same: PoseUncertainty = least_squares(np.zeros((2, 2)), SE2(1.0, 2.0, 0.5), 0.01)
    assert np.isfinite(same.information).all()
