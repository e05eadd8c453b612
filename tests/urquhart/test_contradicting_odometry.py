"""Odometry is a measurement with a covariance: what contradicts it, and what becomes of the map then."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.maps.graphs import GraphJob, simulate
from tests.urquhart.graphs import drive
from tests.urquhart.test_pose_graph import constraint, refused, solved
from urquhart import SE2
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_arrays import compose
from urquhart.mapping.pose_graph import PoseConstraints

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

SIDE = SE2(10.0, 0.0, np.pi / 2)


def lying(given: PoseConstraints, edge: int, by: tuple[float, float, float]) -> PoseConstraints:
    """The same constraints, of which one is off by `by`: metres, metres, radians."""
    poses = given.poses.copy()
    poses[edge] = compose(poses[edge : edge + 1], np.array([by]))[0]
    return replace(given, poses=poses)


def said(found: OptimisedPoses) -> list[tuple[tuple[int, ...], str]]:
    return [(one.edges, one.outcome) for one in found.contradictions]


@pytest.mark.parametrize(("share", "grouped"), [(0.0, False), (0.3, False), (0.3, True)])
@pytest.mark.parametrize("by", [(4.0, 2.0, 0.0), (0.0, 0.0, 0.5)])
def test_an_edge_that_many_matches_contradict_is_refused_and_named(
    share: float, grouped: bool, by: tuple[float, float, float]
) -> None:
    made = simulate(GraphJob(120, 0.03, share, grouped, 3))
    found = optimise(120, lying(made.constraints, 60, by))
    out, trusted = refused(found), made.constraints.trusted
    assert np.flatnonzero(out & trusted).tolist() == [60] and found.refusals[60] == "contradicted"
    assert not (made.false & ~out).any()
    assert (out & ~made.false & ~trusted).sum() <= 1
    (one,) = found.contradictions
    assert one.edges == (60,) and one.outcome == "refused" and one.witnesses >= 3 and one.sigmas > 4.0
    # Two false matches that agree with each other may be a right way together.
    assert one.against and out[list(one.against)].mean() < 0.5


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_right_odometry_is_never_refused(share: float) -> None:
    for seed in range(3):
        made = simulate(GraphJob(120, 0.05, share, True, seed))
        found = optimise(120, made.constraints)
        assert not (refused(found) & made.constraints.trusted).any() and found.contradictions == ()


def test_a_wrong_turn_that_drops_most_matches_is_found() -> None:
    """Confirmed by each other, 87 right matches were refused as one group, and nothing named the odometry edge."""
    graph = drive(np.random.default_rng(1), 90)
    found = optimise(90, lying(graph.constraints, 45, (0.0, 0.0, 0.3)))
    assert said(found) == [((45,), "refused")]
    assert np.flatnonzero(refused(found)).tolist() == [45]


def test_a_chain_that_opposes_many_matches_is_named_if_nothing_tells_which_link_is_wrong() -> None:
    graph = drive(np.random.default_rng(3), 90)
    found = optimise(90, lying(graph.constraints, 45, (0.0, 0.0, 0.3)))
    (one,) = found.contradictions
    assert one.outcome == "undecided" and 45 in one.edges and one.witnesses >= 5
    assert all(found.refusals[match] == "contradicted" for match in one.against)


def test_odometry_that_contradicts_itself_is_left_out_as_undecided() -> None:
    chain = [constraint(i, (i + 1) % 4, SIDE, trusted=True) for i in range(3)]
    found = solved(4, *chain, constraint(3, 0, SE2(12.0, 0.0, np.pi / 2), trusted=True))
    assert found.refusals == ("undecided",) * 4
    assert said(found) == [((0, 1, 2, 3), "undecided")]
    assert found.contradictions[0].sigmas > 4.0 and found.part.tolist() == [0, 1, 2, 3]


def test_of_two_edges_between_the_same_submaps_none_is_averaged() -> None:
    both = [constraint(0, 1, SE2(x, 0.0, 0.0), trusted=True) for x in (5.0, 8.0)]
    found = solved(2, *both)
    assert found.refusals == ("undecided",) * 2 and found.part.tolist() == [0, 1]
    # A third one, or a match, decides between them.
    for other in (constraint(1, 0, SE2(-5.02, 0.0, 0.0), trusted=True), constraint(0, 1, SE2(5.01, 0.0, 0.0))):
        found = solved(2, *both, other)
        assert found.refusals == (None, "contradicted", None)
        assert said(found) == [((1,), "refused")] and found.poses[1, 0] == pytest.approx(5.0, abs=0.03)
    # Two that agree are both used.
    assert solved(2, both[0], constraint(0, 1, SE2(5.1, 0.0, 0.0), trusted=True)).refusals == (None, None)


def test_a_long_cycle_of_odometry_that_does_not_close_is_named() -> None:
    chain = [constraint(i, i + 1, SE2(10.0, 0.0, 0.0), trusted=True) for i in range(9)]
    found = solved(10, *chain, constraint(0, 9, SE2(80.0, 0.0, 0.0), trusted=True))
    (one,) = found.contradictions
    assert one.outcome == "undecided" and sorted((*one.edges, *one.against)) == list(range(10))
    assert [e for e, reason in enumerate(found.refusals) if reason == "undecided"] == list(one.edges) != []
    assert solved(10, *chain, constraint(0, 9, SE2(90.1, 0.0, 0.0), trusted=True)).contradictions == ()
