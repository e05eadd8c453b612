"""The landmarks of a submap, prepared for comparison with those of another."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features.describe import Features
from urquhart.verify.cell_sorting import CROWD, search_tree, sort_into_cells
from urquhart.verify.diameters import standardize_diameters
from urquhart.verify.footprint import build_cover, is_inside_hull


class GridNumbers(NamedTuple):
    """Numbers of a `LandmarkGrid`. Chosen by hand, not fitted."""

    loose: float = 2.0
    """A promising pose is tried again with partners up to this many times as far away, if the trees stand far enough
    apart: field surveys by compass and tape are that noisy."""
    many_corners: int = 64
    """Corners of a hull beyond which bisection is faster than a test of each side; hulls in forests have 10 to 30."""


GRID: Final = GridNumbers()


class LandmarkGrid(NamedTuple):
    """Landmarks by square cell, with everything that the evidence for a pose needs.

    It is a plain tuple of arrays, which kernels take as a whole. It is flat: with nested tuples for the footprint and
    the cells, scoring a pose takes a third longer.

    Attributes:
        landmarks: (N, 2) float64, metres, centred frame.
        density: (N,) float64, landmarks per square metre.
        hull: (H, 2) float64, metres, centred frame, convex hull, counter-clockwise: it contains the footprint.
        cover: (A, B) uint8, 1 for square cells that are near enough to a landmark to be part of the footprint.
        cover_frame: (3,) float64: lowest x and y of `cover`, metres, and cells per metre.
        cell_starts: (C + 1,) int64, where the landmarks of each square cell begin in `cell_order`, column by column.
        cell_order: (N,) int64, landmark indices by cell.
        cell_frame: (5,) float64: lowest x and y of the cells, metres, cells per metre, columns, rows.
        area: square metres inside the hull.
        spacing: metres, typical distance between neighbours.
        diameters: (N,) float64, scores of stem diameters, empty if they are not known; see `standardize_diameters`.
        diameter_spread: spread of the logarithms of the diameters.
    """

    landmarks: NDArray[np.float64]
    density: NDArray[np.float64]
    hull: NDArray[np.float64]
    cover: NDArray[np.uint8]
    cover_frame: NDArray[np.float64]
    cell_starts: NDArray[np.int64]
    cell_order: NDArray[np.int64]
    cell_frame: NDArray[np.float64]
    area: float
    spacing: float
    diameters: NDArray[np.float64]
    diameter_spread: float


def landmark_grid(features: Features, reach: float) -> LandmarkGrid:
    """Prepare `features` for verification with partners up to `reach` metres away."""
    hull, diameters = features.tessellation.hull, features.diameters
    return build_landmark_grid(features.landmarks, features.density, hull, diameters, GRID.loose * reach)


@kernel
def build_landmark_grid(
    landmarks: NDArray[np.float64],
    density: NDArray[np.float32],
    outer: NDArray[np.int32],
    diameters: NDArray[np.float32],
    reach: float,
) -> LandmarkGrid:
    """The `LandmarkGrid` of landmarks (N, 2), metres, centred frame, for partners up to `reach` metres away.

    `density`, `diameters`: (N,), as in `Features`; `outer`: (H,), landmark indices of the hull, counter-clockwise.
    """
    starts, order, frame = sort_into_cells(landmarks, reach)
    hull = landmarks[outer]
    area = 0.0
    for i in range(len(hull)):
        j = i + 1 if i + 1 < len(hull) else 0
        area += 0.5 * (hull[i, 0] * hull[j, 1] - hull[j, 0] * hull[i, 1])
    spacing = 1.0 / math.sqrt(np.median(density))
    # For a hull that is thinner than rounding errors, the computed area may be zero or negative.
    area = max(area, spacing * spacing)
    cover, cover_frame = build_cover(landmarks, spacing)
    scores, spread = standardize_diameters(diameters)
    dense = density.astype(np.float64)
    return LandmarkGrid(landmarks, dense, hull, cover, cover_frame, starts, order, frame, area, spacing, scores, spread)


@kernel
def is_inside(grid: LandmarkGrid, x: float, y: float) -> bool:
    """Whether (x, y), metres, centred frame, lies in the footprint: near a landmark, and in the hull or on its edge."""
    cover, frame, hull = grid.cover, grid.cover_frame, grid.hull
    a, b = math.floor((x - frame[0]) * frame[2]), math.floor((y - frame[1]) * frame[2])
    if a < 0 or b < 0 or a >= cover.shape[0] or b >= cover.shape[1] or cover[a, b] == 0:
        return False
    n = len(hull)
    if n > GRID.many_corners:
        return is_inside_hull(hull, x, y)
    # In a function of its own, this loop makes scoring a pose take half as long again.
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        if (hull[j, 0] - hull[i, 0]) * (y - hull[i, 1]) - (hull[j, 1] - hull[i, 1]) * (x - hull[i, 0]) < 0.0:
            return False
    return True


@kernel
def nearest(grid: LandmarkGrid, x: float, y: float, reach: float) -> tuple[int, float]:
    """The landmark nearest to (x, y), metres, and its squared distance; -1 if there is none within `reach`.

    `reach`: metres, at most that of `landmark_grid` times `GRID.loose`.
    """
    landmarks, starts, order, frame = grid.landmarks, grid.cell_starts, grid.cell_order, grid.cell_frame
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
