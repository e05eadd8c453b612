"""The robust level: quads, two Delaunay triangles that share an edge.

A polygon survives only while every one of its vertices is seen and every edge about it keeps its place. A quad needs
four landmarks, and losing *other* landmarks never breaks a Delaunay triangle (its circumcircle stays empty). Its four
sides and its diagonal fix its shape, its direction the rotation of a match.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


class QuadNumbers(NamedTuple):
    """Which quads are kept. Chosen by hand, not fitted."""

    longest: float = 4.0
    """Quads with a side longer than this many median edges are slivers along the hull, gone with the next tree in
    view."""


QUADS: Final = QuadNumbers()


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
    limit = QUADS.longest * np.median(lengths)
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
