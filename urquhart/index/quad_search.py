"""The search for quads in one table: every cell that a query quad's lengths reach within the tolerance."""

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
    """Quads of a table that are looked at before the budget is asked: 10 to 30 ms."""
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
"""A quad found; half a line of the processor's cache, because hits are looked at one by one and anywhere.

slot        the submap's, numbered through all tables
quad        the query's
turn        rotation from the query's to the submap's frame, 256ths of a turn
earlier     the hit of that slot before it, numbered from 1; 0 where there is none
x, y        metres, centre of the submap's quad
step        metres that these are good to
fit         logarithm of how likely the misfit of the lengths is
"""


class SearchedShard(NamedTuple):
    """The arrays of a `QuadShard`, as kernels take them, and the number of its first slot among all shards."""

    codes: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    words: NDArray[np.uint64]
    scales: NDArray[np.float32]
    alive: NDArray[np.uint8]
    first: int


@dataclass(frozen=True, slots=True, eq=False)
class QuadShard:
    """A table to search, with what lives in it.

    Attributes:
        table: quads.
        scales: (S,) float32, `centre_scale` of every slot.
        alive: (S,) uint8, 0 for slots that are not to be found.
    """

    table: QuadTable
    scales: NDArray[np.float32]
    alive: NDArray[np.uint8]

    def searched(self, first: int) -> SearchedShard:
        """The shard as kernels take it; `first` is the number of its first slot among all shards."""
        return SearchedShard(self.table.codes, self.table.starts, self.table.words, self.scales, self.alive, first)


@kernel
def count_neighbourhoods(
    codes: NDArray[np.uint32], starts: NDArray[np.uint32], lengths: NDArray[np.float64], counts: NDArray[np.int64]
) -> None:
    """Add to `counts` (Q,) how many quads lie in the cell of each query quad: enough to tell rare ones from common."""
    cells = np.empty(5, np.int64)
    for q in range(len(lengths)):
        for k in range(5):
            cells[k] = np.int64(lengths[q, k] / STEP + 0.5) // SIDE
        code = cell_code(cells)
        at = np.searchsorted(codes, np.uint32(code))
        if at < len(codes) and codes[at] == code:
            counts[q] += np.int64(starts[at + 1]) - np.int64(starts[at])


class WantedQuads(NamedTuple):
    """What is looked for.

    Attributes:
        lengths: (Q, 5) float64, metres, of the query's quads.
        directions: (Q,) int64, 256ths of a turn.
        tolerance: metres that a length may be off by.
        most: hits of one quad in one shard; a quad with more has none.
    """

    lengths: NDArray[np.float64]
    directions: NDArray[np.int64]
    tolerance: float
    most: int


class Reach(NamedTuple):
    """The cells that one reading of a query quad reaches within the tolerance.

    Attributes:
        wanted: (5,) float64, metres, the lengths as they are read.
        low, high: (5,) int64, the first and the last cell along each length.
        masks: (5, C) uint64, which places of a cell each length allows, by cell from `low` on.
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
    """Append the hits of the query quads `chunk` in one shard, behind the `count` that there are.

    Stops before a quad whose hits do not fit, and once `SEARCH.slice` of the shard's quads have been looked at.

    Returns:
        How many of the chunk are done, how many hits there are, how many quads had more than `quads.most`, and whether
        there was no room.
    """
    done = passed = looked = 0
    width = int(2.0 * quads.tolerance / (STEP * SIDE)) + 3
    low, high, cells = np.empty(5, np.int64), np.empty(5, np.int64), np.empty(5, np.int64)
    reach = Reach(np.empty(5), low, high, np.empty((5, width), np.uint64), cells)
    spread = 1.0 / (2.0 * (SEARCH.spread * quads.tolerance) ** 2)
    while done < len(chunk) and looked < SEARCH.slice:
        q = chunk[done]
        before = count
        for reading in range(2):
            # Read from the other end of the diagonal too, where either side may be the longer one in truth.
            if reading == 1 and quads.lengths[q, 0] - quads.lengths[q, 2] > 2.0 * quads.tolerance:
                break
            set_reach(reach, quads.lengths[q], reading, quads.tolerance)
            turn = (TURNS // 2) * reading - quads.directions[q]
            count, seen, full = gather_reading(shard, reach, (q, turn, spread), hits, count, before + quads.most)
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
def set_reach(reach: Reach, lengths: NDArray[np.float64], reading: int, tolerance: float) -> None:
    """Set `reach` to the cells of a quad with these lengths (5,); `reading` 1 begins at the other end."""
    wanted, low, high, masks, _ = reach
    for k in range(4):
        wanted[k] = lengths[(k + 2 * reading) % 4]
    wanted[4] = lengths[4]
    for k in range(5):
        lowest = max(math.ceil((wanted[k] - tolerance) / STEP), 0)
        highest = math.floor((wanted[k] + tolerance) / STEP)
        low[k], high[k] = min(lowest // SIDE, LAST), min(highest // SIDE, LAST)
        for c in range(low[k], high[k] + 1):
            masks[k, c - low[k]] = places(lowest - SIDE * c, highest - SIDE * c if c < LAST else SIDE)
        if low[k] == LAST:
            masks[k, 0] = np.uint64(255)


@kernel
def gather_reading(
    shard: SearchedShard, reach: Reach, quad: tuple[int, int, float], hits: NDArray[Any], count: int, limit: int
) -> tuple[int, int, bool]:
    """Append the hits of one reading of a query quad, until there are more than `limit`.

    `quad`: its number, what the hits' directions are turned by, and the factor of a misfit.

    Returns:
        How many hits there are, how many of the shard's quads have been looked at, and whether there was no room.
    """
    codes, starts, words, scales, alive, first = shard
    wanted, low, high, masks, cells = reach
    q, turned, spread = quad
    one, six, three, byte = np.uint64(1), np.uint64(63), np.uint64(7), np.uint64(255)
    looked, rows = 0, np.int64(1)
    for k in range(4):
        rows *= high[k] - low[k] + 1
    for row in range(rows):
        rest = row
        for k in range(4):
            wide = high[k] - low[k] + 1
            cells[k] = low[k] + rest % wide
            rest //= wide
        mask01 = combined(masks[0, cells[0] - low[0]], masks[1, cells[1] - low[1]])
        mask23 = combined(masks[2, cells[2] - low[2]], masks[3, cells[3] - low[3]])
        cells[4] = low[4]
        begin = cell_code(cells)
        end = begin + high[4] - low[4]
        at = np.searchsorted(codes, np.uint32(begin))
        # The cells of a row follow each other, unless the table is damaged.
        while at < len(codes) and begin <= codes[at] <= end:
            cells[4] = low[4] + codes[at] - begin
            mask4 = masks[4, cells[4] - low[4]]
            looked += 1
            for e in range(int(starts[at]), min(int(starts[at + 1]), len(words))):
                # In rows of trees one cell may hold millions of quads, all of them hits.
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
def misfit(word: np.uint64, cells: NDArray[np.int64], wanted: NDArray[np.float64]) -> float:
    """Square metres: sum of the squared differences between the lengths of a quad in cell `cells` and `wanted` (5,)."""
    total = 0.0
    for k in range(5):
        place = np.int64(word >> np.uint64(3 * k)) & (SIDE - 1)
        if cells[k] < LAST:
            total += (STEP * (SIDE * cells[k] + place) - wanted[k]) ** 2
    return total


@kernel
def places(lowest: int, highest: int) -> np.uint64:
    """Mask of the places of a cell from `lowest` to `highest`."""
    mask = np.uint64(0)
    for r in range(max(lowest, 0), min(highest, SIDE - 1) + 1):
        mask |= np.uint64(1) << np.uint64(r)
    return mask


@kernel
def combined(first: np.uint64, second: np.uint64) -> np.uint64:
    """Places of two lengths that two masks of eight bits allow, the first length's place lowest."""
    mask = np.uint64(0)
    for r in range(SIDE):
        if (second >> np.uint64(r)) & np.uint64(1):
            mask |= first << np.uint64(SIDE * r)
    return mask
