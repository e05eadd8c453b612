import numpy as np
import pytest

from urquhart.paper.ransac import PointPairs, ransac
from urquhart.se2 import SE2

TRUTH = SE2(14.0, -6.0, 2.4)


def correspondences(inliers: int, outliers: int, seed: int = 0, noise: float = 0.05):  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(seed)
    source = rng.uniform(-40.0, 40.0, (inliers + outliers, 2))
    target = TRUTH.apply(source) + rng.normal(0.0, noise, source.shape)
    target[inliers:] = rng.uniform(-40.0, 40.0, (outliers, 2))
    return source, target


@pytest.mark.parametrize("seed", range(5))
def test_finds_the_transform_among_outliers(seed: int) -> None:
    source, target = correspondences(20, 60, seed)
    found = ransac(PointPairs(source, target), np.random.default_rng(seed))
    assert found is not None
    shift, turn = found.transform.distance(TRUTH)
    assert shift < 0.15
    assert turn < 0.01
    assert found.inliers[:20].all()
    assert found.inliers[20:].sum() <= 3


def test_stops_as_soon_as_nearly_all_agree() -> None:
    source, target = correspondences(50, 0)
    found = ransac(PointPairs(source, target), np.random.default_rng(0))
    assert found is not None
    assert found.iterations < 20


def test_tries_every_pair_once_where_there_are_few_and_draws_where_there_are_many() -> None:
    source, target = correspondences(0, 20)
    every = ransac(PointPairs(source, target), np.random.default_rng(0), iterations=40_000)
    assert every is not None
    assert every.iterations == 190
    drawn = ransac(PointPairs(source, target), np.random.default_rng(0), iterations=100)
    assert drawn is not None
    assert drawn.iterations == 100


def test_drawing_from_many_finds_it_too() -> None:
    source, target = correspondences(120, 200, 3)
    found = ransac(PointPairs(source, target), np.random.default_rng(1), iterations=2_000)
    assert found is not None
    assert found.transform.distance(TRUTH)[0] < 0.1


def test_the_same_seed_gives_the_same_bytes() -> None:
    source, target = correspondences(30, 60, 2)
    a, b = (ransac(PointPairs(source, target), np.random.default_rng(9), iterations=500) for _ in range(2))
    assert a is not None
    assert b is not None
    assert (a.transform, a.inliers.tobytes(), a.iterations) == (b.transform, b.inliers.tobytes(), b.iterations)


def test_too_little_to_fix_a_transform() -> None:
    one = np.zeros((1, 2))
    assert ransac(PointPairs(one, one), np.random.default_rng(0)) is None
    near, far = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 0.0], [9.0, 0.0]])
    assert ransac(PointPairs(near, far), np.random.default_rng(0)) is None
