"""Landmarks made ready to be laid over others, or to have others laid over them."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features.describe import Features
from urquhart.verify.cells import CROWD, Cells, search_tree, sort_into_cells
from urquhart.verify.diameters import standardize_diameters
from urquhart.verify.footprint import Footprint, build_footprint

LOOSE: Final = 2.0
"""Where the trees stand far enough apart, a promising pose is tried once more with partners this much farther away."""


class LandmarkGrid(NamedTuple):
    """Landmarks by square cell, with all that the evidence for a pose needs.

    A plain tuple of arrays, because the compiler takes that as a whole.

    Attributes:
        landmarks: (N, 2) float64, metres, centred frame.
        density: (N,) float64, landmarks per square metre.
        footprint: where landmarks would have been seen.
        cells: the landmarks by cell.
        area: square metres inside the hull.
        spacing: metres, typical distance between neighbours.
        diameters: (N,) float64, standardized stem diameters, empty where they are not known; see `diameters`.
        diameter_spread: of the logarithms of the diameters.
    """

    landmarks: NDArray[np.float64]
    density: NDArray[np.float64]
    footprint: Footprint
    cells: Cells
    area: float
    spacing: float
    diameters: NDArray[np.float64]
    diameter_spread: float


def landmark_grid(features: Features, reach: float) -> LandmarkGrid:
    """Make `features` ready for verification with partners up to `reach` metres away."""
    hull, diameters = features.tessellation.hull, features.diameters
    return build_landmark_grid(features.landmarks, features.density, hull, diameters, LOOSE * reach)


@kernel
def build_landmark_grid(
    landmarks: NDArray[np.float64],
    density: NDArray[np.float32],
    outer: NDArray[np.int32],
    diameters: NDArray[np.float32],
    reach: float,
) -> LandmarkGrid:
    """The grid of landmarks (N, 2), metres, for partners up to `reach` metres away.

    `outer`: (H,) landmark indices of the hull, counter-clockwise.
    """
    cells = sort_into_cells(landmarks, reach)
    hull = landmarks[outer]
    area = 0.0
    for i in range(len(hull)):
        j = i + 1 if i + 1 < len(hull) else 0
        area += 0.5 * (hull[i, 0] * hull[j, 1] - hull[j, 0] * hull[i, 1])
    spacing = 1.0 / math.sqrt(np.median(density))
    # Of a hull that is thinner than its landmarks are exact the area may come out as nothing, or less.
    area = max(area, spacing * spacing)
    footprint = build_footprint(landmarks, hull, spacing)
    scores, spread = standardize_diameters(diameters)
    return LandmarkGrid(landmarks, density.astype(np.float64), footprint, cells, area, spacing, scores, spread)


@kernel
def nearest(grid: LandmarkGrid, x: float, y: float, reach: float) -> tuple[int, float]:
    """The landmark nearest to (x, y) within `reach` metres (at most one cell) and its squared distance; -1 if none."""
    landmarks, (starts, order, frame) = grid.landmarks, grid.cells
    columns, rows = int(frame[3]), int(frame[4])
    best, best_distance = -1, reach * reach
    fx, fy = (x - frame[0]) * frame[2], (y - frame[1]) * frame[2]
    if not (-1.0 <= fx <= columns + 1.0 and -1.0 <= fy <= rows + 1.0):
        return best, best_distance
    i, j = math.floor(fx), math.floor(fy)
    for a in range(max(i - 1, 0), min(i + 2, columns)):
        for b in range(max(j - 1, 0), min(j + 2, rows)):
            first, last = starts[a * rows + b], starts[a * rows + b + 1]
            if last - first > CROWD:
                best, best_distance = search_tree(landmarks, order[first:last], x, y, best, best_distance)
                continue
            for at in range(first, last):
                k = order[at]
                dx, dy = landmarks[k, 0] - x, landmarks[k, 1] - y
                distance = dx * dx + dy * dy
                if distance <= best_distance:
                    best, best_distance = k, distance
    return best, best_distance
