"""Comparison of two submaps under every rotation and every shift: the last resort of a search.

If half of the trees are missing, or as many are false, no quad is intact, but the pattern as a whole still is. For each
of a few hundred rotations, the displacements between all pairs of landmarks are counted on a grid. The right shift
brings many pairs into one cell. How many pairs chance brings there is estimated from how often displacements of that
length occur under any rotation, so that a small overlap is compared with what a small overlap gives by chance.

The work grows with the number of landmarks of the query times that of the submap, so this compares two submaps and does
not search a collection. A survey chooses the submaps (see `by_correlation`).
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.verify.landmark_grid import LandmarkGrid


class CorrelationNumbers(NamedTuple):
    """The grid of a correlation, and which peaks count. Chosen by hand, not fitted."""

    finest: float = 0.5
    """Metres: shortest side of a cell."""
    coarsest: float = 1.15
    """Metres: longest side of a cell, unless the grid would have more than `most_cells`."""
    cell_share: float = 0.17
    """Side of a cell as a share of the distance between trees."""
    turn: float = 1.8
    """Cells that a landmark at the typical distance from the centre moves from one rotation to the next."""
    most_turns: int = 360
    """Most rotations that are tried."""
    most_cells: int = 400
    """Most cells along a side of the grid."""
    most_pairs: int = 4_000_000
    """Most pairs of landmarks that are counted for one rotation; of larger queries, a sample of the landmarks is."""
    most_flagged: int = 1_024
    """Most cells that are examined for one rotation."""
    sampled: int = 8
    """Rotations from which the frequency of displacements is estimated; each query landmark takes part in one."""
    sigmas: float = 3.7
    """A cell is examined if its count is this many standard deviations above chance."""
    beyond: float = 0.7
    """Longest shift, as a share of the sum of both footprints' radii. Longer shifts leave too small an overlap."""
    larger: float = 2.0
    """If a submap extends more than this many times as far as the query, the shifts tried do not reach its ends."""


CORRELATION: Final = CorrelationNumbers()
_FINE: Final = 4096
"""Fractions of a cell in which displacements are computed."""
_LOOK: Final = 1 << 30
"""Count at which a cell is examined. A cell starts from this minus the number of pairs it needs. It may hold every pair
of landmarks: 32 bits hold this count plus four hundred million pairs."""


@kernel
def covers_ends(query: LandmarkGrid, submap: LandmarkGrid) -> bool:
    """Whether a correlation reaches the ends of the submap: it extends at most twice as far as the query."""
    farthest = CORRELATION.larger**2 * (query.landmarks**2).sum(axis=1).max()
    return bool((submap.landmarks**2).sum(axis=1).max() <= farthest)


class ShiftGrid(NamedTuple):
    """Two sets of landmarks, prepared for a correlation.

    Attributes:
        query: (n, 2) float64, metres, centred frame: the landmarks that are rotated.
        target_x, target_y: (m,) int32, 4096ths of a cell: the submap's landmarks, relative to the corner of the grid.
        cell: metres, side of a cell.
        side: cells along a side of the grid of shifts.
        steps: number of rotations in a full turn.
        rate: (b,) float64, displacements that chance brings into one cell, by their length in units of two cells.
        fresh: uint32, the initial count of each cell, row by row; see `thresholds`.
    """

    query: NDArray[np.float64]
    target_x: NDArray[np.int32]
    target_y: NDArray[np.int32]
    cell: float
    side: int
    steps: int
    rate: NDArray[np.float64]
    fresh: NDArray[np.uint32]


class Rotations(NamedTuple):
    """The rotations to try, radians: those within `half` of `yaw`. By default all."""

    yaw: float = 0.0
    half: float = math.pi


FULL_TURN: Final = Rotations()


def correlate(
    query: LandmarkGrid, submap: LandmarkGrid, peaks: int, rotations: Rotations = FULL_TURN, budget: Budget = UNBOUNDED
) -> NDArray[np.float64]:
    """The `peaks` poses that stand out most from chance.

    Returns:
        (P, 4), P <= `peaks`, the best first: x, y, yaw of `submap_T_query` between centred frames, right to a cell and
        a step of the rotation; and the score, the natural logarithm of the odds against chance.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    spacing = max(query.spacing, submap.spacing)
    cell = min(max(CORRELATION.cell_share * spacing, CORRELATION.finest), CORRELATION.coarsest)
    return find_peaks(query.landmarks, submap.landmarks, cell, peaks, rotations, budget)


def find_peaks(
    query: NDArray[np.float64],
    submap: NDArray[np.float64],
    cell: float,
    peaks: int,
    rotations: Rotations = FULL_TURN,
    budget: Budget = UNBOUNDED,
) -> NDArray[np.float64]:
    """The peaks (P, 4) of `correlate`, for landmarks (N, 2) and (M, 2), metres, and cells of at least `cell` metres.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    pairs = len(query) * len(submap)
    if budget.fits(CORRELATION.most_turns, pairs):
        return find_peaks_at_once(query, submap, cell, peaks, *rotations)
    best = np.zeros((peaks, 4))
    # A sample of many landmarks shows where all belong, and limits one rotation to some 10 ms.
    grid = build_shift_grid(np.ascontiguousarray(query[:: 1 + (pairs - 1) // CORRELATION.most_pairs]), submap, cell)
    for turns in budget.portions(grid.steps, len(grid.query) * len(submap) + len(grid.fresh)):
        count_rotations(grid, rotations.yaw, rotations.half, turns.start, turns.stop, best)
    return best[best[:, 3] > 0.0]


@kernel
def find_peaks_at_once(
    query: NDArray[np.float64], submap: NDArray[np.float64], cell: float, peaks: int, yaw: float, half: float
) -> NDArray[np.float64]:
    """The result of `find_peaks` in one compiled call, which is fastest for ordinary sizes."""
    best = np.zeros((peaks, 4))
    grid = build_shift_grid(query, submap, cell)
    count_rotations(grid, yaw, half, 0, grid.steps, best)
    return best[best[:, 3] > 0.0]


@kernel
def build_shift_grid(query: NDArray[np.float64], submap: NDArray[np.float64], cell: float) -> ShiftGrid:
    """Prepare landmarks (N, 2) and (M, 2), metres, centred frames; cells of at least `cell` metres."""
    n, m = len(query), len(submap)
    extent = math.sqrt((query**2).sum(axis=1).max()) + math.sqrt((submap**2).sum(axis=1).max())
    # Only shifts that leave enough overlap have cells of their own; all others are counted in the rim.
    farthest = CORRELATION.beyond * extent
    cell = max(cell, 2.0 * farthest / (CORRELATION.most_cells - 4))
    side = int(2.0 * farthest / cell) + 4
    middle = 0.5 * side
    typical = math.sqrt(min((query**2).sum() / n, (submap**2).sum() / m))
    steps = min(max(int(2.0 * math.pi * typical / (CORRELATION.turn * cell)), 36), CORRELATION.most_turns)

    rate = expected_counts(query, submap, cell, steps, extent)
    fresh = thresholds(rate, side, farthest / cell)
    # Integers in 4096ths of a cell: the compiler subtracts and shifts eight at a time, but converts floats one by one.
    # Cells are large enough that no landmark is farther than 300 of them from the middle.
    target_x, target_y = np.empty(m, np.int32), np.empty(m, np.int32)
    for j in range(m):
        target_x[j] = int((submap[j, 0] / cell + middle) * _FINE)
        target_y[j] = int((submap[j, 1] / cell + middle) * _FINE)
    return ShiftGrid(query, target_x, target_y, cell, side, steps, rate, fresh)


@kernel
def count_rotations(laid: ShiftGrid, yaw: float, half: float, first: int, last: int, best: NDArray[np.float64]) -> None:
    """Try those of the rotations `first` to `last` that are within `half` of `yaw`, radians; insert peaks into `best`.

    `best`: (P, 4), x, y, yaw and score, the highest score first; updated.
    """
    query, target_x, target_y, cell, side, steps, rate, fresh = laid
    n, m, peaks, middle = len(query), len(target_x), len(best), 0.5 * side
    grid = np.empty_like(fresh)
    words, fresh_words = grid.view(np.uint64), fresh.view(np.uint64)
    flagged = np.empty(CORRELATION.most_flagged, np.int64)
    places, low, high, stride = np.empty(m, np.int32), np.int32(0), np.int32(side - 1), np.int32(side)
    for step in range(first, last):
        turn = 2.0 * math.pi * step / steps
        if abs((turn - yaw + 3.0 * math.pi) % (2.0 * math.pi) - math.pi) > half:
            continue
        c, s = math.cos(turn) * _FINE / cell, math.sin(turn) * _FINE / cell
        for w in range(len(words)):
            words[w] = fresh_words[w]
        count = 0
        for i in range(n):
            x = np.int32(c * query[i, 0] - s * query[i, 1])
            y = np.int32(s * query[i, 0] + c * query[i, 1])
            for j in range(m):
                a = min(max((target_x[j] - x) >> 12, low), high)
                b = min(max((target_y[j] - y) >> 12, low), high)
                places[j] = a * stride + b
            for j in range(m):
                at = places[j]
                value = grid[at] + np.uint32(1)
                grid[at] = value
                if value == _LOOK and count < CORRELATION.most_flagged:
                    flagged[count] = at
                    count += 1
        for f in range(count):
            row, column = flagged[f] // side, flagged[f] % side
            if not (2 <= row < side - 2 and 2 <= column < side - 2):
                continue
            distance = math.sqrt((row + 0.5 - middle) ** 2 + (column + 0.5 - middle) ** 2)
            expected = 4.0 * rate[min(int(0.5 * distance), len(rate) - 1)]
            for da in range(-1, 1):
                for db in range(-1, 1):
                    at = (row + da) * side + column + db
                    counted = np.int64(grid[at]) + grid[at + 1] + grid[at + side] + grid[at + side + 1]
                    total = counted - fresh[at] - fresh[at + 1] - fresh[at + side] - fresh[at + side + 1]
                    if total <= expected + 2.0:
                        continue
                    score = total * math.log(total / expected) - (total - expected)
                    if score > best[peaks - 1, 3]:
                        x, y = (row + da + 1 - middle) * cell, (column + db + 1 - middle) * cell
                        insert_peak(best, (x, y, turn, score), 2.5 * cell, 5.0 * math.pi / steps)


@kernel
def thresholds(rate: NDArray[np.float64], side: int, farthest: float) -> NDArray[np.uint32]:
    """The initial count of each cell, such that the cell reaches `_LOOK` when it must be examined.

    `rate`: as in `ShiftGrid`; `farthest`: cells beyond it, in cells from the middle, start from 0 and are not examined.

    Returns:
        uint32, `side` * `side` of them, row by row, and one more if that is odd.
    """
    start = np.zeros(len(rate), np.uint32)
    for k in range(len(rate)):
        if 2.0 * k <= farthest:
            needed = max(3, math.ceil(rate[k] + CORRELATION.sigmas * math.sqrt(rate[k])) + 1)
            start[k] = _LOOK - needed
    fresh = np.zeros((side * side + 1) // 2 * 2, np.uint32)
    middle, last = 0.5 * side, side - 1
    # The four quarters are symmetric.
    for a in range((side + 1) // 2):
        for b in range((side + 1) // 2):
            u, v = a + 0.5 - middle, b + 0.5 - middle
            value = start[min(int(0.5 * math.sqrt(u * u + v * v)), len(rate) - 1)]
            fresh[a * side + b] = fresh[a * side + last - b] = value
            fresh[(last - a) * side + b] = fresh[(last - a) * side + last - b] = value
    return fresh


@kernel
def expected_counts(
    query: NDArray[np.float64], submap: NDArray[np.float64], cell: float, steps: int, extent: float
) -> NDArray[np.float64]:
    """The `rate` of a `ShiftGrid`; `cell`, `extent`: metres, of a cell and of the longest displacement."""
    bins = int(0.5 * extent / cell) + 2
    rate, scale = np.zeros(bins), 0.5 / cell
    # Half of the landmarks are enough if there are many.
    step = 2 * CORRELATION.sampled if len(query) >= 4 * CORRELATION.sampled else CORRELATION.sampled
    weight = step / CORRELATION.sampled
    for k in range(CORRELATION.sampled):
        yaw = 2.0 * math.pi * (k + 0.5) / CORRELATION.sampled
        c, s = math.cos(yaw), math.sin(yaw)
        for i in range(k, len(query), step):
            x, y = c * query[i, 0] - s * query[i, 1], s * query[i, 0] + c * query[i, 1]
            for j in range(len(submap)):
                dx, dy = submap[j, 0] - x, submap[j, 1] - y
                rate[min(int(math.sqrt(dx * dx + dy * dy) * scale), bins - 1)] += weight
    for k in range(bins):
        # Counts over a ring two cells wide. They are never zero, or a single pair at the rim would stand out.
        rate[k] = max(rate[k] / (4.0 * math.pi * (2 * k + 1)), 0.02)
    return rate


@kernel
def insert_peak(best: NDArray[np.float64], peak: tuple[float, float, float, float], near: float, turn: float) -> None:
    """Insert a peak (x, y, yaw, score) into `best` (P, 4), the highest score first.

    Of peaks within `near` metres and `turn` radians of each other, only the highest stays.
    """
    x, y, yaw, score = peak
    last = len(best) - 1
    for p in range(len(best)):
        if best[p, 3] <= 0.0:
            last = p
            break
        away = abs(best[p, 2] - yaw)
        if abs(best[p, 0] - x) <= near and abs(best[p, 1] - y) <= near and min(away, 2.0 * math.pi - away) <= turn:
            if best[p, 3] >= score:
                return
            last = p
            break
    while last > 0 and best[last - 1, 3] < score:
        best[last] = best[last - 1]
        last -= 1
    best[last, 0], best[last, 1], best[last, 2], best[last, 3] = x, y, yaw, score
