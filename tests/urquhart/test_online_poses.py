"""Poses of a drive that grows, against the search of all its constraints at once."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart.graphs import TrueGraph, drive
from urquhart.mapping.graph_solver import GraphSolver
from urquhart.mapping.online import growing_system
from urquhart.mapping.online.growing_system import GrowingSystem
from urquhart.mapping.online.session_poses import CurrentPoses, GrowingPoses
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_arrays import compose, inverse
from urquhart.mapping.pose_graph import PoseConstraints, centred
from urquhart.mapping.start_poses import start_poses

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")


def some(given: PoseConstraints, which: NDArray[np.bool_] | NDArray[np.int64]) -> PoseConstraints:
    return PoseConstraints(*(getattr(given, name)[which] for name in given.__slots__))


def by_arrival(graph: TrueGraph) -> tuple[PoseConstraints, NDArray[np.bool_], NDArray[np.int64]]:
    """Constraints in the order in which a drive finds them, which are false, and with which submap each comes."""
    last = np.maximum(graph.constraints.first, graph.constraints.second)
    order = np.argsort(last, kind="stable")
    return some(graph.constraints, order), graph.false[order], last[order]


def driven(given: PoseConstraints, last: NDArray[np.int64], start: int, count: int) -> GrowingPoses:
    """Poses after a search of the first `start` submaps, and then one submap after the other."""
    found = GrowingPoses(start, some(given, last < start), optimise(start, some(given, last < start)))
    for submap in range(start, count):
        found.add(submap + 1, some(given, last == submap))
    return found


def origin_covariances(found: OptimisedPoses) -> NDArray[np.float64]:
    return np.array([found.uncertainty(k).origin_covariance(found.pose(k)) for k in range(len(found.poses))])


def test_matches_that_close_a_long_drive_wait_for_a_search_of_all() -> None:
    given, _, last = by_arrival(drive(np.random.default_rng(3), 35))
    found = GrowingPoses(20, some(given, last < 20), optimise(20, some(given, last < 20)))
    for submap in range(20, 35):
        found.add(submap + 1, some(given, last == submap))
        if found.current().search_due:
            break
    now = found.current()
    assert now.search_due and "pending" in now.standings
    assert restarted(some(given, last <= submap), submap + 1).standings.count("used") > now.standings.count("used")


@pytest.mark.parametrize("vertices", [12, 80])
def test_a_drive_that_grows_has_the_poses_and_covariances_of_all_at_once(
    vertices: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(growing_system, "GROWTH", growing_system.GROWTH._replace(vertices=vertices))
    given, _, last = by_arrival(drive(np.random.default_rng(3), 58))
    now, whole = driven(given, last, 40, 58).current(), optimise(58, given)
    assert set(now.standings) == {"used"} and not now.part.any()
    assert np.hypot(*(now.poses - whole.poses)[:, :2].T).max() < 0.03
    assert np.abs(now.poses - whole.poses)[:, 2].max() < 1e-3
    expected = origin_covariances(whole)
    scale = np.sqrt(np.diagonal(expected, axis1=1, axis2=2)[1:])
    off = (now.covariances - expected)[1:] / (scale[:, :, None] * scale[:, None, :])
    assert np.abs(off).max() < 0.05
    assert not now.covariances[0].any()


def test_no_false_loop_is_used_and_hardly_a_right_one_is_left() -> None:
    for seed in range(3):
        given, false, last = by_arrival(drive(np.random.default_rng(seed), 90, false=0.3))
        standings = np.array(driven(given, last, 40, 90).current().standings)
        assert not (standings[false] == "used").any()
        assert (standings[~false] != "used").sum() <= 2


def test_submaps_without_odometry_are_joined_by_matches_that_agree() -> None:
    given, false, last = by_arrival(drive(np.random.default_rng(4), 45, false=0.05, odometry=False))
    now = driven(given, last, 30, 45).current()
    assert not (np.array(now.standings)[false & (last >= 30)] == "used").any()
    assert (now.part == 0).sum() >= 44 and (now.search_due or not now.part.any())


def test_submaps_that_nothing_joins_stay_apart_and_a_second_chain_is_a_part_of_its_own() -> None:
    given, _, last = by_arrival(drive(np.random.default_rng(5), 40))
    apart = (last < 30) | ((np.minimum(given.first, given.second) >= 32) & given.trusted)
    given, last = some(given, apart), last[apart]
    now = driven(given, last, 20, 40).current()
    assert np.bincount(now.part).tolist() == [30, 1, 1, 8]
    assert np.abs(now.poses[[30, 31, 32]]).max() < 1e-9 and now.poses[33].any()
    assert now.frame_of.tolist() == [0, 30, 31, 32]
    assert not now.covariances[now.frame_of].any() and now.covariances[33].any()


def test_odometry_that_lies_makes_a_whole_search_due_which_finds_it() -> None:
    given, _, last = by_arrival(drive(np.random.default_rng(6), 90))
    lie = int(np.flatnonzero(given.trusted & (last == 70))[0])
    poses = given.poses.copy()
    poses[lie] = compose(poses[lie : lie + 1], np.array([[6.0, 3.0, 0.4]]))[0]
    given = replace(given, poses=poses)
    found = GrowingPoses(65, some(given, last < 65), optimise(65, some(given, last < 65)))
    due = list[bool]()
    for submap in range(65, 80):
        found.add(submap + 1, some(given, last == submap))
        due.append(found.current().search_due)
    assert not due[0] and due[-1]
    now = restarted(some(given, last < 80), 80)
    assert now.standings[int(np.flatnonzero(last < 80).searchsorted(lie))] == "contradicted"


def restarted(given: PoseConstraints, count: int) -> CurrentPoses:
    return GrowingPoses(count, given, optimise(count, given)).current()


def test_the_small_problem_is_exact() -> None:
    given, _, last = by_arrival(drive(np.random.default_rng(8), 40))
    graph = centred(40, given)
    start = start_poses(graph, np.ones(len(given), np.bool_), np.ones(len(given), np.int64))
    held = np.zeros(1, np.int64)
    whole = GraphSolver(graph, np.arange(len(given)), [0], start)
    poses = whole.solve()
    early = np.flatnonzero((last < 30) & (given.trusted | (np.arange(len(given)) % 7 != 0)))
    system = GrowingSystem(graph, early, held, GraphSolver(graph, early, [0], start).solve())
    system.take_covariances(GraphSolver(graph, early, [0], system.poses).covariances())
    for vertex in range(30, 40):
        odometry = np.flatnonzero(given.trusted & (last == vertex))
        system.join(vertex, compose(system.poses[vertex - 1 : vertex], graph.poses[odometry])[0])
        system.add(odometry)
    rest = np.setdiff1d(np.arange(len(given)), [*early.tolist(), *np.flatnonzero(given.trusted & (last >= 30))])
    system.add(rest)
    known = whole.relative_covariances(graph.first[rest], graph.second[rest])
    assert np.allclose(system.relative_covariances(rest), known, rtol=0.05, atol=1e-4)
    system.settle()
    off = compose(inverse(poses[:40]), system.poses[:40])
    assert np.abs(off).max() < 0.01
    expected = whole.covariances()[1:40]
    scale = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))
    assert (np.abs(system.covariances[1:40] - expected) < 0.03 * scale[:, :, None] * scale[:, None, :]).all()
