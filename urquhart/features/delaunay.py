"""Delaunay triangulation of landmarks (SciPy's Qhull): counter-clockwise triangles, in bounded time for any shape."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from urquhart._kernel import kernel
from urquhart.features.landmark_checks import LandmarkError


class DelaunayNumbers(NamedTuple):
    """When the triangulation is joggled. Measured with SciPy's Qhull; no command repeats it."""

    most_exact: int = 1_000
    """Landmarks up to which the triangulation is exact. If many landmarks lie on one circle or on one side of the
    hull, an exact one takes quadratic time: 0.1 s for 1,000, 40 s for 20,000. Larger sets are first joggled, by some
    1e-11 of their extent. That takes 0.1 to 0.7 s for 20,000 in any shape, and only decides between triangulations
    that are equally good."""


DELAUNAY: Final = DelaunayNumbers()
_EXACT: Final = "Qbb Qc Qz Q12"
_JOGGLE: Final = "Qbb Q12 QJ"


def triangulate(landmarks: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The Delaunay triangulation of landmarks (N, 2) float64, metres, centred near the origin.

    Returns:
        Triangles (T, 3) int32, landmark indices, counter-clockwise; and neighbours (T, 3) int32, the triangle opposite
        to each vertex, -1 outside the hull.

    Raises:
        LandmarkError: code `collinear`: the landmarks are so close to one line that no triangulation exists.
    """
    try:
        found = Delaunay(landmarks, qhull_options=_EXACT if len(landmarks) <= DELAUNAY.most_exact else _JOGGLE)
    except QhullError as error:
        raise LandmarkError("collinear", "the landmarks are too close to one line to be triangulated") from error
    triangles = np.array(found.simplices, dtype=np.int32)
    neighbours = np.array(found.neighbors, dtype=np.int32)
    orient(landmarks, triangles, neighbours)
    return triangles, neighbours


@kernel
def orient(landmarks: NDArray[np.float64], triangles: NDArray[np.int32], neighbours: NDArray[np.int32]) -> None:
    """Order the vertices of all triangles (T, 3) counter-clockwise, in place; `neighbours` (T, 3) follow.

    The sign of the largest triangle's area decides, and its orientation is passed on over shared edges. A flat
    triangle's own sign would depend on rounding, and one wrong orientation breaks every walk along edges.
    """
    count = len(triangles)
    largest, start = -1.0, 0
    for t in range(count):
        area = abs(_doubled_area(landmarks, triangles, t))
        if area > largest:
            largest, start = area, t
    if _doubled_area(landmarks, triangles, start) < 0.0:
        _turn_over(triangles, neighbours, start)
    queue, seen = np.empty(count, np.int32), np.zeros(count, np.bool_)
    queue[0], seen[start] = start, True
    known, at = 1, 0
    while at < known:
        t = queue[at]
        at += 1
        for k in range(3):
            other = neighbours[t, k]
            if other < 0 or seen[other]:
                continue
            a, b = triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
            for m in range(3):
                # Two triangles with the same orientation run along a shared edge in opposite directions.
                if triangles[other, m] == a and triangles[other, (m + 1) % 3] == b:
                    _turn_over(triangles, neighbours, other)
                    break
            seen[other] = True
            queue[known] = other
            known += 1


@kernel
def _doubled_area(landmarks: NDArray[np.float64], triangles: NDArray[np.int32], t: int) -> float:
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    ux, uy = landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1]
    vx, vy = landmarks[c, 0] - landmarks[a, 0], landmarks[c, 1] - landmarks[a, 1]
    return float(ux * vy - uy * vx)


@kernel
def _turn_over(triangles: NDArray[np.int32], neighbours: NDArray[np.int32], t: int) -> None:
    triangles[t, 1], triangles[t, 2] = triangles[t, 2], triangles[t, 1]
    neighbours[t, 1], neighbours[t, 2] = neighbours[t, 2], neighbours[t, 1]
