"""Footprints: where a landmark that is missing speaks against a pose, and where nobody need have looked."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart import forests
from urquhart import SE2, Config, describe
from urquhart.evaluation.simulation import paper_forest
from urquhart.verify.evidence import evidence_of_pose
from urquhart.verify.landmark_grid import LandmarkGrid, is_inside, landmark_grid

REACH = 0.75
FOREST = paper_forest(np.random.default_rng(3), 220.0)
MIDDLE = np.array([110.0, 110.0])


def laid(trees: NDArray[np.float64]) -> tuple[LandmarkGrid, SE2]:
    """A pattern of trees (N, 2), metres, map frame, and `map_T_pattern`."""
    features = describe(trees, Config())
    return landmark_grid(features, REACH), SE2.shift(features.origin)


def holds(grid: LandmarkGrid, frame: SE2, x: float, y: float) -> bool:
    """Whether the footprint holds a point of the map."""
    return bool(is_inside(grid, *frame.inverse().apply(np.array([[x, y]]))[0].tolist()))


def covering_all(grid: LandmarkGrid) -> LandmarkGrid:
    """The same with all of the hull for a footprint."""
    return grid._replace(cover=np.ones_like(grid.cover))


def corridor() -> NDArray[np.float64]:
    """What a robot sees that drives north and then east, 10 m to each side."""
    x, y = (FOREST - MIDDLE).T
    first, second = (np.abs(x + 45.0) < 10.0) & (np.abs(y) < 55.0), (np.abs(y - 45.0) < 10.0) & (np.abs(x) < 55.0)
    track: NDArray[np.float64] = FOREST[first | second]
    return track


def test_the_bend_of_a_corridor_is_in_its_hull_and_not_in_its_footprint() -> None:
    footprint, frame = laid(corridor())
    assert holds(covering_all(footprint), frame, *(MIDDLE + [-20.0, 20.0]).tolist())
    for x, y in ((-20.0, 20.0), (-10.0, 10.0)):
        assert not holds(footprint, frame, 110.0 + x, 110.0 + y)
    for x, y in ((115.0, 105.0), (-1e4, 110.0), (110.0, 1e6), (219.0, 1.0)):
        assert not holds(footprint, frame, x, y)
    # Along the track and a little beside every landmark it was looked.
    for at in np.linspace(-40.0, 40.0, 17).tolist():
        assert holds(footprint, frame, 65.0, 110.0 + at)
        assert holds(footprint, frame, 110.0 + at, 155.0)


def test_a_corridor_seen_against_a_disc_gains_by_what_nobody_saw() -> None:
    """Trees of the bend were seen by one side only: within the hull alone they would speak against the pose."""
    track, frame = laid(corridor())
    disc, disc_frame = laid(FOREST[np.hypot(*(FOREST - MIDDLE).T) < 80.0])
    for query, submap, pose in (
        (track, disc, disc_frame.inverse() @ frame),
        (disc, track, frame.inverse() @ disc_frame),
    ):
        near = evidence_of_pose(query, submap, pose, REACH)
        hull = evidence_of_pose(covering_all(query), covering_all(submap), pose, REACH)
        np.testing.assert_array_equal(near.query, hull.query)
        assert near.evidence > hull.evidence + 10.0
        assert near.overlap < hull.overlap - 10


def test_a_lake_is_no_part_of_the_footprint_and_its_shore_is() -> None:
    shore = 25.0
    footprint, frame = laid(FOREST[(np.hypot(*(FOREST - MIDDLE).T) > shore) & (np.hypot(*(FOREST - MIDDLE).T) < 70.0)])
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    for radius, there in ((0.0, False), (0.4 * shore, False), (shore + 8.0, True), (0.8 * 70.0, True)):
        found = [
            holds(footprint, frame, *(MIDDLE + radius * np.array([np.cos(a), np.sin(a)])).tolist()) for a in around
        ]
        assert found == [there] * len(around)
    assert holds(covering_all(footprint), frame, *MIDDLE.tolist())


@pytest.mark.parametrize("kind", ["uniform", "clustered", "grid", "lattice", "avenue", "ring", "small"])
def test_landmarks_inside_the_hull_are_in_the_footprint_and_nothing_far_away_is(kind: str) -> None:
    for name, points in forests.all_kinds(seed=2, each=4):
        if name != kind:
            continue
        grid, _ = laid(points)
        middle = grid.landmarks.mean(axis=0)
        drawn = middle + 0.999 * (grid.landmarks - middle)
        assert all(is_inside(grid, *point) for point in drawn.tolist())
        far = 10.0 * np.abs(grid.landmarks).max() + 10.0
        assert not any(is_inside(grid, x, y) for x in (-far, 0.0, far) for y in (-far, far))


def test_the_edge_of_the_hull_is_in_the_footprint_and_what_is_just_beyond_is_not() -> None:
    xs, ys = np.meshgrid(np.arange(5.0), np.arange(4.0))
    footprint, frame = laid(np.column_stack([xs.ravel(), ys.ravel()]))
    assert holds(footprint, frame, 2.0, 1.0)
    assert holds(footprint, frame, 3.999, 2.999)
    assert not holds(footprint, frame, 4.1, 1.0)
    assert not holds(footprint, frame, -0.1, -0.1)


def test_the_footprint_does_not_depend_on_the_order_of_landmarks() -> None:
    trees = corridor()
    one, frame = laid(trees)
    other, other_frame = laid(trees[np.random.default_rng(0).permutation(len(trees))])
    np.testing.assert_array_equal(one.cover, other.cover)
    assert frame.distance(other_frame)[0] < 1e-9
