"""One frame laid onto another: the pose that most matches between their submaps agree on.

Each match between a submap of one frame and a submap of the other tells the whole pose `to_T_from`. The largest set
of matches that agree with each other gives it, if it is large enough and twice as large as any other one: false matches
of neighbours agree as well, because they take one wrong place for the right one.
"""

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from urquhart.mapping.agreement import NEIGHBOURS
from urquhart.mapping.pose_arrays import Covariances, Poses, moved, swung, wrapped
from urquhart.pose_covariance import PoseUncertainty
from urquhart.se2 import SE2

Verdict = Literal["joined", "undecided", "unconnected"]
"""`undecided`: too many other matches agree on another pose. `unconnected`: too few agree on any."""


class JointNumbers(NamedTuple):
    """What joins two frames. Chosen by hand; `python -m benchmarks.maps --only maps_robots` shows what they do."""

    least: int = 4
    """Matches without a common submap that must agree: three neighbours in a row may see one wrong place."""
    lead: int = 2
    """How many times as many must agree as on any other pose. Not a majority: between large frames there are many false
    matches, which scatter."""
    probability: float = 0.999
    """Share of right matches that agree with the pose of the others."""
    rounds: int = 10
    """Most times that the pose is fitted again to the matches that agree with it."""


JOINT: Final = JointNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class FrameMatches:
    """What matches between the submaps of two frames say of `to_T_from`.

    Attributes:
        to_submap, from_submap: (M,) int64, numbers of the submaps that each match joins.
        poses: (M, 3) float64, x, y (metres), yaw (radians) of `to_T_from`.
        about: (M, 2) float64, metres, frame `from`: the point that the covariances are about.
        own: (M, 3, 3) float64 over (x, y, yaw), axes of `to`: what the match itself may be off. These are independent.
        shared: (M, 3, 3), the same for the poses of its two submaps. These may be off together.
        secondary: (M,) bool, whether a match counts only where others confirm it.
    """

    to_submap: NDArray[np.int64]
    from_submap: NDArray[np.int64]
    poses: Poses
    about: NDArray[np.float64]
    own: Covariances
    shared: Covariances
    secondary: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class JoinedFrames:
    """How two frames lie to each other.

    Attributes:
        verdict: whether `to_T_from` may be used.
        pose: `to_T_from` that the largest set agrees on; None if there is no match.
        uncertainty: of it.
        kept: (M,) bool, the matches that agree with it.
        offsets: (M, 3) float64, metres and radians, axes of `to`: how far each match is off in the middle of all.
        distances: (M,) float64, the same as a Mahalanobis distance.
        agreeing: number of kept matches without a common submap.
    """

    verdict: Verdict
    pose: SE2 | None
    uncertainty: PoseUncertainty | None
    kept: NDArray[np.bool_]
    offsets: Poses
    distances: NDArray[np.float64]
    agreeing: int


def join_frames(matches: FrameMatches) -> JoinedFrames:
    """The pose of one frame in another that most matches agree on."""
    size = len(matches.poses)
    if not size:
        nothing = np.zeros((0, 3))
        return JoinedFrames("unconnected", None, None, np.zeros(0, np.bool_), nothing, np.zeros(0), 0)
    gate = 2.0 * float(gammaincinv(1.5, JOINT.probability))
    middle = matches.about.mean(axis=0)
    middles = np.tile(middle, (size, 1))
    there = moved(matches.poses, middles)
    poses = np.column_stack([there, matches.poses[:, 2]])
    arms = there - moved(matches.poses, matches.about)
    own, shared = swung(matches.own, arms), swung(matches.shared, arms)
    slack = np.diag(np.square([NEIGHBOURS.slack[0], NEIGHBOURS.slack[0], NEIGHBOURS.slack[1]]))
    spread = own + shared + slack
    primary = ~matches.secondary
    kept, best = _agreeing(poses, spread, primary if primary.any() else np.ones(size, np.bool_), gate)
    for _ in range(JOINT.rounds):
        best = _mean(poses, spread, kept)
        again = _distances(poses - best, spread) <= gate
        if not again.any() or (again == kept).all():
            break
        kept = again
    offsets = poses - best
    offsets[:, 2] = wrapped(offsets[:, 2])
    pose = SE2(*best.tolist()) @ SE2.shift(-middle)
    uncertainty = PoseUncertainty.about_point(middle, pose, _covariance(own, shared, spread, kept))
    agreeing = _apart(matches, kept)
    verdict: Verdict = "joined"
    if agreeing < JOINT.least:
        verdict = "unconnected"
    elif JOINT.lead * _rival(matches, poses, spread, kept, gate) > agreeing:
        verdict = "undecided"
    return JoinedFrames(verdict, pose, uncertainty, kept, offsets, np.sqrt(_distances(offsets, spread)), agreeing)


def _distances(offsets: Poses, spread: Covariances) -> NDArray[np.float64]:
    """Squared Mahalanobis distances (M,)."""
    error = offsets.copy()
    error[:, 2] = wrapped(error[:, 2])
    return np.asarray((error * np.linalg.solve(spread, error[:, :, None])[:, :, 0]).sum(axis=1))


def _agreeing(
    poses: Poses, spread: Covariances, seeds: NDArray[np.bool_], gate: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """The matches (M,) that agree with one of the `seeds` (M,), which agrees with most, and its pose (3,)."""
    best, pose = np.zeros(len(poses), np.bool_), poses[int(np.flatnonzero(seeds)[0])]
    for seed in np.flatnonzero(seeds).tolist():
        agree = _distances(poses - poses[seed], spread + spread[seed]) <= gate
        if (agree & seeds).sum() > (best & seeds).sum():
            best, pose = agree, poses[seed]
    return best, pose


def _mean(poses: Poses, spread: Covariances, kept: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The mean pose (3,) of matches, weighted with the inverse of what each may be off."""
    weights = np.linalg.inv(spread[kept])
    first = poses[kept][0]
    offsets = poses[kept] - first
    offsets[:, 2] = wrapped(offsets[:, 2])
    return np.asarray(first + np.linalg.solve(weights.sum(axis=0), (weights @ offsets[:, :, None]).sum(axis=0))[:, 0])


def _covariance(
    own: Covariances, shared: Covariances, spread: Covariances, kept: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """The covariance (3, 3) of that mean: errors of matches average out, those of the submaps' poses need not."""
    weights = np.linalg.inv(spread[kept])
    shares = np.linalg.solve(weights.sum(axis=0), weights)
    independent = (shares @ own[kept] @ shares.transpose(0, 2, 1)).sum(axis=0)
    together = (shares @ shared[kept]).sum(axis=0)
    return np.asarray(independent + 0.5 * (together + together.T))


def _apart(matches: FrameMatches, which: NDArray[np.bool_]) -> int:
    """How many of some matches have no common submap."""
    taken, count = set[tuple[str, int]](), 0
    for to, of in zip(matches.to_submap[which].tolist(), matches.from_submap[which].tolist(), strict=True):
        if taken.isdisjoint({("to", to), ("from", of)}):
            taken |= {("to", to), ("from", of)}
            count += 1
    return count


def _rival(matches: FrameMatches, poses: Poses, spread: Covariances, kept: NDArray[np.bool_], gate: float) -> int:
    """How many of the other matches, without a common submap, agree on another pose."""
    others = ~kept & ~matches.secondary
    return _apart(matches, _agreeing(poses, spread, others, gate)[0] & others) if others.any() else 0
