"""The robust level: quads, two Delaunay triangles that share an edge.

A polygon survives only while every one of its vertices is seen and every edge about it keeps its place. A quad needs
four landmarks, and losing *other* landmarks never breaks a Delaunay triangle (its circumcircle stays empty). Its four
sides and its diagonal fix its shape; its direction gives the rotation of a match for free.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.se2 import fit

_LONGEST: Final = 4.0
"""Quads with a side longer than this many median edges are slivers along the hull, gone with the next tree in view."""


@kernel
def quads_of(
    landmarks: NDArray[np.float64], triangles: NDArray[np.int32], neighbours: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Quads (Q, 4) int32, landmark indices, counter-clockwise; the first and the third end the shared edge.

    `neighbours` (T, 3) int32: the triangle opposite to each vertex, -1 outside the hull.
    """
    count = len(triangles)
    lengths = np.empty(3 * count)
    for t in range(count):
        for k in range(3):
            a, b = triangles[t, k], triangles[t, (k + 1) % 3]
            lengths[3 * t + k] = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
    limit = _LONGEST * np.median(lengths)
    quads = np.empty((3 * count, 4), np.int32)
    kept = 0
    for t in range(count):
        if max(lengths[3 * t], lengths[3 * t + 1], lengths[3 * t + 2]) > limit:
            continue
        for k in range(3):
            other = neighbours[t, k]
            if other <= t or max(lengths[3 * other], lengths[3 * other + 1], lengths[3 * other + 2]) > limit:
                continue
            apex = -1
            for m in range(3):
                if neighbours[other, m] == t:
                    apex = triangles[other, m]
            quads[kept, 0], quads[kept, 1] = triangles[t, (k + 1) % 3], apex
            quads[kept, 2], quads[kept, 3] = triangles[t, (k + 2) % 3], triangles[t, k]
            kept += 1
    return quads[:kept].copy()


@kernel
def measure(
    landmarks: NDArray[np.float64], quads: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Five lengths (Q, 5) float32, metres (four sides, then the diagonal), and the direction (Q,) of the diagonal.

    Directions are radians, counter-clockwise from the x axis, from the first landmark to the third.
    """
    lengths, directions = np.empty((len(quads), 5), np.float32), np.empty(len(quads), np.float32)
    for q in range(len(quads)):
        for k in range(4):
            a, b = quads[q, k], quads[q, (k + 1) % 4]
            lengths[q, k] = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
        dx = landmarks[quads[q, 2], 0] - landmarks[quads[q, 0], 0]
        dy = landmarks[quads[q, 2], 1] - landmarks[quads[q, 0], 1]
        lengths[q, 4], directions[q] = math.hypot(dx, dy), math.atan2(dy, dx)
    return lengths, directions


@kernel
def align_quads(
    query: NDArray[np.float64],
    query_quads: NDArray[np.int32],
    submap: NDArray[np.float64],
    submap_quads: NDArray[np.int32],
    hits_query: NDArray[np.int32],
    hits_submap: NDArray[np.int32],
    turned: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transforms (H, 3), x, y, yaw of submap_T_query, from query quads onto submap quads, and misfits (H,), metres.

    `hits_query`, `hits_submap` (H,): which quads; `turned` (H,): the submap's quad is read from its third landmark on.
    """
    transforms, misfit = np.empty((len(hits_query), 3)), np.empty(len(hits_query))
    first, second = np.empty(4, np.int64), np.empty(4, np.int64)
    for h in range(len(hits_query)):
        shift = 2 if turned[h] else 0
        for k in range(4):
            first[k] = query_quads[hits_query[h], k]
            second[k] = submap_quads[hits_submap[h], (k + shift) % 4]
        x, y, yaw = fit(query, submap, first, second)
        c, s = math.cos(yaw), math.sin(yaw)
        total = 0.0
        for k in range(4):
            i, j = first[k], second[k]
            dx = c * query[i, 0] - s * query[i, 1] + x - submap[j, 0]
            dy = s * query[i, 0] + c * query[i, 1] + y - submap[j, 1]
            total += dx * dx + dy * dy
        transforms[h, 0], transforms[h, 1], transforms[h, 2] = x, y, yaw
        misfit[h] = math.sqrt(0.25 * total)
    return transforms, misfit
