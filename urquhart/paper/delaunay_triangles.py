"""Delaunay triangles described by area and perimeter (Li et al. 2020, as the paper describes their method).

A triangle's descriptor is its area and perimeter, followed by those of the three triangles that share a side with it.
The neighbours have no natural order, so they are sorted by area. A triangle on the hull has fewer than three, and is
left out. Correspondences are found as in the paper's comparison: triangles nearer than a threshold, then edges by
length, then landmarks by the edges they share. If several triangles disagree, the most frequent claim wins.

Areas are in square metres, perimeters in metres. The threshold bounds the squared distance of two descriptors, as in
the paper, which found 100 best for this method.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from urquhart._kernel import kernel
from urquhart.paper.matching import assign_edges, keep_one_to_one

_LEAST = 4
"""Fewest landmarks of a triangulation with an inner triangle."""


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """Inner Delaunay triangles of one observation.

    Attributes:
        landmarks: (N, 2) float64, metres, the observation's frame.
        triangles: (T, 3) int32, landmark indices.
        descriptors: (T, 8) float64: area (square metres) and perimeter (metres) of the triangle, then of its three
            neighbours, the largest first.
    """

    landmarks: NDArray[np.float64]
    triangles: NDArray[np.int32]
    descriptors: NDArray[np.float64]


def describe_delaunay(landmarks: NDArray[np.float64]) -> Triangles:
    """The inner triangles of landmarks (N, 2) float64, metres, any rigid frame; none if all lie on a line."""
    try:
        delaunay = Delaunay(landmarks) if len(landmarks) >= _LEAST else None
    except QhullError:
        delaunay = None
    if delaunay is None:
        return Triangles(landmarks, np.empty((0, 3), np.int32), np.empty((0, 8)))
    triangles, neighbours = delaunay.simplices, delaunay.neighbors
    corners = landmarks[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area, perimeter = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), sides.sum(axis=1)
    inner = np.flatnonzero((neighbours >= 0).all(axis=1))
    around = neighbours[inner]
    around = np.take_along_axis(around, np.argsort(-area[around], axis=1, kind="stable"), axis=1)
    own = np.column_stack([area[inner], perimeter[inner]])
    theirs = np.stack([area[around], perimeter[around]], axis=2).reshape(len(inner), 6)
    return Triangles(landmarks, triangles[inner].astype(np.int32), np.concatenate([own, theirs], axis=1))


def nearest_triangles(first: Triangles, second: Triangles) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each triangle of the first, the nearest of the second (T,) int64, and their squared distance (T,)."""
    if not len(first.triangles) or not len(second.triangles):
        return np.zeros(len(first.triangles), np.int64), np.full(len(first.triangles), np.inf)
    distance, nearest = cKDTree(second.descriptors).query(first.descriptors)
    return np.asarray(nearest, np.int64), np.asarray(distance, np.float64) ** 2


def match_triangles(
    first: Triangles, second: Triangles, threshold: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One-to-one correspondences (K,), (K,) int64, from triangles with a squared distance below `threshold`."""
    return link_triangles(first, second, *nearest_triangles(first, second), threshold)


def link_triangles(
    first: Triangles,
    second: Triangles,
    nearest: NDArray[np.int64],
    distance: NDArray[np.float64],
    threshold: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The result of `match_triangles` from that of `nearest_triangles` (T,), (T,): to try several thresholds."""
    rows = np.flatnonzero(distance < threshold)
    claims = claim_corners(first.landmarks, first.triangles, rows, second.landmarks, second.triangles, nearest[rows])
    return keep_one_to_one(claims, len(first.landmarks), len(second.landmarks))


@kernel
def claim_corners(
    first: NDArray[np.float64],
    first_triangles: NDArray[np.int32],
    rows: NDArray[np.int64],
    second: NDArray[np.float64],
    second_triangles: NDArray[np.int32],
    partners: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Claims (3 K, 2) of K pairs of triangles: a landmark of the first, and its partner among those of the second.

    `first`, `second`: landmarks (N, 2), (M, 2), metres; their triangles (T, 3); `rows`, `partners`: (K,), the pairs.
    """
    claims, mapping = np.empty((3 * len(rows), 2), np.int64), np.empty(3, np.int64)
    for at in range(len(rows)):
        t, u = rows[at], partners[at]
        assign_edges(first, first_triangles[t], second, second_triangles[u], mapping)
        for k in range(3):
            claims[3 * at + k, 0] = first_triangles[t, k]
            claims[3 * at + k, 1] = second_triangles[u, mapping[k]]
    return claims
