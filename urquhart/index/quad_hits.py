"""Hits of a quad search: how a table's reader notes them, and how those worth comparing get a pose.

A table is read faster than its hits can be compared, and most hits are coincidences. So the reader only lists them;
then they are counted by submap and rotation, and only those with enough others beside them get a pose.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.quad_table import HALF, LAST, SIDE, STEPS, TURNS, cell_of

SECTORS: Final = 8
"""Sectors of rotation in which the hits of a submap are counted and compared."""
SECTOR: Final = TURNS // SECTORS
"""256ths of a turn in a sector."""
MOST_SEARCHED: Final = 1 << 25
"""Slots that the shards of one search can have: those that fit into the word of a `RAW_HIT`."""

RAW_HIT: Final = np.dtype([("word", np.uint64), ("code", np.uint32), ("reading", np.int32)])
"""A hit as it is read: the word of the stored quad, with its slot numbered through all shards; the code of its cell;
and twice the index of the query quad, plus 1 if that was read from the other end of its diagonal."""

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
earlier     the previous hit of the same slot and sector of rotation, numbered from 1; 0 if there is none
x, y        metres, centred submap frame: centre of the stored quad
step        metres, resolution of x and y
fit         logarithm of the likelihood of the misfit of the lengths
"""


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


@kernel
def turn_of(word: np.uint64, reading: int, directions: NDArray[np.int64]) -> int:
    """Rotation of a raw hit from the query frame to the submap frame, 256ths of a turn; `directions`: (Q,)."""
    turned = np.int64((word >> np.uint64(15)) & np.uint64(255)) + (TURNS // 2) * (reading & 1)
    return int((turned - directions[reading >> 1]) & (TURNS - 1))


@kernel
def count_hits(raw: NDArray[Any], directions: NDArray[np.int64], sectors: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Number of hits (Q,) of each query quad among `raw` (K,) of `RAW_HIT`.

    `sectors` (S, SECTORS), if it has rows, is set to the hits of each slot in each sector of rotation, 255 at most.
    """
    found = np.zeros(len(directions))
    sectors[:] = 0
    for h in range(len(raw)):
        word, reading = raw[h].word, raw[h].reading
        found[reading >> 1] += 1.0
        if len(sectors):
            slot, sector = np.int64(word >> np.uint64(39)), turn_of(word, reading, directions) // SECTOR
            sectors[slot, sector] += sectors[slot, sector] < 255
    return found


@kernel
def are_enough(counts: NDArray[np.uint8], turn: int, least: int) -> bool:
    """Whether a slot with `counts` (SECTORS,) may have `least` hits that agree on a rotation with one of `turn`.

    Hits that agree differ by less than a sector, so they lie in two neighbouring ones.
    """
    sector = turn // SECTOR
    beside = max(counts[sector - 1], counts[(sector + 1) % SECTORS])
    return bool(np.int64(counts[sector]) + np.int64(beside) >= least)


@kernel
def place_hits(
    raw: NDArray[Any],
    quads: WantedQuads,
    shard: tuple[int, NDArray[np.float32]],
    enough: tuple[int, NDArray[np.uint8], float],
    hits: NDArray[Any],
    count: int,
) -> int:
    """Append the hits of one shard among `raw` (K,) of `RAW_HIT` to the first `count` rows of `hits` (R,) of `HIT`.

    Args:
        shard: number of its first slot among all shards, and `scales` (S,), metres, the `centre_scale` of each slot.
        enough: hits of a slot that must be near each other in rotation; the `sectors` of `count_hits`, not read if one
            is enough; and the usual error of a length, metres.

    Returns:
        The number of hits. `hits` must have room for all of them.
    """
    first, scales = shard
    least, sectors, error = enough
    byte, spread = np.uint64(255), 1.0 / (2.0 * error**2)
    cells = np.empty(5, np.int64)
    for n in range(len(raw)):
        word, reading = raw[n].word, raw[n].reading
        slot = np.int64(word >> np.uint64(39))
        if slot < first or slot >= first + len(scales):
            continue
        turn = turn_of(word, reading, quads.directions)
        if least > 1 and not are_enough(sectors[slot], turn, least):
            continue
        q, scale = reading >> 1, scales[slot - first]
        cell_of(raw[n].code, cells)
        total = 0.0
        for k in range(5):
            wanted = quads.lengths[q, (k + 2 * (reading & 1)) % 4] if k < 4 else quads.lengths[q, 4]
            place = np.int64(word >> np.uint64(3 * k)) & (SIDE - 1)
            if cells[k] < LAST[k]:
                total += (STEPS[k] * (SIDE * cells[k] + place) - wanted) ** 2
        hits[count].slot, hits[count].quad, hits[count].turn = slot, q, turn
        hits[count].x = (np.int64((word >> np.uint64(23)) & byte) - HALF) * scale
        hits[count].y = (np.int64((word >> np.uint64(31)) & byte) - HALF) * scale
        hits[count].step, hits[count].fit = scale, -spread * total
        count += 1
    return count
