"""The quads of many submaps in one table, eight bytes each, sorted by shape.

A quad is found by its five lengths. The four sides are counted in steps of 0.2 m, the diagonal in steps of 0.1 m, and
eight steps are the side of a cell of a grid in five dimensions. The table holds the cells that have quads, in ascending
order, and one word for each quad:

    bits  0-14   place in the cell, three bits for each length
    bits 15-22   direction of the diagonal, 256ths of a turn
    bits 23-38   centre in the submap, eight bits for each coordinate
    bits 39-62   slot of the submap

Direction and centre turn every hit into a pose. A quad can be read from either end of its diagonal; it is stored in the
reading whose first side is no shorter than the third.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel

STEPS: Final = (0.2, 0.2, 0.2, 0.2, 0.1)
"""Metres: resolution of each length. Cells that are neighbours along the last length lie side by side, so small ones
cost no further look-ups there."""
SIDE: Final = 8
"""Steps along the side of a cell."""
MOST_SLOTS: Final = 1 << 24
"""Submaps that one table can hold."""
_BITS: Final = (6, 6, 6, 6, 8)
LAST: Final = tuple((1 << bits) - 1 for bits in _BITS)
"""The last cell of each length. It holds all longer ones, and their place in it means nothing."""
TURNS: Final = 256
"""Directions in a full turn."""
HALF: Final = 128
"""Steps of a centre's coordinate on either side of the submap's origin."""
_NEAR: Final = 0.5
"""Metres: step of a centre's coordinate; larger submaps have a larger step."""


class QuadArrays(NamedTuple):
    """The arrays of a `QuadTable`, as a plain tuple for kernels."""

    codes: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    words: NDArray[np.uint64]


@dataclass(frozen=True, slots=True, eq=False)
class QuadTable:
    """Q quads sorted by cell; immutable.

    Attributes:
        codes: (C,) uint32, codes of the cells that hold quads, ascending; see `cell_code`.
        starts: (C + 1,) uint32, where the quads of each cell begin in `words`.
        words: (Q,) uint64, one for each quad; the module's docstring has the layout.
    """

    codes: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    words: NDArray[np.uint64]

    def __len__(self) -> int:
        return len(self.words)

    @property
    def arrays(self) -> QuadArrays:
        """The arrays as a plain tuple for kernels."""
        return QuadArrays(self.codes, self.starts, self.words)


def centre_scale(landmarks: NDArray[np.float64]) -> float:
    """Metres in one step of a quad's centre, for a submap with landmarks (N, 2), metres, centred frame."""
    return max(_NEAR, float(np.abs(landmarks).max(initial=0.0)) / (HALF - 1))


def build_table(submaps: Sequence[tuple[NDArray[np.float64], NDArray[np.int32], float]]) -> QuadTable:
    """The table of several submaps, in the order of their slots.

    Args:
        submaps: landmarks (N, 2) float64, metres, centred frame; quads (Q, 4) int32, landmark indices; and the
            `centre_scale`.
    """
    total = sum(len(quads) for _, quads, _ in submaps)
    codes, words = np.empty(total, np.uint32), np.empty(total, np.uint64)
    at = 0
    for slot, (landmarks, quads, scale) in enumerate(submaps):
        pack_quads(landmarks, quads, scale, slot, codes[at : at + len(quads)], words[at : at + len(quads)])
        at += len(quads)
    order = np.argsort(codes, kind="stable")
    codes = codes[order]
    first = np.flatnonzero(_differ(codes))
    return QuadTable(codes[first], np.append(first, total).astype(np.uint32), words[order])


def merge_tables(tables: Sequence[tuple[QuadTable, NDArray[np.int32]]], empty: Any = np.empty) -> QuadTable:
    """Several tables merged into one, in one pass over their cells.

    Args:
        tables: each with the new slot of each of its slots, (S,) int32, -1 for submaps to be dropped.
        empty: allocates the words, with the signature of `numpy.empty`: those of a large table may lie in a file.

    Raises:
        ValueError: more quads than a table can hold (2 to the 32nd).
    """
    codes = np.concatenate([np.empty(0, np.uint32), *(table.codes for table, _ in tables)])
    # A stable sort merges the sorted runs, and releases the GIL meanwhile.
    codes.sort(kind="stable")
    codes = codes[_differ(codes)]
    counts = np.zeros(len(codes) + 1, np.int64)
    for table, slots in tables:
        count_living(codes, table.arrays, slots, counts)
    kept = counts[1:] > 0
    if counts.sum() >= 1 << 32:
        raise ValueError(f"{counts.sum()} quads: a table holds fewer than 2 to the 32nd")
    starts = np.concatenate([np.zeros(1, np.int64), np.cumsum(counts[1:][kept])])
    codes = codes[kept]
    words = empty(int(starts[-1]), np.uint64)
    cursor = starts[:-1].copy()
    for table, slots in tables:
        copy_living(codes, table.arrays, slots, cursor, words)
    return QuadTable(codes, starts.astype(np.uint32), words)


def _differ(ordered: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Which of ascending numbers (N,) differ from the previous one."""
    differ = np.ones(len(ordered), np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=differ[1:])
    return differ


@kernel
def cell_code(cells: NDArray[np.int64]) -> int:
    """The code of a cell (5,); cells that are neighbours along the last length have consecutive codes."""
    code = 0
    for k in range(5):
        code = (code << _BITS[k]) | int(min(cells[k], LAST[k]))
    return code


@kernel
def cell_of(code: int, cells: NDArray[np.int64]) -> None:
    """Set `cells` (5,) to the cell with a code."""
    rest = np.int64(code)
    for k in range(4, -1, -1):
        cells[k] = rest & LAST[k]
        rest >>= _BITS[k]


class QuadShapes(NamedTuple):
    """Quads, measured.

    A quad is read from the end of its diagonal that makes the first side no shorter than the third.

    Attributes:
        lengths: (Q, 5) float64, metres: the four sides, and the diagonal from the first landmark to the third.
        directions: (Q,) float64, of that diagonal, turns from 0 to 1.
        centres: (Q, 2) float64, metres, the mean of the four landmarks.
    """

    lengths: NDArray[np.float64]
    directions: NDArray[np.float64]
    centres: NDArray[np.float64]


@kernel
def measure_quads(landmarks: NDArray[np.float64], quads: NDArray[np.int32]) -> QuadShapes:
    """Measure quads (Q, 4) of landmarks (N, 2), metres, centred frame."""
    lengths, directions, centres = np.empty((len(quads), 5)), np.empty(len(quads)), np.empty((len(quads), 2))
    sides = np.empty(4)
    for q in range(len(quads)):
        x = y = 0.0
        for k in range(4):
            a, b = quads[q, k], quads[q, (k + 1) % 4]
            sides[k] = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
            x += 0.25 * landmarks[a, 0]
            y += 0.25 * landmarks[a, 1]
        turned = 2 if sides[0] < sides[2] else 0
        for k in range(4):
            lengths[q, k] = sides[(k + turned) % 4]
        a, b = quads[q, turned], quads[q, 2 - turned]
        dx, dy = landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1]
        lengths[q, 4], directions[q] = math.hypot(dx, dy), (math.atan2(dy, dx) / (2.0 * math.pi)) % 1.0
        centres[q, 0], centres[q, 1] = x, y
    return QuadShapes(lengths, directions, centres)


@kernel
def pack_quads(
    landmarks: NDArray[np.float64],
    quads: NDArray[np.int32],
    scale: float,
    slot: int,
    codes: NDArray[np.uint32],
    words: NDArray[np.uint64],
) -> None:
    """Fill `codes` (Q,) and `words` (Q,) with the quads (Q, 4) of one submap in slot `slot`; `scale`: metres."""
    lengths, directions, centres = measure_quads(landmarks, quads)
    cells = np.empty(5, np.int64)
    for q in range(len(quads)):
        word = np.int64(slot) << 39
        for k in range(5):
            steps = np.int64(lengths[q, k] / STEPS[k] + 0.5)
            cells[k] = steps // SIDE
            word |= (steps % SIDE) << (3 * k)
        word |= (np.int64(directions[q] * TURNS + 0.5) & (TURNS - 1)) << 15
        for k in range(2):
            place = math.floor(centres[q, k] / scale + 0.5) + HALF
            word |= min(max(place, 0), 2 * HALF - 1) << (23 + 8 * k)
        codes[q], words[q] = np.uint32(cell_code(cells)), np.uint64(word)


@kernel
def count_living(
    union: NDArray[np.uint32],
    table: QuadArrays,
    slots: NDArray[np.int32],
    counts: NDArray[np.int64],
) -> None:
    """Add to `counts[1:]` (U,) how many quads of `table` lie in each cell of `union` (U,) and have a new slot.

    In a damaged table, cells out of order, quads that belong to several cells, and invalid slots are left out.
    """
    codes, starts, words = table
    at = read = 0
    for c in range(len(codes)):
        begin, end = max(int(starts[c]), read), min(int(starts[c + 1]), len(words))
        read = max(read, end)
        while union[at] < codes[c]:
            at += 1
        if union[at] != codes[c]:
            continue
        for e in range(begin, end):
            slot = np.int64(words[e] >> np.uint64(39))
            counts[at + 1] += slot < len(slots) and slots[slot] >= 0


@kernel
def copy_living(
    union: NDArray[np.uint32],
    table: QuadArrays,
    slots: NDArray[np.int32],
    cursor: NDArray[np.int64],
    out: NDArray[np.uint64],
) -> None:
    """Copy the quads that `count_living` counted to `out`, those of each cell from `cursor` (U,) on, which advances."""
    codes, starts, words = table
    at, read, below = 0, 0, np.uint64((1 << 39) - 1)
    for c in range(len(codes)):
        begin, end = max(int(starts[c]), read), min(int(starts[c + 1]), len(words))
        read = max(read, end)
        while at < len(union) and union[at] < codes[c]:
            at += 1
        if at == len(union) or union[at] != codes[c]:
            continue  # every quad of this cell was left out
        for e in range(begin, end):
            slot = np.int64(words[e] >> np.uint64(39))
            if slot < len(slots) and slots[slot] >= 0:
                out[cursor[at]] = (words[e] & below) | (np.uint64(slots[slot]) << np.uint64(39))
                cursor[at] += 1
