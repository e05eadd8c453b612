"""Quads that agree on a pose: the search through tables of quads, rarest first.

A query quad finds, in every submap it might be in, those whose five lengths agree within a tolerance. Alone a hit says
little: there are far more by chance than true ones. But a hit is a pose (its rotation, and where its centre goes), and
the true ones agree on it. Every hit is compared with the earlier ones of its submap; what agrees adds up. A hit is
worth the logarithm of how much likelier it is under the right pose than by chance, so that a rare shape says more than
a common one. Quads are looked for in the order of their rarity: the rarer half costs a fifth and mostly settles it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.quad_table import HALF, SIDE, STEP, TURNS, QuadTable, cell_code, measure_quads

_CHUNK: Final = 32
"""Query quads looked for before their hits are compared."""
_SEEN: Final = 0.2
"""Share of a query's quads that are found under the right pose, roughly; it only shifts what a hit is worth."""
_AGREE: Final = 2e-4
"""Chance that two hits of a submap agree on a pose (measured; the tolerances below)."""
_TURN: Final = 10
"""256ths of a turn that the rotations of two hits may differ by."""
_STRETCH: Final = 1.2
"""Metres that the distance between two quads may differ by."""
_BEND: Final = 0.22
"""Share of that distance that the second may lie beside where the first has it."""
_SPREAD: Final = 0.8
"""Usual error of a length as a share of the tolerance."""
_WALK: Final = 48
"""Earlier hits of a submap that one is compared with."""
_LEVER: Final = 4.0
"""Metres to either side of a quad's centre that its direction is taken to be good for."""
_COMMON: Final = 64
"""A query quad with more than this part of the hits that are enough is passed over."""
_DEEP: Final = 1024
"""Hits of a slot among which its poses are chosen."""
_FIRST: Final = 4096
_TURN_BINS: Final = 30
"""Bins of rotation; a vote is shared between the two nearest, so that no border splits a true peak."""
TURN: Final = 1.2 * 2.0 * math.pi / _TURN_BINS
"""Radians: how far the rotation of a submap may be from the peak of its votes."""


@dataclass(frozen=True, slots=True, eq=False)
class Lot:
    """A table to search, with what lives in it.

    Attributes:
        table: quads.
        scales: (S,) float32, `centre_scale` of every slot.
        alive: (S,) uint8, 0 for slots that are not to be found.
    """

    table: QuadTable
    scales: NDArray[np.float32]
    alive: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Leaders:
    """Submaps in which quads agree best on a pose, the best first.

    Attributes:
        slots: (K,) int64, numbered through all lots.
        scores: (K,) float64, logarithm of how much likelier the hits are under the right pose than by chance.
        votes: (K,) int64, hits that agree on the best pose.
        poses: (K, P, 3) float64, x, y, yaw of `submap_T_query` between centred frames, good to about a metre; the best
            first, others NaN where there are fewer.
    """

    slots: NDArray[np.int64]
    scores: NDArray[np.float64]
    votes: NDArray[np.int64]
    poses: NDArray[np.float64]


class Consensus:
    """One search. `advance` goes on with the next query quads; `leaders` says where they agree best."""

    def __init__(
        self,
        lots: Sequence[Lot],
        landmarks: NDArray[np.float64],
        quads: NDArray[np.int32],
        tolerance: float,
        most: int,
    ) -> None:
        """Prepare to search `lots` for the quads (Q, 4) of landmarks (N, 2), metres.

        Args:
            tolerance: metres that a length may be off by.
            most: hits that are enough. A query quad that has a large part of them to itself is passed over: in rows of
                trees all quads are alike, and looking for each in every row would take longer than everything else.
        """
        self._lots, self._tolerance, self._most = lots, tolerance, most
        self._living = max(sum(int(lot.alive.sum()) for lot in lots), 1)
        self._lengths, directions, self._centres = measure_quads(landmarks, quads)
        self._directions = (directions * TURNS + 0.5).astype(np.int64) % TURNS
        rarity = np.zeros(len(quads), np.int64)
        for lot in lots:
            count_neighbourhoods(lot.table.codes, lot.table.starts, self._lengths, rarity)
        self._order = np.argsort(rarity, kind="stable")
        self._looked = self.hits = self._listed = 0
        self._weights, self._shares = np.zeros(len(quads)), np.zeros(len(quads))
        self._found = tuple(np.empty(_FIRST, dtype) for dtype in _HIT)
        slots = sum(len(lot.alive) for lot in lots)
        # Zeros cost nothing until they are touched: hits are numbered from 1 here.
        self._latest, self._best, self._scores = np.zeros(slots, np.int32), np.zeros(slots, np.int32), np.zeros(slots)
        self._listed_slots = np.empty(slots, np.int32)

    @property
    def finished(self) -> bool:
        """Whether every query quad has been looked for, or enough has been found."""
        return self._looked == len(self._order) or self.hits >= self._most

    def advance(self, share: float = 1.0) -> None:
        """Look for the next rarest quads, until `share` of all have been looked for or there are hits enough."""
        target = share * len(self._order)
        while not self.finished and self._looked < target:
            chunk = self._order[self._looked : self._looked + _CHUNK]
            before, first = self.hits, 0
            for lot in self._lots:
                self._gather(lot, first, chunk)
                first += len(lot.alive)
            self._vote(before, chunk)
            self._looked += len(chunk)

    def leaders(self, count: int, poses: int) -> Leaders:
        """The `count` submaps with the best score, with up to `poses` distinct poses each."""
        listed = self._listed_slots[: self._listed]
        scores = self._scores[listed]
        if len(listed) > count:
            chosen = np.argpartition(-scores, count)[:count]
            listed, scores = listed[chosen], scores[chosen]
        order = np.lexsort((listed, -scores))
        listed, scores = listed[order], scores[order]
        votes, rows = fit_poses(listed, poses, self._latest, self._best, *self._found, self._centres, self._weights)
        return Leaders(listed.astype(np.int64), scores, votes, rows)

    def turns(self, count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The `count` pairs of a slot (K,) and a rotation (K,), radians, that hits agree on best, the best first.

        Here a hit counts by its share in all that its query quad found. A slot comes once for each rotation that is a
        peak of its votes; `TURN` is how far a peak may be off.
        """
        slots, peaks, weights = rank_turns(
            self._listed_slots[: self._listed], count, self._latest, *self._found, self._shares
        )
        order = np.lexsort((slots, -weights))
        return slots[order].astype(np.int64), peaks[order] * (2.0 * np.pi / _TURN_BINS)

    def _gather(self, lot: Lot, first: int, chunk: NDArray[np.int64]) -> None:
        done = 0
        while done < len(chunk):
            done, self.hits = gather(
                lot.table.codes,
                lot.table.starts,
                lot.table.words,
                lot.scales,
                lot.alive,
                first,
                self._lengths,
                self._directions,
                chunk,
                done,
                self._tolerance,
                max(self._most // _COMMON, 1),
                *self._found,
                self.hits,
            )
            if done < len(chunk):
                self._found = tuple(_grown(column) for column in self._found)

    def _vote(self, before: int, chunk: NDArray[np.int64]) -> None:
        quads = self._found[1][before : self.hits]
        found = np.bincount(quads, minlength=len(self._weights))[chunk]
        likely = np.bincount(quads, np.exp(self._found[6][before : self.hits]), len(self._weights))[chunk]
        self._weights[chunk] = np.log(_SEEN * self._living / (_AGREE * (found + 1.0)))
        self._shares[chunk] = 1.0 / (likely + 0.1)
        self._listed = vote(
            before,
            self.hits,
            *self._found,
            self._centres,
            self._weights,
            self._latest,
            self._best,
            self._scores,
            self._listed_slots,
            self._listed,
        )


_HIT: Final = (np.int32, np.int32, np.int16, np.float32, np.float32, np.float32, np.float32, np.int32, np.float32)
"""Columns of a hit: slot; query quad; rotation, 256ths of a turn; x, y of the quad in the submap, metres; their step;
log-likelihood of the misfit; the slot's hit before it, numbered from 1; what agrees with it, itself included."""


def _grown(array: NDArray[Any]) -> NDArray[Any]:
    larger = np.empty(2 * len(array), array.dtype)
    larger[: len(array)] = array
    return larger


@kernel
def count_neighbourhoods(
    codes: NDArray[np.int64], starts: NDArray[np.int64], lengths: NDArray[np.float64], counts: NDArray[np.int64]
) -> None:
    """Add to `counts` (Q,) how many quads lie in the cell of each query quad: enough to tell rare ones from common."""
    cells = np.empty(5, np.int64)
    for q in range(len(lengths)):
        for k in range(5):
            cells[k] = np.int64(lengths[q, k] / STEP + 0.5) // SIDE
        code = cell_code(cells)
        at = np.searchsorted(codes, code)
        if at < len(codes) and codes[at] == code:
            counts[q] += starts[at + 1] - starts[at]


@kernel
def gather(
    codes: NDArray[np.int64],
    starts: NDArray[np.int64],
    words: NDArray[np.uint64],
    scales: NDArray[np.float32],
    alive: NDArray[np.uint8],
    first: int,
    lengths: NDArray[np.float64],
    directions: NDArray[np.int64],
    chunk: NDArray[np.int64],
    done: int,
    tolerance: float,
    most: int,
    slots: NDArray[np.int32],
    quads: NDArray[np.int32],
    turns: NDArray[np.int16],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    steps: NDArray[np.float32],
    fits: NDArray[np.float32],
    earlier: NDArray[np.int32],
    totals: NDArray[np.float32],
    count: int,
) -> tuple[int, int]:
    """Append the hits of the query quads `chunk[done:]` in one table; how many of the chunk are done, and hits.

    Stops before a quad whose hits find no room. One with more than `most` hits has none.
    """
    capacity, size = len(slots), len(words)
    low, high = np.empty(5, np.int64), np.empty(5, np.int64)
    wanted, cells = np.empty(5), np.empty(5, np.int64)
    # Which places of a cell each length allows, by cell.
    masks = np.empty((5, int(2.0 * tolerance / (STEP * SIDE)) + 3), np.uint64)
    one, six, three, byte = np.uint64(1), np.uint64(63), np.uint64(7), np.uint64(255)
    spread = 1.0 / (2.0 * (_SPREAD * tolerance) ** 2)
    while done < len(chunk):
        q = chunk[done]
        before = count
        for reading in range(2):
            if reading == 1 and lengths[q, 0] - lengths[q, 2] > 2.0 * tolerance:
                break
            for k in range(4):
                wanted[k] = lengths[q, (k + 2 * reading) % 4]
            wanted[4] = lengths[q, 4]
            for k in range(5):
                lowest = max(math.ceil((wanted[k] - tolerance) / STEP), 0)
                highest = math.floor((wanted[k] + tolerance) / STEP)
                low[k], high[k] = lowest // SIDE, highest // SIDE
                for c in range(low[k], high[k] + 1):
                    masks[k, c - low[k]] = places(lowest - SIDE * c, highest - SIDE * c)
            rows = np.int64(1)
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
                at = np.searchsorted(codes, begin)
                # The cells of a row follow each other.
                while at < len(codes) and codes[at] <= end:
                    cells[4] = low[4] + codes[at] - begin
                    mask4 = masks[4, cells[4] - low[4]]
                    for e in range(max(starts[at], 0), min(starts[at + 1], size)):
                        word = words[e]
                        allowed = (
                            (mask01 >> (word & six))
                            & (mask23 >> ((word >> np.uint64(6)) & six))
                            & (mask4 >> ((word >> np.uint64(12)) & three))
                            & one
                        )
                        if allowed == 0:
                            continue
                        slot = np.int64(word >> np.uint64(39))
                        if slot >= len(alive) or alive[slot] == 0:
                            continue
                        if count == capacity:
                            return done, before
                        misfit = 0.0
                        for k in range(5):
                            place = np.int64(word >> np.uint64(3 * k)) & (SIDE - 1)
                            misfit += (STEP * (SIDE * cells[k] + place) - wanted[k]) ** 2
                        turn = np.int64((word >> np.uint64(15)) & byte) - directions[q] + (TURNS // 2) * reading
                        slots[count], quads[count], turns[count] = first + slot, q, turn & (TURNS - 1)
                        xs[count] = (np.int64((word >> np.uint64(23)) & byte) - HALF) * scales[slot]
                        ys[count] = (np.int64((word >> np.uint64(31)) & byte) - HALF) * scales[slot]
                        steps[count], fits[count] = scales[slot], -spread * misfit
                        count += 1
                    at += 1
                if count - before > most:
                    break
            if count - before > most:
                count = before
                break
        done += 1
    return done, count


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


@kernel
def vote(
    before: int,
    count: int,
    slots: NDArray[np.int32],
    quads: NDArray[np.int32],
    turns: NDArray[np.int16],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    steps: NDArray[np.float32],
    fits: NDArray[np.float32],
    earlier: NDArray[np.int32],
    totals: NDArray[np.float32],
    centres: NDArray[np.float64],
    weights: NDArray[np.float64],
    latest: NDArray[np.int32],
    best: NDArray[np.int32],
    scores: NDArray[np.float64],
    listed_slots: NDArray[np.int32],
    listed: int,
) -> int:
    """Compare the hits `before` to `count` with earlier ones of their slots; the new number of slots listed."""
    for h in range(before, count):
        slot = slots[h]
        total = max(weights[quads[h]] + fits[h], 0.0)
        other, walked = latest[slot] - 1, 0
        while other >= 0 and walked < _WALK:
            if agree(h, other, quads, turns, xs, ys, steps, centres):
                total += max(weights[quads[other]] + fits[other], 0.0)
            other = earlier[other] - 1
            walked += 1
        earlier[h], latest[slot], totals[h] = latest[slot], h + 1, total
        if best[slot] == 0:
            listed_slots[listed] = slot
            listed += 1
        if best[slot] == 0 or total > scores[slot]:
            scores[slot], best[slot] = total, h + 1
    return listed


@kernel
def agree(
    first: int,
    second: int,
    quads: NDArray[np.int32],
    turns: NDArray[np.int16],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    steps: NDArray[np.float32],
    centres: NDArray[np.float64],
) -> bool:
    """Whether hits of two quads in one slot put the query in about the same place, turned about the same way."""
    q, r = quads[first], quads[second]
    a, b = np.int64(turns[first]), np.int64(turns[second])
    apart = ((b - a + TURNS // 2) & (TURNS - 1)) - TURNS // 2
    if q == r or abs(apart) > _TURN:
        return False
    ux, uy = xs[second] - xs[first], ys[second] - ys[first]
    vx, vy = centres[r, 0] - centres[q, 0], centres[r, 1] - centres[q, 1]
    here = math.sqrt(vx * vx + vy * vy)
    slack = _STRETCH + steps[first]
    if abs(math.sqrt(ux * ux + uy * uy) - here) > slack:
        return False
    yaw = (a + 0.5 * apart) * (2.0 * math.pi / TURNS)
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = c * vx - s * vy - ux, s * vx + c * vy - uy
    return bool(dx * dx + dy * dy <= (slack + _BEND * here) ** 2)


@kernel
def fit_poses(
    chosen: NDArray[np.int32],
    count: int,
    latest: NDArray[np.int32],
    best: NDArray[np.int32],
    slots: NDArray[np.int32],
    quads: NDArray[np.int32],
    turns: NDArray[np.int16],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    steps: NDArray[np.float32],
    fits: NDArray[np.float32],
    earlier: NDArray[np.int32],
    totals: NDArray[np.float32],
    centres: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Hits that agree on the best pose of each slot `chosen` (K,), and up to `count` distinct poses (K, count, 3).

    A pose is fitted to a hit and to all earlier ones that agree with it, by least squares of two points a hit: `_LEVER`
    from its centre along a direction, so that both where it is and how it is turned count.
    """
    votes, poses = np.zeros(len(chosen), np.int64), np.full((len(chosen), count, 3), np.nan)
    picked = np.empty(count, np.int64)
    for i in range(len(chosen)):
        picks = 0
        pick = best[chosen[i]] - 1
        while picks < count and pick >= 0:
            total = px = py = ux = uy = dot = cross = 0.0
            other, walked, agreeing = pick, 0, 0
            while other >= 0 and walked <= _WALK:
                if other == pick or agree(pick, other, quads, turns, xs, ys, steps, centres):
                    w = max(weights[quads[other]] + fits[other], 0.1)
                    yaw = turns[other] * (2.0 * math.pi / TURNS)
                    qx, qy = centres[quads[other], 0], centres[quads[other], 1]
                    sx, sy = xs[other], ys[other]
                    total += w
                    px += w * qx
                    py += w * qy
                    ux += w * sx
                    uy += w * sy
                    dot += w * (qx * sx + qy * sy + _LEVER * _LEVER * math.cos(yaw))
                    cross += w * (qx * sy - qy * sx + _LEVER * _LEVER * math.sin(yaw))
                    agreeing += 1
                other = earlier[other] - 1
                walked += 1
            px, py, ux, uy = px / total, py / total, ux / total, uy / total
            yaw = math.atan2(cross - total * (px * uy - py * ux), dot - total * (px * ux + py * uy))
            c, s = math.cos(yaw), math.sin(yaw)
            poses[i, picks, 0], poses[i, picks, 1], poses[i, picks, 2] = ux - c * px + s * py, uy - s * px - c * py, yaw
            if picks == 0:
                votes[i] = agreeing
            picked[picks] = pick
            picks += 1
            pick, other, walked = -1, latest[chosen[i]] - 1, 0
            while other >= 0 and walked < _DEEP:
                if pick < 0 or totals[other] > totals[pick]:
                    new = True
                    for p in range(picks):
                        same = quads[other] == quads[picked[p]] and slots[other] == slots[picked[p]]
                        if other == picked[p] or (
                            not same and agree(picked[p], other, quads, turns, xs, ys, steps, centres)
                        ):
                            new = False
                    if new:
                        pick = other
                other = earlier[other] - 1
                walked += 1
    return votes, poses


@kernel
def rank_turns(
    listed: NDArray[np.int32],
    count: int,
    latest: NDArray[np.int32],
    slots: NDArray[np.int32],
    quads: NDArray[np.int32],
    turns: NDArray[np.int16],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    steps: NDArray[np.float32],
    fits: NDArray[np.float32],
    earlier: NDArray[np.int32],
    totals: NDArray[np.float32],
    shares: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float64]]:
    """The `count` heaviest peaks of rotation among slots `listed`: slots (K,), bins (K,) and weights (K,)."""
    out_slots, out_bins = np.empty(count, np.int32), np.empty(count, np.int64)
    weights = np.zeros(count)
    table = np.empty(_TURN_BINS)
    found = 0
    for i in range(len(listed)):
        table[:] = 0.0
        h = latest[listed[i]] - 1
        while h >= 0:
            place = turns[h] * (_TURN_BINS / TURNS)
            below = int(place)
            weight = math.exp(fits[h]) * shares[quads[h]]
            table[below] += weight * (below + 1 - place)
            table[(below + 1) % _TURN_BINS] += weight * (place - below)
            h = earlier[h] - 1
        for b in range(_TURN_BINS):
            weight = table[b]
            if weight <= 0.0 or weight < table[b - 1] or weight <= table[(b + 1) % _TURN_BINS]:
                continue
            # A heap of the heaviest so far, the lightest of them at its top.
            if found < count:
                at = found
                found += 1
                while at > 0 and weights[(at - 1) // 2] > weight:
                    above = (at - 1) // 2
                    weights[at], out_slots[at], out_bins[at] = weights[above], out_slots[above], out_bins[above]
                    at = above
            elif count > 0 and weight > weights[0]:
                at = 0
                while 2 * at + 1 < count:
                    below = 2 * at + 1
                    if below + 1 < count and weights[below + 1] < weights[below]:
                        below += 1
                    if weights[below] >= weight:
                        break
                    weights[at], out_slots[at], out_bins[at] = weights[below], out_slots[below], out_bins[below]
                    at = below
            else:
                continue
            weights[at], out_slots[at], out_bins[at] = weight, listed[i], b
    return out_slots[:found].copy(), out_bins[:found].copy(), weights[:found].copy()
