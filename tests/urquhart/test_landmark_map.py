import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart.graphs import TrueGraph, drive
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, SimulatedObservation, observe, paper_forest
from urquhart.mapping.coverage import tree_changes
from urquhart.mapping.landmark_map import Association, LandmarkMap, MappedSubmap, build_landmark_map
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_graph import PoseConstraint, PoseConstraints
from urquhart.pose_covariance import PoseUncertainty

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

Points = NDArray[np.float64]
TIGHT = np.diag([1e-4, 1e-4, 1e-6])


def at(*poses: SE2) -> OptimisedPoses:
    """Submaps at poses that are known to a centimetre, in the frame of the first."""
    steps = [
        PoseConstraint(0, k, pose, PoseUncertainty.about_point(np.zeros(2), pose, TIGHT))
        for k, pose in enumerate(poses)
    ]
    return optimise(len(poses), PoseConstraints.of(steps[1:]))


STILL = at(SE2.identity(), SE2.identity(), SE2.identity())


def clearing(*more: tuple[float, float]) -> Points:
    """Eight trees about the origin, 10 m away, and some more."""
    angle = np.arange(8) * np.pi / 4.0
    return np.concatenate([10.0 * np.column_stack([np.cos(angle), np.sin(angle)]), np.reshape(more, (-1, 2))])


def seen_along(graph: TrueGraph, rng: np.random.Generator, sensor: Sensor) -> tuple[Points, list[SimulatedObservation]]:
    trees = paper_forest(rng, 260.0) - 130.0
    return trees, [observe(trees, SE2(*pose), sensor, rng) for pose in graph.truth.tolist()]


def trees_of(built: LandmarkMap, seen: list[SimulatedObservation]) -> list[NDArray[np.int64]]:
    """The true trees of the landmarks of each entry."""
    pairs = zip(built.submaps.tolist(), built.indices.tolist(), strict=True)
    return np.split(np.array([seen[s].trees[i] for s, i in pairs]), built.offsets[1:-1])


@pytest.mark.parametrize("association", ["joint", "dbscan"])
def test_one_entry_for_each_tree_of_a_drive(association: Association) -> None:
    errors, figures = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        graph = drive(rng, 90, 0.1)
        trees, seen = seen_along(graph, rng, Sensor(25.0, sigma=0.1, detection=0.9))
        built = build_landmark_map([MappedSubmap(one.xy) for one in seen], optimise(90, graph.constraints), association)
        entries = trees_of(built, seen)
        pure = np.array([len(set(entry.tolist())) == 1 for entry in entries])
        there = len(np.unique(np.concatenate([one.trees for one in seen])))
        assert pure.mean() > 0.98
        # A chain of landmarks within 0.5 m of each other does not know that a whole submap is off.
        assert len(built) == pytest.approx(there, rel=0.015 if association == "joint" else 0.15)
        assert built.noise == pytest.approx(0.1, abs=0.02)
        first = np.array([entry[0] for entry in entries])
        off = built.xy - SE2(*graph.truth[0].tolist()).inverse().apply(trees[first])
        errors.append(np.hypot(*off[pure].T).mean())
        nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(built.covariances), off)
        figures.append(nees[pure & (built.counts > 1)].mean())
    assert np.mean(errors) < 0.6
    assert 1.0 < np.mean(figures) < 4.0  # 2 on average; the trees of one drive share the error of its poses


def test_the_trees_of_a_submap_never_become_one() -> None:
    """A coppice stool of three stems 0.3 m apart, with noise of 0.08 m, seen from twelve places."""
    rng = np.random.default_rng(0)
    stool = clearing((0.0, 0.0), (0.3, 0.0), (0.15, 0.26))
    submaps = [MappedSubmap(stool + rng.normal(0.0, 0.08, stool.shape)) for _ in range(12)]
    built = build_landmark_map(submaps, at(*[SE2.identity()] * 12))
    assert len(built) == 11
    assert built.counts.tolist() == [12] * 11
    assert not built.missed.any()
    assert built.xy == pytest.approx(stool, abs=0.1)


def test_a_submap_is_associated_as_a_whole() -> None:
    """The second submap is 0.5 m off, within the uncertainty of its pose, in a stand with trees 0.8 m apart."""
    rows = np.column_stack([grid.ravel() for grid in np.meshgrid(np.arange(0.0, 12.0, 0.8), np.arange(0.0, 9.0, 3.0))])
    rows += np.random.default_rng(1).normal(0.0, 0.15, rows.shape)
    wide = PoseUncertainty.about_point(rows.mean(axis=0), SE2.identity(), np.diag([0.16, 0.16, 1e-6]))
    poses = optimise(2, PoseConstraints.of([PoseConstraint(0, 1, SE2.identity(), wide)]))
    built = build_landmark_map([MappedSubmap(rows), MappedSubmap(rows - [0.35, 0.1])], poses)
    assert (np.diff(built.offsets) == 2).all()
    assert all(len(set(built.members(tree)[1].tolist())) == 1 for tree in range(len(built)))


def test_diameters_heights_and_stamps_are_fused() -> None:
    xy = clearing()
    known = [np.full(8, value) for value in (30.0, 31.0, 95.0)]
    known[0][0] = np.nan
    submaps = [
        MappedSubmap(xy, known[0], stamp=200.0),
        MappedSubmap(xy, known[1], np.full(8, 20.0), stamp=100.0),
        MappedSubmap(xy, known[2]),
    ]
    built = build_landmark_map(submaps, STILL)
    assert built.diameters[1:] == pytest.approx(31.0)  # the median: one wrong value does not matter
    assert built.diameters[0] == pytest.approx(63.0)
    assert built.diameter_sigmas[1] == pytest.approx(1.4826 * np.sqrt(np.pi / 6.0))
    assert built.heights == pytest.approx(20.0) and np.isnan(built.height_sigmas).all()
    assert set(built.first_seen) == {100.0} and set(built.last_seen) == {200.0}


def test_unknown_diameters_and_stamps_stay_unknown() -> None:
    built = build_landmark_map([MappedSubmap(clearing())] * 3, STILL)
    for column in (built.diameters, built.diameter_sigmas, built.heights, built.first_seen, built.last_seen):
        assert np.isnan(column).all()


def test_a_missed_tree_is_one_with_other_trees_all_around_it() -> None:
    built = build_landmark_map(
        [MappedSubmap(clearing((0.0, 0.0), (30.0, 0.0))), MappedSubmap(clearing()), MappedSubmap(clearing())], STILL
    )
    assert built.missed.tolist() == [0] * 8 + [2, 0]
    assert built.misses.tolist() == [[8, 1], [8, 2]]


def test_parts_are_not_merged() -> None:
    built = build_landmark_map(
        [MappedSubmap(clearing()), MappedSubmap(clearing())], optimise(2, PoseConstraints.of([]))
    )
    assert len(built) == 2 * len(clearing())
    assert built.part.tolist() == [0] * 8 + [1] * 8


@pytest.mark.parametrize("submaps", [[], [np.empty((0, 2))], [np.array([[1.0, 2.0]])]])
def test_few_trees_or_none(submaps: list[Points]) -> None:
    poses = optimise(len(submaps), PoseConstraints.of([]))
    built = build_landmark_map([MappedSubmap(xy) for xy in submaps], poses)
    assert len(built) == sum(map(len, submaps)) == len(built.covariances)


def test_what_cannot_be_mapped_is_refused() -> None:
    with pytest.raises(ValueError, match="2 submaps but 3 poses"):
        build_landmark_map([MappedSubmap(clearing())] * 2, STILL)
    with pytest.raises(ValueError, match="finite"):
        build_landmark_map([MappedSubmap(clearing((np.nan, 0.0)))] * 3, STILL)


def test_trees_that_came_and_went() -> None:
    old, young = (0.0, 0.0), (4.0, 1.0)
    views = [clearing(old)] * 3 + [clearing(young)] * 3
    submaps = [MappedSubmap(xy, stamp=float(day)) for day, xy in enumerate(views)]
    built = build_landmark_map(submaps, at(*[SE2.identity()] * 6))
    observed = np.column_stack([np.repeat(np.arange(len(built)), built.counts), built.submaps])
    found = tree_changes(observed, built.misses, np.arange(6.0), 3.0)
    assert built.xy[found.gone] == pytest.approx(np.array([old]))
    assert built.xy[found.new] == pytest.approx(np.array([young]))
    assert (found.kept, found.undecided, found.detection) == (8, 0, 1.0)
    # Nobody was there again: nothing is known of any change.
    later = tree_changes(observed, built.misses, np.arange(6.0), 10.0)
    assert not len(later.gone) and not len(later.new) and later.undecided == 10
