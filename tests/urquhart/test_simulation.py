import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart.evaluation.simulation import Sensor, bridson, observe, paper_forest, plantation
from urquhart.se2 import SE2


def nearest_neighbour(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cKDTree(points).query(points, 2)[0])[:, 1]


def test_poisson_discs_keep_their_distance_and_fill_the_area() -> None:
    points = bridson(200.0, 100.0, 7.0, np.random.default_rng(0))
    nearest = nearest_neighbour(points)
    assert nearest.min() >= 7.0
    assert ((points >= 0.0) & (points < [200.0, 100.0])).all()
    # Nowhere is there room for one more: the sample is maximal up to its thirty attempts.
    probe = np.random.default_rng(1).uniform([0.0, 0.0], [200.0, 100.0], (4000, 2))
    assert np.mean(cKDTree(points).query(probe)[0] > 9.0) < 0.01
    assert len(points) == pytest.approx(0.7 * 200 * 100 / 7.0**2, rel=0.1)


def test_the_paper_forest_has_its_density() -> None:
    trees = paper_forest(np.random.default_rng(0), side=600.0)
    seen = [
        len(observe(trees, SE2(x, 300.0, 0.0), Sensor(50.0), np.random.default_rng(0)).xy) for x in range(100, 500, 50)
    ]
    assert 90 < np.mean(seen) < 110


def test_observations_are_the_forest_in_the_sensor_frame() -> None:
    rng = np.random.default_rng(2)
    trees = rng.uniform(0.0, 100.0, (300, 2))
    pose = SE2(50.0, 40.0, 0.8)
    plain = observe(trees, pose, Sensor(30.0), rng)
    np.testing.assert_allclose(pose.apply(plain.xy), trees[plain.trees], atol=1e-9)
    assert set(plain.trees.tolist()) == set(np.flatnonzero(np.hypot(*(trees - [50.0, 40.0]).T) <= 30.0).tolist())


def test_noise_detection_and_clutter_are_what_they_say() -> None:
    rng = np.random.default_rng(3)
    trees = rng.uniform(0.0, 400.0, (20_000, 2))
    pose = SE2(200.0, 200.0, 2.0)
    seen = observe(trees, pose, Sensor(150.0, sigma=0.2, detection=0.8, clutter=0.3), rng)
    real = seen.trees >= 0
    in_range = int((np.hypot(*(trees - 200.0).T) <= 150.0).sum())
    assert real.sum() == pytest.approx(0.8 * in_range, rel=0.03)
    assert (~real).sum() == pytest.approx(0.3 * real.sum(), abs=1)
    residual = pose.apply(seen.xy[real]) - trees[seen.trees[real]]
    np.testing.assert_allclose(residual.std(axis=0), 0.2, rtol=0.05)
    assert np.hypot(*seen.xy[~real].T).max() <= 150.0


def test_plantations_are_rows() -> None:
    trees = plantation(90.0, 60.0, np.random.default_rng(4), spacing=(3.0, 2.0), jitter=0.0, survival=1.0)
    assert len(trees) == 30 * 30
    assert nearest_neighbour(trees).max() == pytest.approx(2.0)
    thinned = plantation(90.0, 60.0, np.random.default_rng(4), spacing=(3.0, 2.0), jitter=0.3, survival=0.8)
    assert len(thinned) == pytest.approx(720, rel=0.08)


def test_randomness_is_only_what_is_passed_in() -> None:
    a, b = (paper_forest(np.random.default_rng(5), side=100.0) for _ in range(2))
    np.testing.assert_array_equal(a, b)
