"""Quads are all pairs of Delaunay triangles with a common edge, but for slivers, and outlive other trees."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from tests.urquhart import forests
from urquhart import Config, Features, describe
from urquhart.features.quads import quads_of

Shapes = set[tuple[frozenset[int], frozenset[int]]]
"""Quads by their shared edge and their four landmarks."""


def shapes(quads: NDArray[np.int32]) -> Shapes:
    return {(frozenset((a, c)), frozenset((a, b, c, d))) for a, b, c, d in quads.tolist()}


def by_pairs(landmarks: NDArray[np.float64], triangles: list[list[int]]) -> Shapes:
    """The same from every pair of triangles, but for those with a side of more than four median ones."""
    sides = [[float(np.linalg.norm(landmarks[t[k]] - landmarks[t[k - 1]])) for k in range(3)] for t in triangles]
    limit = 4.0 * float(np.median(sides))
    kept = [frozenset(t) for t, lengths in zip(triangles, sides, strict=True) if max(lengths) <= limit]
    return {(a & b, a | b) for a, b in combinations(kept, 2) if len(a & b) == 2}


def described(seed: int, count: int = 60) -> Features:
    return describe(forests.uniform(np.random.default_rng(seed), count, 60.0), Config())


@pytest.mark.parametrize("make", [forests.uniform, forests.clustered, forests.grid, forests.ring])
def test_they_are_all_pairs_of_triangles_with_a_common_edge(
    make: Callable[[np.random.Generator], forests.Points],
) -> None:
    for seed in range(8):
        features = describe(make(np.random.default_rng(seed)), Config())
        quads = features.tessellation.quads
        found = shapes(quads)
        assert len(found) == len(quads) > 0
        assert found == by_pairs(features.landmarks, features.tessellation.triangles.tolist())


@pytest.mark.parametrize("seed", range(8))
def test_a_quad_runs_counter_clockwise_from_an_end_of_the_shared_edge(seed: int) -> None:
    features = described(seed)
    triangles = {frozenset(t) for t in Delaunay(features.landmarks).simplices.tolist()}
    for quad in features.tessellation.quads:
        x, y = features.landmarks[quad].T
        assert np.dot(x, np.roll(y, -1)) > np.dot(y, np.roll(x, -1))
        a, b, c, d = quad.tolist()
        assert {frozenset((a, b, c)), frozenset((a, c, d))} <= triangles


@pytest.mark.parametrize("seed", range(8))
def test_a_quad_outlives_every_landmark_that_is_not_its_own(seed: int) -> None:
    features = described(seed)
    triangles = features.tessellation.triangles.tolist()
    gone = int(np.random.default_rng(seed).integers(60))
    kept = np.delete(np.arange(60), gone)
    left = describe(features.landmarks[kept], Config())
    lengths = [np.linalg.norm(left.landmarks[t] - left.landmarks[np.roll(t, 1)], axis=1) for t in
               left.tessellation.triangles]  # fmt: skip
    limit = 4.0 * np.median(lengths)
    still = {(frozenset(kept[list(e)]), frozenset(kept[list(q)])) for e, q in shapes(left.tessellation.quads)}
    assert by_pairs(features.landmarks, triangles) == shapes(features.tessellation.quads)
    lost = {(edge, quad) for edge, quad in shapes(features.tessellation.quads) - still if gone not in quad}
    # But for what is a sliver by now: the median side is another.
    for edge, quad in lost:
        sides = [np.linalg.norm(features.landmarks[i] - features.landmarks[j]) for i, j in combinations(quad, 2)]
        assert max(sides) > limit, (edge, quad)
    assert len(lost) < 5 < len(still)


def test_slivers_along_the_hull_are_left_out() -> None:
    """A far tree makes triangles with sides of many times the usual."""
    landmarks = np.concatenate([forests.uniform(np.random.default_rng(0), 40, 40.0), [[400.0, 20.0]]])
    quads = describe(landmarks, Config()).tessellation.quads
    assert len(quads) > 20
    assert 40 not in quads


def test_too_few_triangles_make_none() -> None:
    triangle, none = np.array([[0, 1, 2]], np.int32), np.full((1, 3), -1, np.int32)
    landmarks = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [5.0, 5.0]])
    assert quads_of(landmarks, triangle, none).shape == (0, 4)
    two = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    [quad] = quads_of(landmarks, two, np.array([[1, -1, -1], [-1, 0, -1]], np.int32)).tolist()
    assert quad == [1, 3, 2, 0]
