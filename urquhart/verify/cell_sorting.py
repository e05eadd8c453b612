"""Landmarks sorted into square cells, and within a crowded cell into a k-d tree."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel

CROWD: Final = 32
"""Landmarks in a cell beyond which they are sorted as a k-d tree. One stray landmark far away makes cells so wide that
all others share one cell."""


@kernel
def sort_into_cells(
    landmarks: NDArray[np.float64], cell: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Sort landmarks (N, 2), metres, into square cells: `cell_starts`, `cell_order`, `cell_frame` of a `LandmarkGrid`.

    `cell`: metres, least side of a cell.
    """
    n = len(landmarks)
    low_x, low_y = landmarks[:, 0].min(), landmarks[:, 1].min()
    width, height = landmarks[:, 0].max() - low_x, landmarks[:, 1].max() - low_y
    # Cells need not be smaller than about a landmark each: in a large, sparse footprint that would only cost memory.
    size = max(cell, math.sqrt(width * height / (4.0 * n)), max(width, height) / 1024.0)
    columns, rows = int(width / size) + 1, int(height / size) + 1
    place = np.empty(n, np.int64)
    starts = np.zeros(columns * rows + 1, np.int64)
    for i in range(n):
        place[i] = int((landmarks[i, 0] - low_x) / size) * rows + int((landmarks[i, 1] - low_y) / size)
        starts[place[i] + 1] += 1
    for c in range(columns * rows):
        starts[c + 1] += starts[c]
    order, cursor = np.empty(n, np.int64), starts[:-1].copy()
    for i in range(n):
        order[cursor[place[i]]] = i
        cursor[place[i]] += 1
    for c in range(columns * rows):
        if starts[c + 1] - starts[c] > CROWD:
            build_tree(landmarks, order, starts[c], starts[c + 1])
    return starts, order, np.array([low_x, low_y, 1.0 / size, float(columns), float(rows)])


@kernel
def build_tree(landmarks: NDArray[np.float64], order: NDArray[np.int64], first: int, last: int) -> None:
    """Sort `order[first:last]` as a k-d tree: the middle one splits the rest, by x and y in turn."""
    begins, ends, axes = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64, np.int64)
    begins[0], ends[0], axes[0] = first, last, 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        a, b, axis = begins[waiting], ends[waiting], axes[waiting]
        if b - a < 2:
            continue
        here = order[a:b].copy()
        values = np.empty(b - a)
        for k in range(b - a):
            values[k] = landmarks[here[k], axis]
        order[a:b] = here[np.argsort(values, kind="mergesort")]
        middle = (a + b) // 2
        begins[waiting], ends[waiting], axes[waiting] = a, middle, 1 - axis
        begins[waiting + 1], ends[waiting + 1], axes[waiting + 1] = middle + 1, b, 1 - axis
        waiting += 2


@kernel
def search_tree(
    landmarks: NDArray[np.float64],
    tree: NDArray[np.int64],
    x: float,
    y: float,
    best: int,
    best_distance: float,
) -> tuple[int, float]:
    """The landmark of a k-d tree nearest to (x, y), metres, and its squared distance.

    `tree`: (K,), landmark indices as `build_tree` sorted them. A landmark that is no nearer than `best` so far, at the
    squared distance `best_distance`, does not replace it.
    """
    begins, ends, axes = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64, np.int64)
    beyond = np.empty(64)
    begins[0], ends[0], axes[0], beyond[0] = 0, len(tree), 0, 0.0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        a, b, axis = begins[waiting], ends[waiting], axes[waiting]
        if b <= a or beyond[waiting] > best_distance:
            continue
        middle = (a + b) // 2
        k = tree[middle]
        dx, dy = x - landmarks[k, 0], y - landmarks[k, 1]
        distance = dx * dx + dy * dy
        if distance <= best_distance:
            best, best_distance = k, distance
        away = dx if axis == 0 else dy
        # The near half is on top of the stack, and is searched first.
        near_a, near_b, far_a, far_b = (a, middle, middle + 1, b) if away < 0.0 else (middle + 1, b, a, middle)
        begins[waiting], ends[waiting], axes[waiting], beyond[waiting] = far_a, far_b, 1 - axis, away * away
        waiting += 1
        begins[waiting], ends[waiting], axes[waiting], beyond[waiting] = near_a, near_b, 1 - axis, 0.0
        waiting += 1
    return best, best_distance
