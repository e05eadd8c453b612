"""The search for quads in one table: it reads every cell within the tolerance of a query quad's lengths."""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.quad_table import HALF, LAST, SIDE, STEP, TURNS, QuadTable, cell_code


class QuadSearchNumbers(NamedTuple):
    """How quads are compared, and how much work is done at once. Chosen by hand, not fitted."""

    slice: int = 5_000_000
    """Quads of a table that are read before the budget is checked: 10 to 30 ms."""
    spread: float = 0.8
    """Usual error of a length as a share of the tolerance."""


SEARCH: Final = QuadSearchNumbers()


HIT: Final = np.dtype(
    [
        ("slot", np.int32),
        ("quad", np.int32),
        ("turn", np.int32),
        ("earlier", np.int32),
        ("x", np.float32),
        ("y", np.float32),
        ("step", np.float32),
        ("fit", np.float32),
    ]
)
"""A hit: a stored quad whose lengths agree with those of a query quad. 32 bytes are half a cache line, because hits are
read in random order.

slot        of the submap, numbered through all shards
quad        index of the query quad
turn        rotation from the query frame to the submap frame, 256ths of a turn
earlier     the previous hit of the same slot, numbered from 1; 0 if there is none
x, y        metres, centred submap frame: centre of the stored quad
step        metres, resolution of x and y
fit         logarithm of the likelihood of the misfit of the lengths
"""


class SearchedShard(NamedTuple):
    """The arrays of a `QuadShard` as a plain tuple for kernels; `first` is the number of its first slot."""

    codes: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    words: NDArray[np.uint64]
    scales: NDArray[np.float32]
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
        return SearchedShard(self.table.codes, self.table.starts, self.table.words, self.scales, self.alive, first)


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
            cells[k] = np.int64(lengths[q, k] / STEP + 0.5) // SIDE
        code = cell_code(cells)
        at = np.searchsorted(codes, np.uint32(code))
        if at < len(codes) and codes[at] == code:
            counts[q] += np.int64(starts[at + 1]) - np.int64(starts[at])


class WantedQuads(NamedTuple):
    """The quads of a query, and how they are compared.

    Attributes:
        lengths: (Q, 5) float64, metres, as `measure_quads` returns them.
        directions: (Q,) int64, directions of the diagonals, 256ths of a turn.
        tolerance: metres, largest difference of a length.
        most: most hits of one quad in one shard; a quad that has more is skipped there.
    """

    lengths: NDArray[np.float64]
    directions: NDArray[np.int64]
    tolerance: float
    most: int


class CellSpan(NamedTuple):
    """The cells within the tolerance of a query quad, read from one end of its diagonal.

    Attributes:
        wanted: (5,) float64, metres, the lengths in the order of this reading.
        low, high: (5,) int64, the first and the last cell along each length.
        masks: (5, C) uint64, for each length and each cell from `low` on: which places in the cell are near enough.
        cells: (5,) int64, the cell that is being searched.
    """

    wanted: NDArray[np.float64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    masks: NDArray[np.uint64]
    cells: NDArray[np.int64]


@kernel
def gather(
    shard: SearchedShard, quads: WantedQuads, chunk: NDArray[np.int64], hits: NDArray[Any], count: int
) -> tuple[int, int, int, bool]:
    """Append the hits of the query quads `chunk` (K,) in one shard to the first `count` rows of `hits` (R,) of `HIT`.

    It stops before a quad whose hits do not fit into `hits`, and after reading `SEARCH.slice` quads of the shard.

    Returns:
        The number of quads of the chunk that are done, of hits, and of quads skipped because they had more than
        `quads.most` hits; and whether `hits` was full.
    """
    done = passed = looked = 0
    width = int(2.0 * quads.tolerance / (STEP * SIDE)) + 3
    low, high, cells = np.empty(5, np.int64), np.empty(5, np.int64), np.empty(5, np.int64)
    span = CellSpan(np.empty(5), low, high, np.empty((5, width), np.uint64), cells)
    spread = 1.0 / (2.0 * (SEARCH.spread * quads.tolerance) ** 2)
    while done < len(chunk) and looked < SEARCH.slice:
        q = chunk[done]
        before = count
        for reading in range(2):
            # Read from the other end of the diagonal too, where either side may be the longer one in truth.
            if reading == 1 and quads.lengths[q, 0] - quads.lengths[q, 2] > 2.0 * quads.tolerance:
                break
            set_span(span, quads.lengths[q], reading, quads.tolerance)
            turn = (TURNS // 2) * reading - quads.directions[q]
            count, seen, full = gather_reading(shard, span, (q, turn, spread), hits, count, before + quads.most)
            looked += seen
            if full:
                return done, before, passed, True
            if count - before > quads.most:
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
    wanted, low, high, masks, _ = span
    for k in range(4):
        wanted[k] = lengths[(k + 2 * reading) % 4]
    wanted[4] = lengths[4]
    for k in range(5):
        lowest = max(math.ceil((wanted[k] - tolerance) / STEP), 0)
        highest = math.floor((wanted[k] + tolerance) / STEP)
        low[k], high[k] = min(lowest // SIDE, LAST), min(highest // SIDE, LAST)
        for c in range(low[k], high[k] + 1):
            masks[k, c - low[k]] = place_mask(lowest - SIDE * c, highest - SIDE * c if c < LAST else SIDE)
        if low[k] == LAST:
            masks[k, 0] = np.uint64(255)


@kernel
def gather_reading(
    shard: SearchedShard, span: CellSpan, quad: tuple[int, int, float], hits: NDArray[Any], count: int, limit: int
) -> tuple[int, int, bool]:
    """Append the hits of one reading of a query quad to the first `count` rows of `hits`, up to more than `limit`.

    `quad`: its index, the rotation that is added to a hit's direction, and the factor of the misfit.

    Returns:
        The number of hits, the number of the shard's quads that were read, and whether `hits` was full.
    """
    codes, starts, words, scales, alive, first = shard
    wanted, low, high, masks, cells = span
    q, turned, spread = quad
    one, six, three, byte = np.uint64(1), np.uint64(63), np.uint64(7), np.uint64(255)
    looked, rows, at = 0, np.int64(1), 0
    for k in range(4):
        rows *= high[k] - low[k] + 1
    for row in range(rows):
        rest = row
        for k in range(3, -1, -1):
            wide = high[k] - low[k] + 1
            cells[k] = low[k] + rest % wide
            rest //= wide
        cells[4] = low[4]
        begin = cell_code(cells)
        end = begin + high[4] - low[4]
        at = next_code(codes, at, begin)
        if at == len(codes) or codes[at] > end:
            continue
        mask01 = combine_masks(masks[0, cells[0] - low[0]], masks[1, cells[1] - low[1]])
        mask23 = combine_masks(masks[2, cells[2] - low[2]], masks[3, cells[3] - low[3]])
        # The cells of a row are consecutive, unless the table is damaged.
        while at < len(codes) and begin <= codes[at] <= end:
            cells[4] = low[4] + codes[at] - begin
            mask4 = masks[4, cells[4] - low[4]]
            looked += 1
            for e in range(int(starts[at]), min(int(starts[at + 1]), len(words))):
                # In rows of trees, one cell may hold millions of quads, all of them hits.
                if count > limit:
                    return count, looked, False
                looked += 1
                word = words[e]
                allowed = (mask01 >> (word & six)) & (mask23 >> ((word >> np.uint64(6)) & six))
                if allowed & (mask4 >> ((word >> np.uint64(12)) & three)) & one == 0:
                    continue
                slot = np.int64(word >> np.uint64(39))
                if slot >= len(alive) or alive[slot] == 0:
                    continue
                if count == len(hits):
                    return count, looked, True
                turn = np.int64((word >> np.uint64(15)) & byte) + turned
                hits[count].slot, hits[count].quad, hits[count].turn = first + slot, q, turn & (TURNS - 1)
                hits[count].x = (np.int64((word >> np.uint64(23)) & byte) - HALF) * scales[slot]
                hits[count].y = (np.int64((word >> np.uint64(31)) & byte) - HALF) * scales[slot]
                hits[count].step, hits[count].fit = scales[slot], -spread * misfit(word, cells, wanted)
                count += 1
            if count > limit:
                return count, looked, False
            at += 1
    return count, looked, False


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
def misfit(word: np.uint64, cells: NDArray[np.int64], wanted: NDArray[np.float64]) -> float:
    """Sum of squared differences, square metres, between the lengths of a stored quad and `wanted` (5,), metres.

    `word`: the stored quad; `cells`: (5,), its cell.
    """
    total = 0.0
    for k in range(5):
        place = np.int64(word >> np.uint64(3 * k)) & (SIDE - 1)
        if cells[k] < LAST:
            total += (STEP * (SIDE * cells[k] + place) - wanted[k]) ** 2
    return total


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
