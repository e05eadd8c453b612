"""Which submaps should have observed a tree and did not, and which trees came or went between two dates."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from urquhart.mapping.optimisation import OptimisedPoses
from urquhart.mapping.pose_arrays import inverse, moved


class CoverageNumbers(NamedTuple):
    """When a submap should have observed a tree. Chosen by hand, not fitted."""

    inside: float = 1.0
    """Metres that a tree must lie inside the hull of a submap's landmarks before it counts as missed: the sensor's
    range ends somewhere about the hull."""


COVERAGE: Final = CoverageNumbers()


def missed_trees(
    submaps: Sequence[NDArray[np.float64]],
    poses: OptimisedPoses,
    trees: tuple[NDArray[np.float64], NDArray[np.int64]],
    observed: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Pairs (K, 2) of a tree and a submap that has other trees all around it, but not this one; sorted.

    Args:
        submaps: (N_i, 2) float64 each, metres, each in its own frame.
        poses: of the submaps.
        trees: positions (L, 2) float64, metres, in the frame of their part, and that part (L,).
        observed: (M, 2) int64, pairs of a tree and a submap that has it.
    """
    xy, part = trees
    nearby = {int(p): (np.flatnonzero(part == p), cKDTree(xy[part == p])) for p in np.unique(part)}
    found = [np.empty((0, 2), np.int64)]
    back = inverse(poses.poses)
    for number, landmarks in enumerate(submaps):
        hull = _hull(landmarks)
        if hull is None:
            continue
        numbers, tree = nearby[int(poses.part[number])]
        middle = landmarks.mean(axis=0)
        reach = float(np.hypot(*(landmarks - middle).T).max())
        there = moved(poses.poses[number : number + 1], middle[None])[0]
        near = numbers[np.array(tree.query_ball_point(there, reach), np.int64)]
        local = moved(np.repeat(back[number : number + 1], len(near), axis=0), xy[near])
        inside = (local @ hull[:, :2].T + hull[:, 2] <= -COVERAGE.inside).all(axis=1)
        found.append(np.column_stack([near[inside], np.full(int(inside.sum()), number)]))
    covered = np.concatenate(found)
    size = max(len(submaps), 1)
    missing = np.setdiff1d(covered @ np.array([size, 1]), observed @ np.array([size, 1]))
    return np.column_stack([missing // size, missing % size]).astype(np.int64)


def _hull(landmarks: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The half-planes (H, 3) of the convex hull; None if the landmarks span no area."""
    if len(landmarks) < 3:
        return None
    try:
        return np.asarray(ConvexHull(landmarks).equations)
    except QhullError:
        return None


class ChangeNumbers(NamedTuple):
    """When a tree counts as gone or new. Chosen by hand."""

    observed: int = 2
    """Submaps that must have a tree on the side where it was there: one alone may be a false detection."""
    chance: float = 0.01
    """Largest probability that all submaps on the other side missed a tree that stood there."""


CHANGES: Final = ChangeNumbers()


class TreeChanges(NamedTuple):
    """What changed at a date.

    Attributes:
        gone, new: (G,) and (N,) int64, trees of the map that were observed only before, and only from then on, although
            submaps of the other side cover their places.
        kept: number of trees observed on both sides.
        undecided: number of trees observed on one side only, with too few submaps on the other to tell.
        detection: share of the trees in view that a submap has.
    """

    gone: NDArray[np.int64]
    new: NDArray[np.int64]
    kept: int
    undecided: int
    detection: float


def tree_changes(
    observed: NDArray[np.int64], misses: NDArray[np.int64], stamps: NDArray[np.float64], date: float
) -> TreeChanges:
    """Trees that came or went at a date.

    Args:
        observed: (M, 2) int64, pairs of a tree and a submap that has it.
        misses: (K, 2) int64, pairs of a tree and a submap that missed it (`LandmarkMap.misses`).
        stamps: (S,) float64, seconds since 1970, of each submap; submaps with NaN are left out.
        date: seconds since 1970.
    """
    size = int(max(observed[:, 0].max(initial=-1), misses[:, 0].max(initial=-1))) + 1
    before, after = stamps < date, stamps >= date
    seen = [np.bincount(observed[side[observed[:, 1]], 0], minlength=size) for side in (before, after)]
    missed = [np.bincount(misses[side[misses[:, 1]], 0], minlength=size) for side in (before, after)]
    # A tree that is gone would make detection look worse than it is, so only trees of both sides tell it.
    both = (seen[0] > 0) & (seen[1] > 0)
    hits, gaps = (int((counts[0] + counts[1])[both].sum()) for counts in (seen, missed))
    detection = hits / (hits + gaps) if hits else 0.0
    surely = [(1.0 - detection) ** counts < CHANGES.chance for counts in missed]
    gone = (seen[0] >= CHANGES.observed) & (seen[1] == 0) & surely[1]
    new = (seen[1] >= CHANGES.observed) & (seen[0] == 0) & surely[0]
    known = (seen[0] > 0) | (seen[1] > 0)
    undecided = int((known & ~both & ~gone & ~new).sum())
    return TreeChanges(np.flatnonzero(gone), np.flatnonzero(new), int(both.sum()), undecided, detection)
