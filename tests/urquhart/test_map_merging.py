import numpy as np
import pytest
from numpy.typing import NDArray

from tests.urquhart.forests import pose, uniform
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, paper_forest
from urquhart.mapping.map_merging import MergedMap, dbscan, merge

STILL = SE2.identity()


def brute_force_dbscan(points: NDArray[np.float64], distance: float, least: int) -> list[frozenset[int]]:
    """Clusters by the definition: grow from each core point."""
    near = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)) <= distance
    core = near.sum(axis=1) >= least
    clusters, taken = [], set[int]()
    for start in np.flatnonzero(core).tolist():
        if start in taken:
            continue
        members, front = {start}, [start]
        while front:
            for j in np.flatnonzero(near[front.pop()] & core).tolist():
                if j not in members:
                    members.add(j)
                    front.append(j)
        taken |= members
        clusters.append(frozenset(members))
    return clusters


def as_sets(merged: MergedMap) -> set[frozenset[tuple[int, int]]]:
    return {frozenset(zip(*(part.tolist() for part in merged.members(i)), strict=True)) for i in range(len(merged))}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("least", [1, 2, 4])
def test_clusters_are_those_of_the_definition(seed: int, least: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(0.0, 20.0, (150, 2)), rng.normal(10.0, 0.6, (60, 2))])
    labels = dbscan(points, 0.7, least)
    near = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)) <= 0.7
    core = near.sum(axis=1) >= least
    found = [frozenset(np.flatnonzero(core & (labels == k)).tolist()) for k in range(labels.max() + 1)]
    assert set(found) == set(brute_force_dbscan(points, 0.7, least))
    firsts = [int(np.flatnonzero(labels == k)[0]) for k in range(labels.max() + 1)]
    assert firsts == sorted(firsts)
    for i in np.flatnonzero(~core).tolist():
        hearts = np.flatnonzero(near[i] & core)
        if not len(hearts):
            assert labels[i] == -1
        else:
            gap = np.hypot(*(points[hearts] - points[i]).T)
            assert labels[i] == labels[hearts[np.argmin(gap)]]


def test_a_tree_seen_five_times_is_one_landmark_at_the_mean() -> None:
    rng = np.random.default_rng(0)
    trees = paper_forest(rng, 200.0)
    submaps = [observe(trees, pose(rng, 60.0, 140.0), Sensor(60.0, sigma=0.05), rng) for _ in range(5)]
    merged = merge([o.xy for o in submaps], [o.pose for o in submaps])
    seen = np.unique(np.concatenate([o.trees for o in submaps]))
    assert abs(len(merged) - len(seen)) <= 2  # a pair of trees 0.2 m apart may be taken for one
    wrong = 0
    for i in range(len(merged)):
        which, index = merged.members(i)
        members = list(zip(which.tolist(), index.tolist(), strict=True))
        names = {int(submaps[k].trees[n]) for k, n in members}
        at = np.array([submaps[k].pose.apply(submaps[k].xy)[n] for k, n in members])
        np.testing.assert_allclose(merged.landmarks[i], at.mean(axis=0), atol=1e-9)
        away = np.sqrt(((at - at.mean(axis=0)) ** 2).sum(axis=1).mean())
        np.testing.assert_allclose(merged.spread[i], away, atol=1e-9)
        assert len(which) == len(set(which.tolist())) == merged.observation_counts()[i]
        wrong += len(names) > 1
    assert wrong <= 2
    assert sum(len(o.xy) for o in submaps) == len(merged.submaps)


@pytest.mark.parametrize("seed", range(5))
def test_the_map_moves_with_the_poses_and_not_with_the_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    submaps = [uniform(rng, 60, 30.0) for _ in range(4)]
    poses = [pose(rng, -5.0, 5.0) for _ in submaps]
    merged = merge(submaps, poses)
    move = SE2(300.0, -20.0, 1.1)
    moved = merge(submaps, [move @ p for p in poses])
    assert as_sets(moved) == as_sets(merged)
    np.testing.assert_allclose(moved.landmarks, move.apply(merged.landmarks), atol=1e-9)
    np.testing.assert_allclose(moved.spread, merged.spread, atol=1e-9)

    order = rng.permutation(4).tolist()
    shuffles = [rng.permutation(60) for _ in order]
    again = merge([submaps[k][s] for k, s in zip(order, shuffles, strict=True)], [poses[k] for k in order])
    renamed = {frozenset((order[k], int(shuffles[k][n])) for k, n in members) for members in as_sets(again)}
    assert renamed == as_sets(merged)


def test_two_landmarks_of_one_submap_stay_two_trees() -> None:
    """Two stems 0.3 m apart, seen three times; DBSCAN as it is would make one tree of them."""
    stool = np.array([[0.0, 0.0], [0.3, 0.0]])
    submaps = [stool, stool + [0.02, 0.01], stool[::-1] + [-0.02, 0.02]]
    merged = merge(submaps, [STILL] * 3)
    assert as_sets(merged) == {frozenset({(0, 0), (1, 0), (2, 1)}), frozenset({(0, 1), (1, 1), (2, 0)})}
    assert len(merge(submaps, [STILL] * 3, apart=False)) == 1


def test_a_chain_is_one_cluster_unless_a_submap_tells_it_apart() -> None:
    row = np.column_stack([np.arange(6) * 0.4, np.zeros(6)])
    assert len(merge([row], [STILL])) == 6
    assert len(merge([row], [STILL], apart=False)) == 1
    each_its_own = [row[i : i + 1] for i in range(6)]
    assert len(merge(each_its_own, [STILL] * 6)) == 1


def test_what_was_seen_too_rarely_can_be_left_out() -> None:
    rng = np.random.default_rng(3)
    trees = uniform(rng, 50, 60.0)
    ghost = np.array([[80.0, 80.0]])
    merged = merge([trees, np.concatenate([trees + 0.01, ghost])], [STILL, STILL], least=2)
    assert (1, 50) not in {member for members in as_sets(merged) for member in members}
    assert len(merge([trees, ghost], [STILL, STILL])) == 51


def test_little_or_nothing_to_merge() -> None:
    none = merge([], [])
    assert len(none) == 0
    assert none.landmarks.shape == (0, 2)
    assert none.offsets.tolist() == [0]
    assert len(merge([np.empty((0, 2))], [STILL])) == 0
    one = merge([np.empty((0, 2)), np.array([[1.0, 2.0]])], [STILL, SE2(1.0, 0.0, 0.0)])
    assert one.landmarks.tolist() == [[2.0, 2.0]]
    assert one.spread.tolist() == [0.0]
    assert one.members(0)[0].tolist() == [1]
    same = merge([np.zeros((3, 2)), np.zeros((1, 2))], [STILL, STILL])
    assert sorted(same.observation_counts().tolist()) == [1, 1, 2]


def test_unusable_input_is_refused() -> None:
    with pytest.raises(ValueError, match="2 submaps but 1 poses"):
        merge([np.zeros((1, 2)), np.zeros((1, 2))], [STILL])
    with pytest.raises(ValueError, match="finite"):
        merge([np.array([[np.nan, 0.0]])], [STILL])
    with pytest.raises(ValueError, match="finite"):
        merge([np.zeros((1, 2))], [SE2(np.inf, 0.0, 0.0)])
