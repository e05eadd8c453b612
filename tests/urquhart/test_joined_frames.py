"""Two frames are laid onto each other by the matches that agree, or not at all."""

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2
from urquhart.mapping.frames.joint import FrameMatches, join_frames
from urquhart.mapping.pose_arrays import squared_distances, wrapped

TRUTH = SE2(120.0, -40.0, 2.0)
SIGMA = np.array([0.05, 0.05, 0.003])


def matches(
    rng: np.random.Generator, right: int, wrong: list[int], drift: float = 0.0, at: SE2 = TRUTH
) -> FrameMatches:
    """`right` matches at the true pose, and groups of `wrong` ones that agree with each other on a random pose."""
    size = right + sum(wrong)
    about = rng.uniform(-100.0, 100.0, (size, 2))
    poses = np.empty((size, 3))
    pose, begin = at, 0
    for count in (right, *wrong):
        for k in range(begin, begin + count):
            error = rng.normal(size=3) * SIGMA + rng.normal(size=3) * [drift, drift, drift / 100.0]
            turn = pose @ SE2.shift(about[k])
            poses[k] = _numbers(SE2(turn.x + error[0], turn.y + error[1], turn.yaw + error[2]) @ SE2.shift(-about[k]))
        begin += count
        x, y = rng.uniform(-200.0, 200.0, 2).tolist()
        pose = SE2(x, y, float(rng.uniform(-np.pi, np.pi)))
    own = np.tile(np.diag(SIGMA**2), (size, 1, 1))
    shared = np.tile(np.diag([drift**2, drift**2, (drift / 100.0) ** 2]), (size, 1, 1))
    order = rng.permutation(size)
    number = np.arange(size)
    nothing = np.zeros(size, np.bool_)
    return FrameMatches(number, number, poses[order], about[order], own[order], shared[order], nothing)


def _numbers(pose: SE2) -> NDArray[np.float64]:
    return np.array([pose.x, pose.y, pose.yaw])


def test_most_matches_agree_and_the_others_are_left_out() -> None:
    errors = []
    for seed in range(60):
        found = join_frames(matches(np.random.default_rng(seed), 12, [3, 2, 1, 1]))
        assert found.verdict == "joined" and found.kept.sum() >= 11 and found.agreeing >= 11
        assert found.pose is not None and found.uncertainty is not None
        middle = found.uncertainty.source[None]
        off = found.pose.apply(middle)[0] - TRUTH.apply(middle)[0]
        turn = wrapped(np.array([found.pose.yaw - TRUTH.yaw]))
        errors.append(squared_distances(np.array([[*off, *turn]]), found.uncertainty.covariance[None])[0])
        assert found.distances[~found.kept].min() > 4.0 > found.distances[found.kept].max() - 0.1
    assert 2.0 < np.mean(errors) < 4.0  # 3 if the covariance is honest


def test_poses_that_are_off_together_keep_their_covariance() -> None:
    found = join_frames(matches(np.random.default_rng(0), 40, [], drift=1.0))
    assert found.uncertainty is not None and found.uncertainty.covariance[0, 0] > 0.5


@pytest.mark.parametrize(
    ("right", "wrong", "verdict"),
    [(0, [], "unconnected"), (3, [], "unconnected"), (4, [], "joined"), (0, [3, 2, 1], "unconnected")]
    + [
        (5, [4, 1], "undecided"),
        (6, [4], "undecided"),
        (5, [3], "undecided"),
        (6, [3], "joined"),
        (5, [1] * 9, "joined"),
    ],
)
def test_even_evidence_joins_nothing(right: int, wrong: list[int], verdict: str) -> None:
    assert join_frames(matches(np.random.default_rng(right), right, wrong)).verdict == verdict


def test_matches_of_one_submap_are_one_witness() -> None:
    made = matches(np.random.default_rng(1), 8, [])
    same = FrameMatches(
        np.zeros(8, np.int64), made.from_submap, made.poses, made.about, made.own, made.shared, made.secondary
    )
    found = join_frames(same)
    assert (found.verdict, found.agreeing) == ("unconnected", 1)


def test_secondary_matches_only_join_in() -> None:
    made = matches(np.random.default_rng(2), 6, [20])
    secondary = np.hypot(*(made.poses[:, :2] - _numbers(TRUTH)[:2]).T) > 10.0
    mixed = FrameMatches(made.to_submap, made.from_submap, made.poses, made.about, made.own, made.shared, secondary)
    found = join_frames(mixed)
    assert found.verdict == "joined" and (found.kept == ~secondary).all()


def test_far_frames_are_joined_as_well() -> None:
    far = SE2(400_000.0, 5_800_000.0, -0.7)
    found = join_frames(matches(np.random.default_rng(3), 9, [2], at=far))
    assert found.verdict == "joined" and found.pose is not None
    point = np.array([[10.0, 20.0]])
    assert found.pose.apply(point)[0] == pytest.approx(far.apply(point)[0], abs=0.2)
