from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart.graphs import LOOP, TrueGraph, drive, measured
from urquhart import SE2
from urquhart.mapping import graph_solver
from urquhart.mapping.consistency import MAPPING
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_arrays import compose, inverse, squared_distances, wrapped
from urquhart.mapping.pose_graph import MAP, PoseConstraint, PoseConstraints, PoseGraphError
from urquhart.pose_covariance import PoseUncertainty

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

TIGHT = np.diag(LOOP**2)


def constraint(first: int, second: int, pose: SE2, *, trusted: bool = False) -> PoseConstraint:
    return PoseConstraint(first, second, pose, PoseUncertainty.about_point(np.zeros(2), pose, TIGHT), trusted)


def solved(count: int, *constraints: PoseConstraint) -> OptimisedPoses:
    return optimise(count, PoseConstraints.of(constraints))


def errors(graph: TrueGraph, found: OptimisedPoses) -> NDArray[np.float64]:
    """Errors (S, 3) of the poses, in the frame of the first submap."""
    truth = compose(np.repeat(inverse(graph.truth[:1]), len(graph.truth), axis=0), graph.truth)
    off = found.poses - truth
    off[:, 2] = wrapped(off[:, 2])
    return off


def refused(found: OptimisedPoses) -> NDArray[np.bool_]:
    return np.array([reason is not None for reason in found.refusals])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("odometry", [True, False])
def test_no_false_loop_is_kept_and_no_right_one_is_lost(share: float, odometry: bool) -> None:
    for seed in range(3):
        graph = drive(np.random.default_rng(seed), 90, share, odometry)
        found = optimise(90, graph.constraints)
        assert not (graph.false & ~refused(found)).any()
        lost = ~graph.false & refused(found)
        if odometry:
            assert lost.sum() <= 1  # the gate lets 99.9 % of the right ones pass
            assert found.part.max() == 0 and not found.in_map.any()
            assert np.hypot(*errors(graph, found)[:, :2].T).max() < 1.5
        else:  # submaps whose other constraints are all false are not joined by a single one
            assert lost.sum() <= 0.05 * len(lost)
            assert np.bincount(found.part).max() >= 75


def test_covariances_are_honest() -> None:
    figures = []
    for seed in range(12):
        graph = drive(np.random.default_rng(seed), 60, 0.1)
        found = optimise(60, graph.constraints)
        figures.append(squared_distances(errors(graph, found)[1:], found.covariances[1:]).mean())
    assert 2.0 < np.mean(figures) < 4.0  # the mean of a chi-squared distribution with three degrees of freedom is 3
    assert not found.covariances[0].any()


def test_a_square_by_hand() -> None:
    # Four sides of 10 m with a quarter turn each close perfectly. The fourth is 4 cm too long, and all share it.
    side = SE2(10.0, 0.0, np.pi / 2)
    found = solved(4, *(constraint(i, i + 1, side) for i in range(3)), constraint(3, 0, SE2(10.04, 0.0, np.pi / 2)))
    assert found.refusals == (None,) * 4
    assert found.poses[:, :2] == pytest.approx(np.array([[0, 0], [10, 0], [10, 10], [0, 10]]), abs=0.04)
    assert 10.0 < found.poses[3, 1] < 10.04 < 10.0 + 2.0 * (found.poses[3, 1] - 10.0) + 0.03


def test_a_graph_does_not_depend_on_where_the_origins_of_submaps_are() -> None:
    graph = drive(np.random.default_rng(1), 40)
    far = np.array([[400_000.0, 5_000_000.0, 0.0]])
    shift = np.repeat(far, len(graph.constraints), axis=0)
    there = replace(
        graph.constraints,
        poses=compose(compose(shift, graph.constraints.poses), inverse(shift)),
        about=graph.constraints.about + far[0, :2],
    )
    near, moved = optimise(40, graph.constraints), optimise(40, there)
    assert moved.pose(0) == SE2(0.0, 0.0, 0.0)
    for submap in (1, 20, 39):
        point = moved.pose(submap).apply(far[:, :2])[0] - far[0, :2]
        assert point == pytest.approx(near.poses[submap, :2], abs=1e-4)
        assert moved.covariances[submap] == pytest.approx(near.covariances[submap], rel=1e-3, abs=1e-9)


def test_unconnected_submaps_are_parts_of_their_own() -> None:
    found = solved(5, constraint(0, 2, SE2(3.0, 0.0, 0.1)), constraint(1, 4, SE2(0.0, 2.0, 0.0)))
    assert found.part.tolist() == [0, 1, 0, 2, 1]
    assert found.in_map.tolist() == [False] * 3
    assert found.poses[2] == pytest.approx([3.0, 0.0, 0.1])
    assert found.pose(1) == found.pose(3) == found.pose(0) == SE2(0.0, 0.0, 0.0)


@pytest.mark.parametrize("count", [0, 1])
def test_a_map_of_one_submap_or_none(count: int) -> None:
    found = solved(count)
    assert found.poses.tolist() == [[0.0, 0.0, 0.0]] * count
    assert len(found.in_map) == count and found.scale == 1.0


def test_priors_place_a_part_in_the_map() -> None:
    there = SE2(100.0, 50.0, 1.0)
    found = solved(3, constraint(0, 1, SE2(5.0, 0.0, 0.0)), constraint(MAP, 1, there, trusted=True))
    assert found.in_map.tolist() == [True, False]
    assert found.poses[1] == pytest.approx([there.x, there.y, there.yaw])
    assert found.poses[0] == pytest.approx([100.0 - 5.0 * np.cos(1.0), 50.0 - 5.0 * np.sin(1.0), 1.0])
    assert found.uncertainty(1).covariance == pytest.approx(TIGHT, rel=0.01, abs=1e-9)


def test_a_wrong_prior_is_refused() -> None:
    graph = drive(np.random.default_rng(2), 30)
    given = [constraint(MAP, i, SE2(*graph.truth[i].tolist())) for i in (0, 7, 8, 15, 29)]
    priors = PoseConstraints.of([*given, constraint(MAP, 12, SE2(0.0, 0.0, 0.0))])
    names = ("first", "second", "poses", "about", "covariances", "trusted", "secondary")
    both = PoseConstraints(*(np.concatenate([getattr(one, n) for one in (graph.constraints, priors)]) for n in names))
    found = optimise(30, both)
    assert found.in_map.tolist() == [True]
    assert [i for i, reason in enumerate(found.refusals) if reason] == [len(both) - 1]
    assert found.refusals[-1] == "contradicted"
    assert np.hypot(*(found.poses - graph.truth)[:, :2].T).max() < 1.0


def test_constraints_that_contradict_each_other_join_nothing() -> None:
    ends = [SE2(0.0, 0.0, 0.0), SE2(9.0, 0.0, 0.0), SE2(0.0, 9.0, 2.0)]
    found = solved(2, *(constraint(0, 1, end) for end in ends))
    assert found.part.tolist() == [0, 1]
    assert found.refusals == ("unconfirmed",) * 3
    assert np.isnan(found.distances).all()


def test_a_single_constraint_joins_only_where_others_were_right() -> None:
    """Two drives, and one constraint between them that nothing confirms."""
    for share, parts in ((0.0, 1), (0.3, 2)):
        graph = drive(np.random.default_rng(3), 120, share)
        kept = (graph.constraints.first < 60) == (graph.constraints.second < 60)
        bridge = np.flatnonzero(~kept & ~graph.false & ~graph.constraints.trusted)[:1]
        kept[bridge] = True
        chosen = PoseConstraints(*(getattr(graph.constraints, n)[kept] for n in PoseConstraints.__slots__))
        found = optimise(120, chosen)
        assert len(found.in_map) == parts
        trusting = optimise(120, chosen, MAPPING._replace(agreeing=1))
        assert len(trusting.in_map) == 1


def test_matches_that_are_off_by_more_than_they_say_are_scaled_and_not_refused() -> None:
    """Submaps are not rigid: four times the noise that their covariances tell."""
    graph = drive(np.random.default_rng(4), 90, odometry=False)
    loose = replace(graph.constraints, covariances=graph.constraints.covariances / 16.0)
    found = optimise(90, loose)
    assert 10.0 < found.scale < 22.0
    assert refused(found).sum() <= 2
    assert optimise(90, graph.constraints).scale == 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"covariances": np.zeros((1, 3, 3))}, "covariance of constraint 0 is not symmetric and positive definite"),
        ({"covariances": np.diag([1.0, 1.0, -1.0])[None]}, "give every direction a variance above 0"),
        ({"covariances": np.array([[[1.0, 2.0, 0], [2.0, 1.0, 0], [0, 0, 1.0]]])}, "positive definite"),
        ({"poses": np.array([[np.nan, 0.0, 0.0]])}, "constraint 0 has a number that is not finite"),
        ({"second": np.array([3])}, "names submap 3, but there are only 2 submaps"),
        ({"first": np.array([-2])}, "names submap -2"),
        ({"second": np.array([MAP])}, "names submap -1"),
        ({"second": np.array([0])}, "joins submap 0 with itself"),
    ],
)
def test_what_cannot_be_optimised_is_refused(change: dict[str, NDArray[np.float64]], message: str) -> None:
    one = PoseConstraints.of([constraint(0, 1, SE2(1.0, 0.0, 0.0))])
    given = PoseConstraints(*(change.get(name, getattr(one, name)) for name in PoseConstraints.__slots__))
    with pytest.raises(PoseGraphError, match=message):
        optimise(2, given)


def test_without_gtsam_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "gtsam", None)
    with pytest.raises(graph_solver.MissingOptimiser, match=r"pip install 'urquhart\[maps\]'"):
        solved(2, constraint(0, 1, SE2(1.0, 0.0, 0.0)))


def test_the_order_of_constraints_does_not_matter() -> None:
    graph = drive(np.random.default_rng(5), 40, 0.3)
    order = np.random.default_rng(6).permutation(len(graph.constraints))
    mixed = PoseConstraints(*(getattr(graph.constraints, n)[order] for n in PoseConstraints.__slots__))
    straight, turned = optimise(40, graph.constraints), optimise(40, mixed)
    assert turned.poses == pytest.approx(straight.poses, abs=1e-4)
    assert [straight.refusals[e] for e in order] == list(turned.refusals)


def test_measured_with_no_pairs() -> None:
    none = np.empty((0, 2), np.int64)
    nothing = np.empty(0, np.bool_)
    graph = measured(np.random.default_rng(0), np.zeros((2, 3)), none, nothing, nothing)
    assert optimise(2, graph.constraints).part.tolist() == [0, 1]


@pytest.mark.parametrize("size", [12, 30])
@pytest.mark.parametrize("last", [True, False])
def test_a_single_false_match_across_a_ring_is_found_whatever_the_order(size: int, last: bool) -> None:
    """No short cycle checks any of them, but without the false one the ring closes."""
    for seed in range(3):
        graph = ring(size, seed)
        found = optimise(size, graph.constraints if last else backwards(graph.constraints))
        assert refused(found).sum() == 1 and not found.part.any()
        assert found.refusals[-1 if last else 0] is not None


def test_parts_stay_apart_if_nothing_tells_which_of_two_single_matches_is_false() -> None:
    """A square of four matches, of which one is false: any of them may be."""
    side = SE2(10.0, 0.0, np.pi / 2)
    found = solved(4, *(constraint(i, i + 1, side) for i in range(3)), constraint(3, 0, SE2(16.0, 3.0, np.pi / 2)))
    assert None not in found.refusals and len(found.in_map) == 4


def ring(size: int, seed: int) -> TrueGraph:
    """Submaps on a circle, each matched with the next one, and a false match across."""
    angle = 2.0 * np.pi / size * np.arange(size)
    first = np.arange(size + 1) % size
    pairs = np.column_stack([first, np.where(np.arange(size + 1) < size, (first + 1) % size, size // 3)])
    truth = np.column_stack([70.0 * np.cos(angle), 70.0 * np.sin(angle), wrapped(np.asarray(angle, np.float64))])
    false = np.arange(size + 1) == size
    graph = measured(np.random.default_rng(seed), truth, pairs, false & ~false, false)
    graph.constraints.second[-1] = size // 3
    return graph


def backwards(given: PoseConstraints) -> PoseConstraints:
    return PoseConstraints(*(getattr(given, name)[::-1] for name in PoseConstraints.__slots__))
