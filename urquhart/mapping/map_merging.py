"""Several aligned submaps merged into one map: landmarks that are the same tree become one (paper, section V-C).

The landmarks of all submaps, in the map's frame, are clustered by DBSCAN (Ester et al. 1996): landmarks closer than a
distance belong together, and so do those that a chain of such steps connects. The paper clusters landmarks closer than
0.5 m and keeps all, which is DBSCAN with a least size of one.

One rule is added. If a sensor reports two landmarks, they are two trees, however close they stand: the stems of a
coppice stool are 0.3 m apart, and with noise, a few submaps chain a row of stools into one cluster. So a landmark of
the map takes at most one landmark from each submap. If a cluster has more, its members are joined again, nearest pair
first, and no step joins two groups that have a submap in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from urquhart.se2 import SE2


@dataclass(frozen=True, slots=True, eq=False)
class MergedMap:
    """The merged landmarks of several submaps. The members of each are kept in ragged arrays.

    Attributes:
        landmarks: (L, 2) float64, metres, map frame: the mean of each landmark's members, ordered by first member.
        spread: (L,) float64, metres: root mean square distance of the members from their mean; 0 for a single member.
        submaps: (M,) int64, the submap of each member, by landmark, as its position in the list of submaps.
        indices: (M,) int64, the index of each member in its submap.
        offsets: (L + 1,) int64; landmark i has the members `offsets[i]:offsets[i + 1]`.
    """

    landmarks: NDArray[np.float64]
    spread: NDArray[np.float64]
    submaps: NDArray[np.int64]
    indices: NDArray[np.int64]
    offsets: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.landmarks)

    def members(self, i: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The members of landmark `i`: submaps (m,) int64, and landmark indices in them (m,) int64."""
        at = slice(self.offsets[i], self.offsets[i + 1])
        return self.submaps[at], self.indices[at]

    def observation_counts(self) -> NDArray[np.int64]:
        """Number of members (L,) int64 of each landmark."""
        return np.diff(self.offsets)


def merge(
    submaps: Sequence[NDArray[np.float64]],
    poses: Sequence[SE2],
    *,
    distance: float = 0.5,
    least: int = 1,
    apart: bool = True,
) -> MergedMap:
    """Merge submaps into one map (paper, section V-C).

    Args:
        submaps: (N_i, 2) float64 each, metres, each in its own frame.
        poses: `map_T_submap` of each submap.
        distance: metres, epsilon of DBSCAN.
        least: landmarks within `distance`, itself included, that make a landmark a core point. 1 keeps all landmarks; a
            larger number leaves out those that were seen too rarely.
        apart: whether two landmarks of one submap always stay two; False is plain DBSCAN.

    Raises:
        ValueError: the number of poses differs from that of submaps, or a landmark is not finite.
    """
    if len(submaps) != len(poses):
        raise ValueError(f"{len(submaps)} submaps but {len(poses)} poses: give one for each submap")
    points = np.concatenate(
        [np.empty((0, 2)), *(pose.apply(xy) for xy, pose in zip(submaps, poses, strict=True) if len(xy))]
    )
    if not np.isfinite(points).all():
        raise ValueError("landmarks and poses must be finite numbers")
    sizes = [len(xy) for xy in submaps]
    owner = np.repeat(np.arange(len(submaps)), sizes)
    index = np.arange(len(points)) - np.repeat(np.cumsum([0, *sizes])[:-1], sizes)
    labels = dbscan(points, distance, least)
    if apart:
        labels = keep_apart(points, owner, labels, distance)
    return _collect(points, owner, index, labels)


def dbscan(points: NDArray[np.float64], distance: float, least: int = 1) -> NDArray[np.int64]:
    """The cluster (N,) int64 of each point (N, 2), metres, numbered by first member; -1 for noise (Ester et al. 1996).

    Points with at least `least` points within `distance`, metres, themselves included, are core points. Core points
    within `distance` of each other share a cluster. Any other point joins the cluster of its nearest core point, or is
    noise if none is within `distance`. (In the original, the order of the data decides between two clusters.)
    """
    count = len(points)
    if count == 0:
        return np.empty(0, np.int64)
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray").astype(np.int64)
    degree = 1 + np.bincount(pairs.ravel(), minlength=count)
    core = degree >= least
    inner = pairs[core[pairs].all(axis=1)]
    links = coo_array((np.ones(len(inner), np.int8), (inner[:, 0], inner[:, 1])), shape=(count, count))
    _, components = connected_components(links, directed=False)
    labels = np.where(core, np.asarray(components, np.int64), np.int64(-1))
    border = np.flatnonzero(~core)
    if len(border) and core.any():
        heart = np.flatnonzero(core)
        gap, nearest = cKDTree(points[heart]).query(points[border])
        near = gap <= distance
        labels[border[near]] = labels[heart[np.asarray(nearest)[near]]]
    return renumber(labels)


def keep_apart(
    points: NDArray[np.float64], owner: NDArray[np.int64], labels: NDArray[np.int64], distance: float
) -> NDArray[np.int64]:
    """New labels (N,), with clusters split such that none holds two points of one owner (N,).

    `points` (N, 2), metres, within `distance` of each other are joined again, nearest pair first.
    """
    known = np.flatnonzero(labels >= 0)
    _, first, times = np.unique(
        np.column_stack([labels[known], owner[known]]), axis=0, return_index=True, return_counts=True
    )
    crowded = np.unique(labels[known][first[times > 1]])
    if not len(crowded):
        return labels
    members = np.flatnonzero(np.isin(labels, crowded))
    near = cKDTree(points[members]).query_pairs(distance, output_type="ndarray")
    pairs = np.asarray(members[near], np.int64)
    pairs = pairs[labels[pairs[:, 0]] == labels[pairs[:, 1]]]
    gap = np.hypot(*(points[pairs[:, 0]] - points[pairs[:, 1]]).T)
    group = {i: [i] for i in members.tolist()}
    for a, b in pairs[np.lexsort((pairs[:, 1], pairs[:, 0], gap))].tolist():
        ours, theirs = group[a], group[b]
        if ours is theirs or set(owner[ours].tolist()) & set(owner[theirs].tolist()):
            continue
        ours.extend(theirs)
        for i in theirs:
            group[i] = ours
    parted = labels.copy()
    for i in members.tolist():
        parted[i] = len(points) + min(group[i])
    return renumber(parted)


def renumber(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same clusters, numbered by their first point; -1 stays."""
    unique, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(unique), np.int64)
    rank[np.argsort(np.where(unique < 0, -1, first))] = np.arange(len(unique))
    return np.asarray(rank[inverse] - int((unique < 0).any()))


def _collect(
    points: NDArray[np.float64], owner: NDArray[np.int64], index: NDArray[np.int64], labels: NDArray[np.int64]
) -> MergedMap:
    order = np.argsort(labels, kind="stable")[int((labels < 0).sum()) :]
    label = labels[order]
    sizes = np.bincount(label)
    mean = np.column_stack([np.bincount(label, points[order, k]) for k in range(2)]) / sizes[:, None]
    away = ((points[order] - mean[label]) ** 2).sum(axis=1)
    spread = np.sqrt(np.bincount(label, away) / sizes)
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    return MergedMap(mean.reshape(-1, 2), spread, owner[order], index[order], offsets)
