"""Which landmarks of several submaps are the same tree.

Under optimised poses, a submap is still off by some centimetres, and all of its trees together. So trees are not
associated one by one. In turns, landmarks that lie close are grouped, and each submap is moved as a whole onto the
means of its groups, as far as the uncertainty of its pose allows. What is left is noise of single trees. From it
follows how close landmarks of one tree lie.

A sensor that reports two trees has seen two: no group takes two landmarks of one submap.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart.mapping.map_merging import dbscan, keep_apart, renumber

Points = NDArray[np.float64]
Labels = NDArray[np.int64]


class AssociationNumbers(NamedTuple):
    """How landmarks are grouped. Chosen by hand; `make bench-maps` shows trees that are lost or doubled."""

    first: float = 0.75
    """Metres within which landmarks are grouped before submaps were moved: how far partners may be in verification."""
    least: float = 0.2
    """Metres: least distance within which they are grouped afterwards."""
    reach: float = 5.0
    """Standard deviations of the noise of one coordinate within which they are grouped afterwards: the distance of two
    landmarks of one tree is larger in 1 of 500 cases."""
    rounds: int = 4
    """Times that submaps are moved and landmarks grouped again."""
    noise: float = 0.1
    """Metres: noise of one coordinate that is assumed where no tree was observed twice."""
    again: float = 2.0
    """Groups this many times as far apart are one tree if no submap has both: two trees would have been seen together
    somewhere. Submaps are not rigid, and their far trees are off by more than noise."""
    several: int = 3
    """Fewest landmarks that two such groups must have: with fewer, each submap may have missed one of two trees."""
    swaps: int = 5
    """Most times that the landmarks of close trees are dealt out to them again."""


ASSOCIATION: Final = AssociationNumbers()


class MapLandmarks(NamedTuple):
    """All landmarks of some submaps in one frame.

    Attributes:
        xy: (N, 2) float64, metres, map frame.
        owner: (N,) int64, the submap of each.
        numbers: (N,) int64, its number in its submap.
    """

    xy: Points
    owner: Labels
    numbers: Labels


class Associated(NamedTuple):
    """Landmarks grouped by tree.

    Attributes:
        labels: (N,) int64, the tree of each landmark, numbered by first landmark.
        xy: (N, 2) float64, metres, map frame: landmarks after their submaps were moved.
        noise: metres, standard deviation of one coordinate of one landmark.
    """

    labels: Labels
    xy: Points
    noise: float


def associate(given: MapLandmarks, middles: Points, covariances: NDArray[np.float64]) -> Associated:
    """Group landmarks by tree.

    Args:
        given: the landmarks.
        middles: (S, 2) float64, metres, map frame: the point that the covariance of each submap's pose is about.
        covariances: (S, 3, 3) float64 over (x, y, yaw), of the pose of each submap along the axes of the map frame.
    """
    labels = _grouped(given.xy, given.owner, ASSOCIATION.first)
    noise = _noise(given.xy, labels)
    moved = given.xy
    for _ in range(ASSOCIATION.rounds):
        moved = _aligned(given, moved, labels, noise, (middles, covariances))
        noise = _noise(moved, labels)
        distance = float(np.clip(ASSOCIATION.reach * noise, ASSOCIATION.least, ASSOCIATION.first))
        labels = _grouped(moved, given.owner, distance)
    return Associated(_rejoined(moved, given.owner, labels, ASSOCIATION.again * distance), moved, noise)


def _grouped(xy: Points, owner: Labels, distance: float) -> Labels:
    """Landmarks (N, 2) within `distance`, metres, in one group each, with at most one landmark of each owner."""
    chained = dbscan(xy, distance)
    apart = keep_apart(xy, owner, chained, distance)
    split = np.flatnonzero(np.bincount(chained) != _sizes_of_largest(chained, apart))
    for group in split.tolist():
        members = np.flatnonzero(chained == group)
        apart[members] = _dealt_out(xy[members], owner[members], apart[members])
    return renumber(apart)


def _rejoined(xy: Points, owner: Labels, labels: Labels, distance: float) -> Labels:
    """Groups (N,) whose means are within `distance`, metres, joined if no owner has both; nearest first."""
    if not len(labels):
        return labels
    counts = np.bincount(labels)
    means = np.column_stack([np.bincount(labels, xy[:, k]) for k in range(2)]) / counts[:, None]
    pairs = cKDTree(means).query_pairs(distance, output_type="ndarray")
    pairs = pairs[counts[pairs].sum(axis=1) >= ASSOCIATION.several]
    gaps = np.hypot(*(means[pairs[:, 0]] - means[pairs[:, 1]]).T)
    order, ends = np.argsort(labels, kind="stable"), np.cumsum(counts)
    owners = {g: set(owner[order[ends[g] - counts[g] : ends[g]]].tolist()) for g in np.unique(pairs).tolist()}
    members = {group: [group] for group in owners}
    joined = np.arange(len(counts))
    for a, b in pairs[np.argsort(gaps, kind="stable")].tolist():
        first, second = int(joined[a]), int(joined[b])
        if first != second and owners[first].isdisjoint(owners[second]):
            owners[first] |= owners[second]
            members[first] += members[second]
            joined[members[second]] = first
    return renumber(joined[labels])


def _sizes_of_largest(chained: Labels, apart: Labels) -> NDArray[np.int64]:
    """For each chained group, the size of the largest group that it was split into."""
    sizes = np.bincount(apart)[apart]
    largest = np.zeros(int(chained.max(initial=-1)) + 1, np.int64)
    np.maximum.at(largest, chained, sizes)
    return largest


def _dealt_out(xy: Points, owner: Labels, labels: Labels) -> Labels:
    """The landmarks of close trees dealt out again: those of each owner (N,) to the trees that they fit best together.

    Nearest pairs first, as the groups were made, gives a landmark to a wrong tree that is nearer by chance, and leaves
    its own tree to another one.
    """
    # Imported here because it loads solvers of 11 MB, which no query needs.
    from scipy.optimize import linear_sum_assignment

    labels = labels.copy()
    for _ in range(ASSOCIATION.swaps):
        trees, numbers = np.unique(labels, return_inverse=True)
        sizes = np.bincount(numbers)
        means = np.column_stack([np.bincount(numbers, xy[:, k]) for k in range(2)]) / sizes[:, None]
        before = labels.copy()
        for one in np.unique(owner).tolist():
            own = np.flatnonzero(owner == one)
            if len(own) < 2:
                continue
            places = np.unique(numbers[own])
            cost = ((xy[own][:, None] - means[places][None]) ** 2).sum(axis=2)
            rows, columns = linear_sum_assignment(cost)
            labels[own[rows]] = trees[places[columns]]
        if (labels == before).all():
            break
    return labels


def _aligned(
    given: MapLandmarks, xy: Points, labels: Labels, noise: float, poses: tuple[Points, NDArray[np.float64]]
) -> Points:
    """Landmarks (N, 2) after each submap was moved onto the trees (N,) that others have observed, too.

    The motion of a submap is the likeliest one: its landmarks have `noise`, and its pose has the covariance in `poses`.
    """
    middles, covariances = poses
    count = np.bincount(labels)
    sums = np.column_stack([np.bincount(labels, xy[:, k]) for k in range(2)])
    shared = count[labels] > 1
    others = (sums[labels] - xy) / np.maximum(count[labels] - 1, 1)[:, None]
    # A mean of few others is less certain than one of many.
    weight = np.where(shared, 1.0 / (noise**2 * (1.0 + 1.0 / np.maximum(count[labels] - 1, 1))), 0.0)
    arm = given.xy - middles[given.owner]
    off = np.where(shared[:, None], others - given.xy, 0.0)
    weight *= np.minimum(1.0, 3.0 * noise / np.maximum(np.hypot(*off.T), 1e-9))
    size = len(middles)
    normal = np.linalg.inv(covariances + np.diag([1e-6, 1e-6, 1e-10]))
    for row, column, product in (
        (0, 0, np.ones(len(arm))),
        (1, 1, np.ones(len(arm))),
        (0, 2, -arm[:, 1]),
        (1, 2, arm[:, 0]),
        (2, 2, (arm**2).sum(axis=1)),
    ):
        part = np.bincount(given.owner, weight * product, minlength=size)
        normal[:, row, column] += part
        if row != column:
            normal[:, column, row] += part
    turning = arm[:, 0] * off[:, 1] - arm[:, 1] * off[:, 0]
    right = [np.bincount(given.owner, weight * part, minlength=size) for part in (off[:, 0], off[:, 1], turning)]
    motion = np.linalg.solve(normal, np.column_stack(right)[:, :, None])[:, :, 0][given.owner]
    c, s = np.cos(motion[:, 2]), np.sin(motion[:, 2])
    turned = np.column_stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]])
    return np.asarray(middles[given.owner] + turned + motion[:, :2])


def _noise(xy: Points, labels: Labels) -> float:
    """Metres: standard deviation of one coordinate of landmarks (N, 2) about their trees, robust against outliers."""
    count = np.bincount(labels)
    means = np.column_stack([np.bincount(labels, xy[:, k]) for k in range(2)]) / np.maximum(count, 1)[:, None]
    several = count[labels] > 1
    if not several.any():
        return ASSOCIATION.noise
    # The mean has taken part of the distance: n / (n - 1) puts it back. Half of all Rayleigh distances are below 1.18.
    share = count[labels[several]] / (count[labels[several]] - 1.0)
    off = ((xy[several] - means[labels[several]]) ** 2).sum(axis=1) * share
    return max(float(np.sqrt(np.median(off) / (2.0 * np.log(2.0)))), 1e-3)
