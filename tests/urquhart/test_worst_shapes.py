"""Shapes that cost most: everything still holds, and no cost grows out of bounds."""

import time

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from benchmarks.reliability.worst_shapes import SHAPES
from urquhart import SE2, Config, Features, Recognizer, describe
from urquhart.evaluation.simulation import paper_forest
from urquhart.features.delaunay import triangulate
from urquhart.verify.cell_sorting import CROWD
from urquhart.verify.landmark_grid import is_inside, landmark_grid, nearest

CONFIG = Config()
REACH = 0.75


def of(shape: str, count: int) -> Features:
    return describe(SHAPES[shape](count, np.random.default_rng(0)), CONFIG)


def seconds(xy: NDArray[np.float64]) -> float:
    """Processor time of describing, the least of two."""
    took = []
    for _ in range(2):
        began = time.process_time()
        describe(xy, CONFIG)
        took.append(time.process_time() - began)
    return min(took)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_described_about_as_fast_as_a_natural_one(shape: str) -> None:
    """Where many landmarks lie on one circle or on one line, an exact triangulation takes 50 times as long."""
    count, rng = 6_000, np.random.default_rng(0)
    assert seconds(SHAPES[shape](count, rng)) < 15.0 * seconds(SHAPES["natural"](count, rng))


@pytest.mark.parametrize("count", [300, 2_000])
@pytest.mark.parametrize("shape", SHAPES)
def test_triangles_fit_together_whatever_the_shape(shape: str, count: int) -> None:
    features = of(shape, count)
    triangles, neighbours = triangulate(features.landmarks)
    sides = {(t[k], t[(k + 1) % 3]) for t in triangles.tolist() for k in range(3)}
    # No side is walked twice in one direction: all triangles are the same way round.
    assert len(sides) == 3 * len(triangles)
    assert {(a, b) for a, b in sides if (b, a) not in sides} == {
        (t[(k + 1) % 3], t[(k + 2) % 3])
        for t, beside in zip(triangles.tolist(), neighbours.tolist(), strict=True)
        for k in range(3)
        if beside[k] < 0
    }
    hull = features.tessellation.hull.tolist()
    assert len(set(hull)) == len(hull)
    for i in range(len(features.tessellation)):
        polygon = features.tessellation.polygon(i).tolist()
        assert len(set(polygon)) == len(polygon) >= 3
    assert np.isfinite(features.density).all()
    assert (features.density > 0.0).all()


def test_of_many_landmarks_those_of_a_forest_have_the_exact_triangles() -> None:
    trees = paper_forest(np.random.default_rng(1), 350.0)
    trees -= trees.mean(axis=0)
    assert len(trees) > 1_000
    exact = {tuple(sorted(t)) for t in Delaunay(trees).simplices.tolist()}
    assert {tuple(sorted(t)) for t in triangulate(trees)[0].tolist()} == exact


@pytest.mark.parametrize("shape", SHAPES)
def test_the_nearest_landmark_is_found_in_crowded_cells_too(shape: str) -> None:
    features, rng = of(shape, 1_500), np.random.default_rng(1)
    laid = landmark_grid(features, REACH)
    if shape == "one stray at 10,000 km":
        assert np.diff(laid.cell_starts).max() > 10 * CROWD
    for x, y in features.landmarks[rng.integers(0, 1_500, 60)] + rng.normal(0.0, 0.5, (60, 2)):
        squared = ((features.landmarks - (x, y)) ** 2).sum(axis=1)
        found, distance = nearest(laid, x, y, 2.0 * REACH)
        if squared.min() > (2.0 * REACH) ** 2:
            assert found < 0
        else:
            assert distance == squared[found] == squared.min()


@pytest.mark.parametrize("corners", [20, 63, 64, 65, 66, 500])
def test_a_footprint_with_many_corners_holds_what_lies_within_all_of_them(corners: int) -> None:
    rng = np.random.default_rng(corners)
    features = of("circle", corners)
    footprint = landmark_grid(features, REACH)
    footprint = footprint._replace(cover=np.ones_like(footprint.cover))
    assert len(footprint.hull) == corners
    following = np.roll(footprint.hull, -1, axis=0)
    radius = float(np.abs(footprint.hull).max())
    for x, y in rng.uniform(-radius, radius, (400, 2)).tolist() + (0.999 * footprint.hull).tolist():
        edge, to = following - footprint.hull, (x, y) - footprint.hull
        assert is_inside(footprint, x, y) == bool((edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0] >= 0.0).all())


@pytest.mark.parametrize("shape", ["natural", "at 100,000 km", "spiral"])
def test_a_large_submap_alone_finds_itself(shape: str) -> None:
    xy = SHAPES[shape](2_500, np.random.default_rng(0))
    recognizer = Recognizer(CONFIG)
    recognizer.add([(0, describe(xy, CONFIG))])
    middle = xy.mean(axis=0)
    found = recognizer.locate(SE2(30.0, 4.0, 2.2).apply(xy - middle))
    assert found.verdict == "matched"
    best = found.candidates[0]
    assert len(best.query_indices) == len(xy)
    assert best.transform.yaw == pytest.approx(-2.2, abs=1e-3)
