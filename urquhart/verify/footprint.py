"""The footprint of a submap: the area in which a tree would have been seen.

A robot's track bends, and a plot may have a lake in it. Where no landmark is near, perhaps nobody looked, so a missing
partner there is no evidence against a pose.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


class FootprintNumbers(NamedTuple):
    """What counts as near a landmark. Chosen by hand, not fitted."""

    near: float = 1.5
    """Largest distance from the nearest landmark inside the footprint, in distances between trees."""
    coarse: float = 0.5
    """Side of a cell of the footprint, in distances between trees."""


FOOTPRINT: Final = FootprintNumbers()


@kernel
def build_cover(landmarks: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """`cover` and `cover_frame` of a `LandmarkGrid`: which square cells are near enough to a landmark.

    `landmarks`: (N, 2), metres, centred frame; `spacing`: metres, typical distance between neighbours.
    """
    low_x, low_y = landmarks[:, 0].min(), landmarks[:, 1].min()
    width, height = landmarks[:, 0].max() - low_x, landmarks[:, 1].max() - low_y
    size = max(FOOTPRINT.coarse * spacing, max(width, height) / 256.0)
    columns, rows = int(width / size) + 1, int(height / size) + 1
    reach = FOOTPRINT.near * spacing / size
    around = int(reach) + 1
    cover = np.zeros((columns, rows), np.uint8)
    for i in range(len(landmarks)):
        a, b = (landmarks[i, 0] - low_x) / size, (landmarks[i, 1] - low_y) / size
        for c in range(max(int(a) - around, 0), min(int(a) + around + 1, columns)):
            for d in range(max(int(b) - around, 0), min(int(b) + around + 1, rows)):
                if (c + 0.5 - a) ** 2 + (d + 0.5 - b) ** 2 <= reach * reach:
                    cover[c, d] = 1
    return cover, np.array([low_x, low_y, 1.0 / size])


@kernel
def is_inside_hull(hull: NDArray[np.float64], x: float, y: float) -> bool:
    """Whether (x, y) lies in a convex polygon (H, 2), counter-clockwise, or on its edge; by bisection."""
    n = len(hull)
    if side_of_edge(hull, 0, 1, x, y) < 0.0 or side_of_edge(hull, n - 1, 0, x, y) < 0.0:
        return False
    low, high = 1, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if side_of_edge(hull, 0, middle, x, y) >= 0.0:
            low = middle
        else:
            high = middle
    return side_of_edge(hull, low, high, x, y) >= 0.0


@kernel
def side_of_edge(hull: NDArray[np.float64], i: int, j: int, x: float, y: float) -> float:
    """Positive if (x, y) lies to the left of the line from corner `i` to corner `j` of `hull` (H, 2)."""
    return float((hull[j, 0] - hull[i, 0]) * (y - hull[i, 1]) - (hull[j, 1] - hull[i, 1]) * (x - hull[i, 0]))
