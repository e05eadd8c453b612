"""Which landmark is which under a transform: one-to-one partners, and the transform that fits them best."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.se2 import fit
from urquhart.verify.cells import CROWD, build_grid, search_tree
from urquhart.verify.diameters import score_diameters

_REFINEMENTS: Final = 4
_NEAR: Final = 1.5
"""Distances between trees: what is farther from every landmark is no part of the footprint."""
_MANY_CORNERS: Final = 64
"""Corners of a hull beyond which bisection is faster than asking at each side; hulls of forests have 10 to 30."""
_COARSE: Final = 0.5
"""Distances between trees: side of a cell of the footprint."""


class Pattern(NamedTuple):
    """Landmarks ready to be laid over others, or to have others laid over them.

    A plain tuple of arrays, because that is what the compiler takes whole.

    Attributes:
        landmarks: (N, 2) float64, metres, centred frame.
        density: (N,) float64, landmarks per square metre.
        hull: (H, 2) float64, metres, counter-clockwise: what the footprint lies in.
        cover: (A, B) uint8, square cells that are near enough to a landmark to be of the footprint.
        corner: (3,) float64: lowest x, lowest y, cells per metre of `cover`.
        cells: (C + 1,) int64, where each square cell's landmarks begin in `order`.
        order: (N,) int64, landmark indices by cell.
        grid: (5,) float64: lowest x, lowest y, cells per metre, columns, rows.
        area: square metres inside the hull.
        spacing: metres, typical distance between neighbours.
        sizes: (N,) float64, scores of the diameters, empty where they are not known; see `diameters`.
        spread: of the logarithms of the diameters.
    """

    landmarks: NDArray[np.float64]
    density: NDArray[np.float64]
    hull: NDArray[np.float64]
    cover: NDArray[np.uint8]
    corner: NDArray[np.float64]
    cells: NDArray[np.int64]
    order: NDArray[np.int64]
    grid: NDArray[np.float64]
    area: float
    spacing: float
    sizes: NDArray[np.float64]
    spread: float


@kernel
def lay_out(
    landmarks: NDArray[np.float64],
    density: NDArray[np.float32],
    outer: NDArray[np.int32],
    diameters: NDArray[np.float32],
    reach: float,
) -> Pattern:
    """The `Pattern` of landmarks (N, 2), metres, with the hull `outer` (H,), for partners up to `reach` metres away."""
    cells, order, grid = build_grid(landmarks, reach)
    hull = landmarks[outer]
    area = 0.0
    for i in range(len(hull)):
        j = i + 1 if i + 1 < len(hull) else 0
        area += 0.5 * (hull[i, 0] * hull[j, 1] - hull[j, 0] * hull[i, 1])
    spacing = 1.0 / math.sqrt(np.median(density))
    # Of a hull that is thinner than its landmarks are exact the area may come out as nothing, or less.
    area = max(area, spacing * spacing)
    cover, corner = build_cover(landmarks, spacing)
    sizes, spread = score_diameters(diameters)
    return Pattern(
        landmarks, density.astype(np.float64), hull, cover, corner, cells, order, grid, area, spacing, sizes, spread
    )


@kernel
def build_cover(landmarks: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Cells within `_NEAR` distances between trees of a landmark: `cover` and `corner` of a `Pattern`.

    A robot's track bends, a plot has a lake in it: where no landmark is near, nobody need have looked.
    """
    low_x, low_y = landmarks[:, 0].min(), landmarks[:, 1].min()
    width, height = landmarks[:, 0].max() - low_x, landmarks[:, 1].max() - low_y
    size = max(_COARSE * spacing, max(width, height) / 256.0)
    columns, rows = int(width / size) + 1, int(height / size) + 1
    reach = _NEAR * spacing / size
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
def inside(pattern: Pattern, x: float, y: float) -> bool:
    """Whether (x, y) lies in the footprint: near a landmark, and in the hull, its edge included."""
    cover, corner, hull = pattern.cover, pattern.corner, pattern.hull
    a, b = math.floor((x - corner[0]) * corner[2]), math.floor((y - corner[1]) * corner[2])
    if a < 0 or b < 0 or a >= cover.shape[0] or b >= cover.shape[1] or cover[a, b] == 0:
        return False
    n = len(hull)
    if n > _MANY_CORNERS:
        return inside_hull(hull, x, y)
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        if (hull[j, 0] - hull[i, 0]) * (y - hull[i, 1]) - (hull[j, 1] - hull[i, 1]) * (x - hull[i, 0]) < 0.0:
            return False
    return True


@kernel
def inside_hull(hull: NDArray[np.float64], x: float, y: float) -> bool:
    """Whether (x, y) lies in a convex polygon (H, 2), counter-clockwise, its edge included: by bisection."""
    n = len(hull)
    if beside(hull, 0, 1, x, y) < 0.0 or beside(hull, n - 1, 0, x, y) < 0.0:
        return False
    low, high = 1, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if beside(hull, 0, middle, x, y) >= 0.0:
            low = middle
        else:
            high = middle
    return beside(hull, low, high, x, y) >= 0.0


@kernel
def beside(hull: NDArray[np.float64], i: int, j: int, x: float, y: float) -> float:
    """Above zero where (x, y) lies to the left of the line from corner `i` to corner `j`."""
    return float((hull[j, 0] - hull[i, 0]) * (y - hull[i, 1]) - (hull[j, 1] - hull[i, 1]) * (x - hull[i, 0]))


@kernel
def nearest(pattern: Pattern, x: float, y: float, reach: float) -> tuple[int, float]:
    """The landmark nearest to (x, y) within `reach` metres (at most one cell) and its squared distance; -1 if none."""
    landmarks, cells, order, grid = pattern.landmarks, pattern.cells, pattern.order, pattern.grid
    columns, rows = int(grid[3]), int(grid[4])
    best, best_distance = -1, reach * reach
    fx, fy = (x - grid[0]) * grid[2], (y - grid[1]) * grid[2]
    if not (-1.0 <= fx <= columns + 1.0 and -1.0 <= fy <= rows + 1.0):
        return best, best_distance
    i, j = math.floor(fx), math.floor(fy)
    for a in range(max(i - 1, 0), min(i + 2, columns)):
        for b in range(max(j - 1, 0), min(j + 2, rows)):
            first, last = cells[a * rows + b], cells[a * rows + b + 1]
            if last - first > CROWD:
                best, best_distance = search_tree(landmarks, order, first, last, x, y, best, best_distance)
                continue
            for at in range(first, last):
                k = order[at]
                dx, dy = landmarks[k, 0] - x, landmarks[k, 1] - y
                distance = dx * dx + dy * dy
                if distance <= best_distance:
                    best, best_distance = k, distance
    return best, best_distance


@kernel
def count_inliers(
    query: NDArray[np.float64],
    submap: Pattern,
    transforms: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """A quick score (H,) for many transforms (H, 3): partners within `reach`, each worth 1 down to 0 at `reach`."""
    scores = np.zeros(len(transforms))
    for h in range(len(transforms)):
        c, s = math.cos(transforms[h, 2]), math.sin(transforms[h, 2])
        for i in range(len(query)):
            x = c * query[i, 0] - s * query[i, 1] + transforms[h, 0]
            y = s * query[i, 0] + c * query[i, 1] + transforms[h, 1]
            k, distance = nearest(submap, x, y, reach)
            if k >= 0:
                scores[h] += 1.0 - distance / (reach * reach)
    return scores


@kernel
def pair_up(
    query: NDArray[np.float64],
    submap: Pattern,
    x: float,
    y: float,
    yaw: float,
    reach: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """One-to-one partners under a transform: each query landmark's nearest, kept by the nearest of those that claim it.

    Returns:
        Query indices (K,), submap indices (K,), squared distances (K,).
    """
    n = len(query)
    c, s = math.cos(yaw), math.sin(yaw)
    partner, distance = np.full(n, -1, np.int64), np.empty(n)
    owner = np.full(len(submap.landmarks), -1, np.int64)
    for i in range(n):
        px, py = c * query[i, 0] - s * query[i, 1] + x, s * query[i, 0] + c * query[i, 1] + y
        k, distance[i] = nearest(submap, px, py, reach)
        if k >= 0:
            partner[i] = k
            if owner[k] < 0 or distance[i] < distance[owner[k]]:
                owner[k] = i
    kept = 0
    first, second, squared = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n)
    for i in range(n):
        k = partner[i]
        if k >= 0 and owner[k] == i:
            first[kept], second[kept], squared[kept] = i, k, distance[i]
            kept += 1
    return first[:kept].copy(), second[:kept].copy(), squared[:kept].copy()


@kernel
def refine(
    query: NDArray[np.float64],
    submap: Pattern,
    x: float,
    y: float,
    yaw: float,
    reach: float,
) -> tuple[float, float, float]:
    """Least squares over the partners, paired anew until they stay the same (`_REFINEMENTS` times at most)."""
    previous = -1
    for _ in range(_REFINEMENTS):
        first, second, _ = pair_up(query, submap, x, y, yaw, reach)
        if len(first) < 3:
            break
        x, y, yaw = fit(query, submap.landmarks, first, second)
        total = len(first)
        if total == previous:
            break
        previous = total
    return x, y, yaw
