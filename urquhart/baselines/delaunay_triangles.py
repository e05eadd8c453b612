"""Delaunay triangles described by area and perimeter (Li et al. 2020, as the paper describes their method).

A triangle's descriptor is its area and perimeter followed by those of the three triangles that share a side with it.
The neighbours have no natural order, so they are sorted by area; a triangle on the hull has fewer than three and is
left out. Correspondences follow as in the paper's comparison: triangles nearer than a threshold, edges by length, landmarks
by the edges they share, the most frequent claim where several triangles disagree.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from urquhart._kernel import kernel
from urquhart.matching import assign_edges, settle_claims


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """Inner Delaunay triangles (T, 3) int32 of landmarks (N, 2), metres, with descriptors (T, 8) float64."""

    landmarks: NDArray[np.float64]
    triangles: NDArray[np.int32]
    descriptors: NDArray[np.float64]


def describe_delaunay(landmarks: NDArray[np.float64]) -> Triangles:
    """Triangles of landmarks (N, 2) float64, metres; areas in square metres, perimeters in metres."""
    delaunay = Delaunay(landmarks)
    triangles, neighbours = delaunay.simplices, delaunay.neighbors
    corners = landmarks[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area, perimeter = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), sides.sum(axis=1)
    inner = np.flatnonzero((neighbours >= 0).all(axis=1))
    around = neighbours[inner]
    around = np.take_along_axis(around, np.argsort(area[around], axis=1, kind="stable"), axis=1)
    own = np.column_stack([area[inner], perimeter[inner]])
    theirs = np.stack([area[around], perimeter[around]], axis=2).reshape(len(inner), 6)
    return Triangles(landmarks, triangles[inner].astype(np.int32), np.concatenate([own, theirs], axis=1))


def match_triangles(
    first: Triangles, second: Triangles, threshold: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Landmark correspondences (K,), (K,) int64 from each triangle's nearest within `threshold` (squared distance)."""
    if not len(first.triangles) or not len(second.triangles):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    distance, nearest = cKDTree(second.descriptors).query(first.descriptors)
    rows = np.flatnonzero(distance**2 < threshold)
    claims = claim_corners(
        first.landmarks, first.triangles, rows, second.landmarks, second.triangles, np.asarray(nearest)[rows]
    )
    return settle_claims(claims, len(first.landmarks), len(second.landmarks))


@kernel
def claim_corners(
    first: NDArray[np.float64],
    first_triangles: NDArray[np.int32],
    rows: NDArray[np.int64],
    second: NDArray[np.float64],
    second_triangles: NDArray[np.int32],
    partners: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Claims (3 K, 2) of K triangle pairs: a landmark of the first and the landmark of the second it would be."""
    claims, mapping = np.empty((3 * len(rows), 2), np.int64), np.empty(3, np.int64)
    for at in range(len(rows)):
        t, u = rows[at], partners[at]
        assign_edges(first, first_triangles, t, second, second_triangles, u, mapping)
        for k in range(3):
            claims[3 * at + k, 0] = first_triangles[t, k]
            claims[3 * at + k, 1] = second_triangles[u, mapping[k]]
    return claims
