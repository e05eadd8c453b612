"""Distortions of one side are told, and undistorted observations hardly ever are."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from urquhart import SE2, Config, Recognizer, describe
from urquhart.decide.candidates import Candidate
from urquhart.pose_covariance import Matrix
from urquhart.se2 import fit
from urquhart.verify.distortion import find_distortion

Shape = Callable[[Matrix], Matrix]


def tilted(xy: Matrix) -> Matrix:
    """As a sensor sees stems at breast height that leans over by 5 degrees to one side, at the origin."""
    lean = np.radians(5.0)
    across, along = np.array([-0.6, 0.8]), np.array([0.8, 0.6])
    shortened = (xy @ along) * np.cos(lean) + 1.3 * np.sin(lean)
    return np.asarray(np.outer(shortened, along) + np.outer(xy @ across, across))


def bent(xy: Matrix) -> Matrix:
    """As gathered along 50 m during which the yaw drifted by 2 degrees."""
    angle = np.radians(2.0) * (xy[:, 0] / 50.0)
    return np.column_stack([xy[:, 0], xy[:, 1] + 0.5 * angle * xy[:, 0]])


def same(xy: Matrix) -> Matrix:
    return xy


def matches(shape: Shape, count: int, sigma: float = 0.05) -> list[tuple[Candidate, SE2]]:
    """What a recognizer finds of distorted observations, each of a forest of its own, and the true submap_T_query."""
    rng, config, found = np.random.default_rng(5), Config(), []
    for _ in range(count):
        trees = rng.uniform(-25.0, 25.0, (70, 2))
        submap = trees + rng.normal(0.0, sigma, trees.shape)
        x, y, yaw = rng.uniform(-3.0, 3.0, 3).tolist()
        pose = SE2(x, y, yaw)
        seen = shape(pose.inverse().apply(trees[rng.random(70) < 0.9]))
        recognizer = Recognizer(config)
        recognizer.add([(0, describe(submap, config))])
        answer = recognizer.locate(seen + rng.normal(0.0, sigma, seen.shape))
        assert answer.verdict == "matched"
        found.append((answer.candidates[0], pose))
    return found


def nees(found: list[tuple[Candidate, SE2]]) -> float:
    """Mean squared error of poses, weighed by their covariances: three where these hold."""
    squared = []
    for best, truth in found:
        sure = best.uncertainty
        off = np.append(
            truth.apply(sure.source[None])[0] - best.transform.apply(sure.source[None])[0],
            (truth.yaw - best.transform.yaw + np.pi) % (2.0 * np.pi) - np.pi,
        )
        squared.append(float(off @ sure.information @ off))
    return float(np.mean(squared))


def test_what_is_not_distorted_is_hardly_ever_called_so() -> None:
    rng, told = np.random.default_rng(1), 0
    for _ in range(3000):
        count = int(rng.integers(8, 120))
        trees, rows = rng.uniform(-25.0, 25.0, (count, 2)), np.arange(count)
        pose = SE2(3.0, -4.0, 0.7)
        seen = pose.apply(trees) + rng.normal(0.0, 0.1, trees.shape)
        told += bool(find_distortion(trees, seen, SE2(*fit(trees, seen, rows, rows))).words)
    assert told <= 0.006 * 3000
    found = matches(same, 150)
    assert sum(bool(best.warnings) for best, _ in found) <= 2
    assert 2.4 < nees(found) < 3.6


@pytest.mark.parametrize(
    ("shape", "word"),
    [(tilted, "tilted"), (lambda xy: 1.01 * xy, "scaled"), (lambda xy: 0.98 * xy, "scaled"), (bent, "bent")],
)
def test_a_distorted_observation_is_told_and_less_is_claimed(shape: Shape, word: str) -> None:
    found = matches(shape, 60)
    words = Counter(warning for best, _ in found for warning in best.warnings)
    assert words[word] >= 0.95 * len(found)
    if word == "tilted":
        assert 1.0 < nees([one for one in found if one[0].warnings]) < 4.0
    if word == "scaled":
        assert words["tilted"] <= 1


def test_nothing_is_told_of_a_few_trees_or_of_exact_ones() -> None:
    trees = np.random.default_rng(0).uniform(-20.0, 20.0, (60, 2))
    pose = SE2(3.0, -4.0, 0.7)
    assert find_distortion(trees, pose.apply(trees), pose).words == ()
    assert find_distortion(trees[:4], pose.apply(1.2 * trees[:4]), pose).words == ()


def test_far_from_the_origin_the_same_is_told() -> None:
    rng = np.random.default_rng(2)
    trees, rows = rng.uniform(-20.0, 20.0, (60, 2)), np.arange(60)
    pose, far = SE2(3.0, -4.0, 0.7), np.array([5e5, 5.8e6])
    seen = pose.apply(1.01 * trees) + rng.normal(0.0, 0.05, trees.shape)
    near = SE2(*fit(trees, seen, rows, rows))
    away = near @ SE2.shift(-far)
    found, there = find_distortion(trees, seen, near), find_distortion(trees + far, seen, away)
    assert found.words == there.words == ("scaled",)
    assert np.sqrt(np.diag(there.covariance))[:2].max() < 1.0


def test_floor_and_scale_of_a_configuration() -> None:
    rng = np.random.default_rng(3)
    trees = rng.uniform(-25.0, 25.0, (70, 2))
    seen = SE2(1.0, 2.0, 0.5).apply(trees + rng.normal(0.0, 0.05, trees.shape))

    def covariance(**chosen: float) -> Matrix:
        recognizer = Recognizer(config := Config(**chosen))  # type: ignore[arg-type]
        recognizer.add([(0, describe(trees, config))])
        return recognizer.locate(seen).candidates[0].uncertainty.covariance

    plain = covariance()
    np.testing.assert_allclose(covariance(covariance_scale=4.0), 4.0 * plain)
    floored = covariance(covariance_floor=0.2, covariance_floor_yaw=0.01)
    np.testing.assert_allclose(floored, plain + np.diag([0.04, 0.04, 1e-4]), atol=1e-12)
