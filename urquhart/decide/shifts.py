"""Shifts of a match along the pattern of the trees, under which most landmarks fall onto landmarks again."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.verify.landmark_grid import LandmarkGrid
from urquhart.verify.pairing import pair_up


class ShiftNumbers(NamedTuple):
    """Bounds on the work of a search for shifts. Chosen by hand for about 10 ms a quarter turn, not fitted."""

    sampled: int = 500
    """Most landmarks of the query that its pattern is taken from."""
    most_cells: float = 400.0
    """Cells of shifts on either side of the middle, along each axis."""


SHIFTS: Final = ShiftNumbers()


@kernel
def shifted(
    chosen: NDArray[np.float64],
    submap: LandmarkGrid,
    best: NDArray[np.float64],
    reach: float,
    peaks: int,
    quarter: int,
) -> NDArray[np.float64]:
    """Poses (K, 3) to which `best`, turned by `quarter` quarter turns, is shifted.

    Shifts are searched around the middle of the submap. If the submap is so large that `best` lies outside that window,
    they are also searched around `best`: a row at the edge of a large stand repeats itself along the edge.

    `chosen`: (n, 2), metres, landmarks of the query, as `chosen_landmarks` returns them; `best`: (3,), x, y, yaw,
    centred frames; `reach`: metres, side of a cell; `peaks`: number of shifts, one more at the match's own rotation.
    """
    yaw = best[2] + quarter * math.pi / 2.0
    turned = turn(chosen, yaw)
    half = half_window(turned, submap.landmarks, reach)
    wanted = peaks + (quarter == 0)
    poses = np.empty((2 * wanted, 3))
    poses[:wanted, :2] = shift_peaks(turned, submap.landmarks, reach, wanted, half, np.zeros(2))
    count = wanted
    if abs(best[0]) > half[0] or abs(best[1]) > half[1]:
        poses[wanted:, :2] = shift_peaks(turned, submap.landmarks, reach, wanted, half, best[:2])
        count = 2 * wanted
    poses[:, 2] = yaw
    return poses[:count]


@kernel
def chosen_landmarks(
    query: LandmarkGrid, submap: LandmarkGrid, best: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The landmarks (K, 2) of the query that its pattern is taken from: all, or a sample of those that `best` pairs.

    Of a large query, the few trees that speak for a pose would be lost among the others.
    """
    if len(query.landmarks) <= SHIFTS.sampled:
        return query.landmarks
    paired, _, _ = pair_up(query.landmarks, submap, best[0], best[1], best[2], reach)
    return query.landmarks[paired[:: 1 + len(paired) // SHIFTS.sampled]]


@kernel
def turn(landmarks: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Landmarks (N, 2), metres, rotated about the origin by `yaw`, radians."""
    c, s = math.cos(yaw), math.sin(yaw)
    turned = np.empty_like(landmarks)
    for i in range(len(landmarks)):
        turned[i, 0] = c * landmarks[i, 0] - s * landmarks[i, 1]
        turned[i, 1] = s * landmarks[i, 0] + c * landmarks[i, 1]
    return turned


@kernel
def half_window(turned: NDArray[np.float64], submap: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Half the sides (2,), metres, of the rectangle of shifts that are searched; `cell`: metres.

    Under these shifts, the middle of the smaller footprint lies in the larger one, and at least about half of it.
    """
    half = np.empty(2)
    for axis in range(2):
        extent = max(np.ptp(submap[:, axis]), np.ptp(turned[:, axis]))
        half[axis] = min(max(0.5 * extent, 4.0 * cell), SHIFTS.most_cells * cell)
    return half


@kernel
def shift_peaks(
    turned: NDArray[np.float64],
    submap: NDArray[np.float64],
    cell: float,
    peaks: int,
    half: NDArray[np.float64],
    middle: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The `peaks` shifts (peaks, 2), metres, that bring most landmarks of the rotated query onto the submap's.

    Shifts within `half` (2,) of `middle` (2,), metres, are counted in square cells. A peak is the fullest block of two
    by two cells, so that no border splits it; its neighbourhood is cleared before the next peak.
    """
    corner = middle - half
    wide, high = int(2.0 * half[0] / cell) + 2, int(2.0 * half[1] / cell) + 2
    counts = np.zeros((wide, high), np.int32)
    for i in range(len(turned)):
        for j in range(len(submap)):
            a = (submap[j, 0] - turned[i, 0] - corner[0]) / cell
            b = (submap[j, 1] - turned[i, 1] - corner[1]) / cell
            if 0.0 <= a < wide and 0.0 <= b < high:
                counts[int(a), int(b)] += 1
    blocks = np.zeros((wide - 1, high - 1), np.int32)
    for a in range(wide - 1):
        for b in range(high - 1):
            blocks[a, b] = counts[a, b] + counts[a + 1, b] + counts[a, b + 1] + counts[a + 1, b + 1]
    found = np.empty((peaks, 2))
    for p in range(peaks):
        at = np.argmax(blocks)
        a, b = at // (high - 1), at % (high - 1)
        # The centre of mass of the four cells: the best shift may lie at the edge of the block.
        right, upper = counts[a + 1, b] + counts[a + 1, b + 1], counts[a, b + 1] + counts[a + 1, b + 1]
        whole = max(counts[a, b] + counts[a, b + 1] + right, 1)
        found[p, 0] = corner[0] + (a + 0.5 + right / whole) * cell
        found[p, 1] = corner[1] + (b + 0.5 + upper / whole) * cell
        blocks[max(a - 2, 0) : a + 3, max(b - 2, 0) : b + 3] = -1
    return found
