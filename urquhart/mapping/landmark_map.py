"""The landmark map: one entry for each tree, from the landmarks of all submaps under their optimised poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from urquhart.mapping.association import ASSOCIATION, Associated, MapLandmarks, associate
from urquhart.mapping.coverage import missed_trees
from urquhart.mapping.map_merging import merge
from urquhart.mapping.optimisation import OptimisedPoses
from urquhart.mapping.pose_arrays import moved
from urquhart.se2 import SE2

Association = Literal["joint", "dbscan"]
"""How landmarks are grouped by tree: each submap as a whole (`association`), or as in the paper (`map_merging`)."""
PAPER_DISTANCE: Final = 0.5
"""Metres: within this distance landmarks are one tree in the paper (section V-C)."""
_SPREAD: Final = 1.4826
"""Standard deviations in a median absolute deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class MappedSubmap:
    """What a submap contributes to a map.

    Attributes:
        xy: (N, 2) float64, metres, its own frame.
        diameters: (N,) float64, centimetres; NaN where unknown, None if none is known.
        heights: (N,) float64, metres; NaN where unknown, None if none is known.
        stamp: seconds since 1970, when it was observed; None if unknown.
    """

    xy: NDArray[np.float64]
    diameters: NDArray[np.float64] | None = None
    heights: NDArray[np.float64] | None = None
    stamp: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMap:
    """The trees of a map.

    Attributes:
        xy: (L, 2) float64, metres, in the frame of each tree's part.
        part: (L,) int64, the part of the pose graph that each tree belongs to.
        covariances: (L, 2, 2) float64, square metres, along the axes of that frame.
        diameters, diameter_sigmas: (L,) float64, centimetres: the median of what was observed, and its standard
            deviation. NaN where unknown; the deviation is NaN where there was one value only.
        heights, height_sigmas: (L,) float64, metres; likewise.
        counts: (L,) int64, submaps in which each tree was observed.
        missed: (L,) int64, submaps that have other trees all around this one, but not this one.
        first_seen, last_seen: (L,) float64, seconds since 1970; NaN where no stamp is known.
        submaps, indices: (M,) int64, the landmarks of each tree, by tree: the submap, and the landmark's number in it.
        offsets: (L + 1,) int64; tree i has the landmarks `offsets[i]:offsets[i + 1]`.
        misses: (K, 2) int64: trees, in order, and a submap that missed each.
        noise: metres, standard deviation of one coordinate of one landmark about its tree.
    """

    xy: NDArray[np.float64]
    part: NDArray[np.int64]
    covariances: NDArray[np.float64]
    diameters: NDArray[np.float64]
    diameter_sigmas: NDArray[np.float64]
    heights: NDArray[np.float64]
    height_sigmas: NDArray[np.float64]
    counts: NDArray[np.int64]
    missed: NDArray[np.int64]
    first_seen: NDArray[np.float64]
    last_seen: NDArray[np.float64]
    submaps: NDArray[np.int64]
    indices: NDArray[np.int64]
    offsets: NDArray[np.int64]
    misses: NDArray[np.int64]
    noise: float

    def __len__(self) -> int:
        return len(self.xy)

    def members(self, tree: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The landmarks of a tree: submaps (m,) int64, and the number of each landmark in its submap (m,) int64."""
        at = slice(self.offsets[tree], self.offsets[tree + 1])
        return self.submaps[at], self.indices[at]


def build_landmark_map(
    submaps: Sequence[MappedSubmap], poses: OptimisedPoses, association: Association = "joint"
) -> LandmarkMap:
    """One entry for each tree that any of the submaps has.

    Args:
        submaps: one for each of the poses.
        poses: of `optimise`. Trees of different parts are never merged: nothing is known of how the parts lie.
        association: `joint` groups landmarks such that the trees of a submap move together, which tells close trees
            apart. `dbscan` groups those within 0.5 m, as the paper does. A submap's own trees stay apart with both.

    Raises:
        ValueError: the number of poses differs from that of submaps, or a landmark is not finite.
    """
    if len(submaps) != len(poses.poses):
        raise ValueError(f"{len(submaps)} submaps but {len(poses.poses)} poses: give one for each submap")
    if not all(np.isfinite(one.xy).all() for one in submaps):
        raise ValueError("landmarks must be finite numbers")
    sizes = np.array([len(one.xy) for one in submaps], np.int64)
    owner = np.repeat(np.arange(len(submaps)), sizes)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    own = np.concatenate([np.empty((0, 2)), *(one.xy for one in submaps)])
    given = MapLandmarks(moved(poses.poses[owner], own), owner, index)
    trees = _associated(given, poses, association)
    return _fused(submaps, poses, given, trees)


def _associated(given: MapLandmarks, poses: OptimisedPoses, association: Association) -> Associated:
    """Landmarks grouped by tree, part by part."""
    labels, xy = np.zeros(len(given.owner), np.int64), given.xy.copy()
    noises, known = list[float](), 0
    middles = moved(poses.poses, poses.about)
    for part in np.unique(poses.part[given.owner]).tolist():
        chosen = np.flatnonzero(poses.part[given.owner] == part)
        some, numbers = np.unique(given.owner[chosen], return_inverse=True)
        here = MapLandmarks(given.xy[chosen], numbers.astype(np.int64), given.numbers[chosen])
        found = associate(here, middles[some], poses.covariances[some])
        grouped = found.labels if association == "joint" else _by_distance(here, len(some))
        labels[chosen] = grouped + known
        known += int(grouped.max()) + 1
        if association == "joint":
            xy[chosen] = found.xy
        if len(some) > 1:
            noises.append(found.noise)
    return Associated(labels, xy, float(np.median(noises)) if noises else ASSOCIATION.noise)


def _by_distance(here: MapLandmarks, count: int) -> NDArray[np.int64]:
    """The groups (N,) that the paper's DBSCAN makes."""
    parts = [here.xy[here.owner == one] for one in range(count)]
    found = merge(parts, [SE2.identity()] * count, distance=PAPER_DISTANCE)
    starts = np.cumsum([0, *(len(part) for part in parts)])
    labels = np.empty(len(here.xy), np.int64)
    labels[starts[found.submaps] + found.indices] = np.repeat(np.arange(len(found)), np.diff(found.offsets))
    return labels


def _fused(
    submaps: Sequence[MappedSubmap], poses: OptimisedPoses, given: MapLandmarks, trees: Associated
) -> LandmarkMap:
    order = np.argsort(trees.labels, kind="stable")
    label, xy, owner = trees.labels[order], trees.xy[order], given.owner[order]
    counts = np.bincount(label).astype(np.int64)
    mean = np.column_stack([np.bincount(label, xy[:, k]) for k in range(2)]).reshape(-1, 2) / counts[:, None]
    part = poses.part[owner[np.cumsum(counts) - counts]]
    offsets = np.concatenate([[0], np.cumsum(counts)])
    stamps = np.array([np.nan if one.stamp is None else one.stamp for one in submaps], np.float64)[owner]
    diameters, diameter_sigmas = _median(_values(submaps, "diameters")[order], label, len(counts))
    heights, height_sigmas = _median(_values(submaps, "heights")[order], label, len(counts))
    misses = missed_trees([one.xy for one in submaps], poses, (mean, part), np.column_stack([label, owner]))
    return LandmarkMap(
        mean,
        part,
        _covariances(poses, mean, (label, owner), trees.noise),
        diameters,
        diameter_sigmas,
        heights,
        height_sigmas,
        counts,
        np.bincount(misses[:, 0], minlength=len(counts)).astype(np.int64),
        _extreme(stamps, label, len(counts), np.fmin),
        _extreme(stamps, label, len(counts), np.fmax),
        owner,
        given.numbers[order],
        offsets,
        misses,
        trees.noise,
    )


def _covariances(
    poses: OptimisedPoses, mean: NDArray[np.float64], members: tuple[NDArray[np.int64], NDArray[np.int64]], noise: float
) -> NDArray[np.float64]:
    """The covariance (L, 2, 2) of each tree: noise of its landmarks, and what the poses of its submaps leave open.

    Poses of submaps that see the same tree have nearly the same error, so this part does not become less by averaging.
    """
    label, owner = members
    counts = np.bincount(label)
    arm = mean[label] - moved(poses.poses, poses.about)[owner]
    jacobian = np.zeros((len(label), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -arm[:, 1], arm[:, 0]
    each = jacobian @ poses.covariances[owner] @ jacobian.transpose(0, 2, 1)
    summed = np.column_stack([np.bincount(label, each[:, i, j]) for i in range(2) for j in range(2)])
    shared = summed.reshape(-1, 2, 2) / counts[:, None, None]
    return np.asarray(shared + noise**2 / counts[:, None, None] * np.eye(2))


def _values(submaps: Sequence[MappedSubmap], name: str) -> NDArray[np.float64]:
    """Diameters or heights (N,) of all landmarks; NaN where unknown."""
    columns = [getattr(one, name) for one in submaps]
    return np.concatenate(
        [
            np.empty(0),
            *(
                np.full(len(one.xy), np.nan) if column is None else np.asarray(column, np.float64)
                for one, column in zip(submaps, columns, strict=True)
            ),
        ]
    )


def _median(
    values: NDArray[np.float64], label: NDArray[np.int64], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The median (size,) of the values (N,) of each label, and its standard deviation; NaN where there are too few."""
    middle, sigma = np.full(size, np.nan), np.full(size, np.nan)
    known = np.isfinite(values)
    order = np.lexsort((values[known], label[known]))
    label, values = label[known][order], values[known][order]
    trees, begins, counts = np.unique(label, return_index=True, return_counts=True)
    middle[trees] = _middles(values, begins, counts)
    if len(trees):
        off = np.abs(values - middle[label])
        off = off[np.lexsort((off, label))]
        several = counts > 1
        spread = _SPREAD * _middles(off, begins, counts)
        # The median of normal values varies by pi / 2 times as much as their mean.
        sigma[trees[several]] = (spread * np.sqrt(np.pi / 2.0 / counts))[several]
    return middle, sigma


def _middles(values: NDArray[np.float64], begins: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The median of each run of sorted values."""
    if not len(values):
        return np.empty(0)
    return np.asarray(0.5 * (values[begins + (counts - 1) // 2] + values[begins + counts // 2]))


def _extreme(stamps: NDArray[np.float64], label: NDArray[np.int64], size: int, pick: np.ufunc) -> NDArray[np.float64]:
    """The first or last (size,) of the stamps (N,) of each label; NaN where none is known."""
    found = np.full(size, np.nan)
    pick.at(found, label, stamps)
    return found
