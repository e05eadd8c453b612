"""The search for quads in one table: it reads every cell within the tolerance of a query quad's lengths."""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.quad_hits import WantedQuads
from urquhart.index.quad_table import LAST, SIDE, STEPS, QuadTable, cell_code


class QuadSearchNumbers(NamedTuple):
    """How quads are compared, and how much work is done at once. Chosen by hand, not fitted."""

    slice: int = 5_000_000
    """Quads of a table that are read before the budget is checked: 10 to 30 ms."""


SEARCH: Final = QuadSearchNumbers()


class SearchedShard(NamedTuple):
    """The arrays of a `QuadShard` as a plain tuple for kernels; `first` is the number of its first slot."""

    codes: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    words: NDArray[np.uint64]
    alive: NDArray[np.uint8]
    first: int


@dataclass(frozen=True, slots=True, eq=False)
class QuadShard:
    """One quad table to search, with a mask.

    Attributes:
        table: the quads of S submaps.
        scales: (S,) float32, metres, the `centre_scale` of each slot.
        alive: (S,) uint8, 0 for slots whose submap must not be found.
    """

    table: QuadTable
    scales: NDArray[np.float32]
    alive: NDArray[np.uint8]

    def searched(self, first: int) -> SearchedShard:
        """The shard as a plain tuple for kernels; `first` is the number of its first slot among all shards."""
        return SearchedShard(self.table.codes, self.table.starts, self.table.words, self.alive, first)


@kernel
def count_neighbourhoods(
    codes: NDArray[np.uint32], starts: NDArray[np.uint32], lengths: NDArray[np.float64], counts: NDArray[np.int64]
) -> None:
    """Add to `counts` (Q,) the number of stored quads in the cell of each query quad: an estimate of its rarity.

    `codes`, `starts`: of a `QuadTable`; `lengths`: (Q, 5), metres, of the query's quads.
    """
    cells = np.empty(5, np.int64)
    for q in range(len(lengths)):
        for k in range(5):
            cells[k] = np.int64(lengths[q, k] / STEPS[k] + 0.5) // SIDE
        code = cell_code(cells)
        at = np.searchsorted(codes, np.uint32(code))
        if at < len(codes) and codes[at] == code:
            counts[q] += np.int64(starts[at + 1]) - np.int64(starts[at])


class CellSpan(NamedTuple):
    """The cells within the tolerance of a query quad, read from one end of its diagonal.

    Attributes:
        low, high: (5,) int64, the first and the last cell along each length.
        masks: (5, C) uint64, for each length and each cell from `low` on: which places in the cell are near enough.
        first, last: (C, C) uint64, those of the first two lengths and of the next two, combined.
    """

    low: NDArray[np.int64]
    high: NDArray[np.int64]
    masks: NDArray[np.uint64]
    first: NDArray[np.uint64]
    last: NDArray[np.uint64]


class CellRows(NamedTuple):
    """The rows of a `CellSpan` that hold quads. A row is the cells that differ in the last length only.

    Attributes:
        cells: (R,) int64, where the cells of each row begin in a table's `codes`.
        words: (R,) int64, where their quads begin in its `words`.
        codes: (R,) int64, the lowest code of each row.
        first, last: (R,) uint64, masks of the first two lengths and of the next two.
    """

    cells: NDArray[np.int64]
    words: NDArray[np.int64]
    codes: NDArray[np.int64]
    first: NDArray[np.uint64]
    last: NDArray[np.uint64]


@kernel
def gather(
    shard: SearchedShard, quads: WantedQuads, chunk: NDArray[np.int64], raw: NDArray[Any], count: int
) -> tuple[int, int, int, bool]:
    """Append the hits of the query quads `chunk` (K,) in one shard to the first `count` rows of `raw` (R,).

    `raw` is of `RAW_HIT`. It stops before a quad whose hits do not fit into `raw`, and after reading `SEARCH.slice`
    quads of the shard.

    Returns:
        The number of quads of the chunk that are done, of hits, and of quads skipped because they had more than
        `quads.most` hits; and whether `raw` was full.
    """
    done = passed = looked = 0
    wide = int(2.0 * quads.tolerance / (min(STEPS) * SIDE)) + 3
    pairs = np.empty((2, wide, wide), np.uint64)
    span = CellSpan(np.empty(5, np.int64), np.empty(5, np.int64), np.empty((5, wide), np.uint64), pairs[0], pairs[1])
    places, masks = np.empty((3, wide**4), np.int64), np.empty((2, wide**4), np.uint64)
    rows = CellRows(places[0], places[1], places[2], masks[0], masks[1])
    while done < len(chunk) and looked < SEARCH.slice:
        q = chunk[done]
        before = count
        for reading in range(2):
            # Read from the other end of the diagonal too, where either side may be the longer one in truth.
            if reading == 1 and quads.lengths[q, 0] - quads.lengths[q, 2] > 2.0 * quads.tolerance:
                break
            set_span(span, quads.lengths[q], reading, quads.tolerance)
            number = find_rows(shard, span, rows)
            limit = before + quads.most
            count, seen, full = read_rows(shard, span, rows, (number, 2 * q + reading, limit), raw, count)
            looked += seen
            if full:
                return done, before, passed, True
            if count > limit:
                count = before
                passed += 1
                break
        done += 1
    return done, count, passed, False


@kernel
def set_span(span: CellSpan, lengths: NDArray[np.float64], reading: int, tolerance: float) -> None:
    """Set `span` to the cells within `tolerance`, metres, of a quad with these lengths (5,), metres.

    `reading`: 0, or 1 to read the quad from the other end of its diagonal.
    """
    low, high, masks, first, last = span
    for k in range(5):
        wanted, step = lengths[(k + 2 * reading) % 4] if k < 4 else lengths[4], STEPS[k]
        lowest = max(math.ceil((wanted - tolerance) / step), 0)
        highest = math.floor((wanted + tolerance) / step)
        low[k], high[k] = min(lowest // SIDE, LAST[k]), min(highest // SIDE, LAST[k])
        for c in range(low[k], high[k] + 1):
            masks[k, c - low[k]] = place_mask(lowest - SIDE * c, highest - SIDE * c if c < LAST[k] else SIDE)
        if low[k] == LAST[k]:
            masks[k, 0] = np.uint64(255)
    for k, pairs in ((0, first), (2, last)):
        for a in range(high[k] - low[k] + 1):
            for b in range(high[k + 1] - low[k + 1] + 1):
                pairs[a, b] = combine_masks(masks[k, a], masks[k + 1, b])


@kernel
def find_rows(shard: SearchedShard, span: CellSpan, rows: CellRows) -> int:
    """Fill `rows` with those of `span` that hold quads of the shard, and return how many these are."""
    codes, starts = shard.codes, shard.starts
    low, high = span.low, span.high
    cell, number, at = np.empty(5, np.int64), 0, 0
    cell[4] = low[4]
    for a in range(low[0], high[0] + 1):
        for b in range(low[1], high[1] + 1):
            for c in range(low[2], high[2] + 1):
                for d in range(low[3], high[3] + 1):
                    cell[0], cell[1], cell[2], cell[3] = a, b, c, d
                    code = cell_code(cell)
                    at = next_code(codes, at, code)
                    if at < len(codes) and codes[at] <= code + high[4] - low[4]:
                        rows.cells[number], rows.words[number], rows.codes[number] = at, starts[at], code
                        rows.first[number] = span.first[a - low[0], b - low[1]]
                        rows.last[number] = span.last[c - low[2], d - low[3]]
                        number += 1
    return number


@kernel
def read_rows(
    shard: SearchedShard,
    span: CellSpan,
    rows: CellRows,
    reading: tuple[int, int, int],
    raw: NDArray[Any],
    count: int,
) -> tuple[int, int, bool]:
    """Append the hits in `rows` of one reading of a query quad to the first `count` rows of `raw`.

    `reading`: the number of rows; what a `RAW_HIT` says of the reading; and the number of hits beyond which it ends.

    Returns:
        The number of hits, the number of the shard's cells and quads that were read, and whether `raw` was full.
    """
    codes, starts, words, alive, first = shard
    number, name, limit = reading
    one, six, three, slots = np.uint64(1), np.uint64(63), np.uint64(7), np.uint64(39)
    looked = touched = 0
    for r in range(number):
        # CellRows are scattered in memory; loads that do not depend on each other run in parallel.
        if rows.words[r] < len(words):
            touched += int(words[rows.words[r]] & one)
    for r in range(number):
        at, low = int(rows.cells[r]), int(rows.codes[r])
        end = low + int(span.high[4] - span.low[4])
        first_two, next_two = rows.first[r], rows.last[r]
        # The cells of a row are consecutive, unless the table is damaged.
        while at < len(codes) and low <= codes[at] <= end:
            mask = span.masks[4, codes[at] - low]
            begin, beyond = int(starts[at]), min(int(starts[at + 1]), len(words))
            looked += 1 + max(beyond - begin, 0)
            for e in range(begin, beyond):
                word = words[e]
                allowed = (first_two >> (word & six)) & (next_two >> ((word >> np.uint64(6)) & six))
                if allowed & (mask >> ((word >> np.uint64(12)) & three)) & one == 0:
                    continue
                slot = np.int64(word >> slots)
                if slot >= len(alive) or alive[slot] == 0:
                    continue
                # In rows of trees, one cell may hold millions of quads, all of them hits.
                if count > limit or count == len(raw):
                    return count, looked, count <= limit
                raw[count].word, raw[count].code = word + (np.uint64(first) << slots), codes[at]
                raw[count].reading = name
                count += 1
            at += 1
    # `touched` is never negative; the comparison keeps the compiler from removing the loads.
    return count, looked if touched >= 0 else -1, False


@kernel
def next_code(codes: NDArray[np.uint32], at: int, code: int) -> int:
    """The first place from `at` on in ascending `codes` (C,) whose code is not below `code`; C if there is none.

    The steps double, because the rows of a search lie near each other.
    """
    wanted, step, last = np.uint32(code), 1, len(codes)
    while at + step < last and codes[at + step] < wanted:
        at += step
        step *= 2
    return at + int(np.searchsorted(codes[at : min(at + step + 1, last)], wanted))


@kernel
def place_mask(lowest: int, highest: int) -> np.uint64:
    """A mask of the places in a cell from `lowest` to `highest`, a bit each."""
    mask = np.uint64(0)
    for r in range(max(lowest, 0), min(highest, SIDE - 1) + 1):
        mask |= np.uint64(1) << np.uint64(r)
    return mask


@kernel
def combine_masks(first: np.uint64, second: np.uint64) -> np.uint64:
    """The mask (64 bits) of the pairs of places that two masks of eight bits allow; the first length varies fastest."""
    mask = np.uint64(0)
    for r in range(SIDE):
        if (second >> np.uint64(r)) & np.uint64(1):
            mask |= first << np.uint64(SIDE * r)
    return mask
