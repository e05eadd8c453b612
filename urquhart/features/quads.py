"""Quads: two Delaunay triangles that share an edge. They are the most robust features.

A polygon is recognised only if every vertex is seen and every edge around it stays. A quad needs four landmarks, and
losing *other* landmarks never breaks a Delaunay triangle, because its circumcircle stays empty. The four sides and the
diagonal fix the shape of a quad; the direction of the diagonal gives the rotation of a match.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


class QuadNumbers(NamedTuple):
    """Which quads are kept. Chosen by hand, not fitted."""

    longest: float = 4.0
    """Quads with a side longer than this many median edges are left out: they are slivers along the hull, and the next
    tree in view breaks them."""


QUADS: Final = QuadNumbers()


@kernel
def quads_of(
    landmarks: NDArray[np.float64], triangles: NDArray[np.int32], neighbours: NDArray[np.int32]
) -> NDArray[np.int32]:
    """The quads of a triangulation: (Q, 4) int32, landmark indices, counter-clockwise.

    The first and the third landmark are the ends of the shared edge.

    Args:
        landmarks: (N, 2) float64, metres.
        triangles: (T, 3) int32, landmark indices, counter-clockwise.
        neighbours: (T, 3) int32, the triangle opposite to each vertex, -1 outside the hull.
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
