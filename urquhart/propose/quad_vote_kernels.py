"""The compiled loops of `quad_consensus`: which hits agree on a pose, and on which one."""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.quad_hits import SECTOR, SECTORS
from urquhart.index.quad_table import TURNS


class AgreementNumbers(NamedTuple):
    """When two hits agree on a pose, and how many are compared. Chosen by hand, not fitted."""

    turn: int = 10
    """256ths of a turn: largest difference between the rotations of two hits."""
    stretch: float = 1.2
    """Metres: largest difference between the distances of two quads in the query and in the submap."""
    bend: float = 0.22
    """Largest offset of the second quad from its place relative to the first, as a share of their distance."""
    together: int = 16_384
    """Hits that fit into the processor's cache with the votes of their slots."""
    ahead: int = 64
    """Hits that are prefetched from memory together."""
    walk: int = 48
    """Most earlier hits that a hit is compared with in each sector of rotation of its submap."""
    lever: float = 4.0
    """Metres to either side of a quad's centre of the two points that stand for its direction in a fit."""
    deep: int = 1_024
    """Most hits of each sector of a slot among which its poses are chosen."""
    turn_bins: int = 30
    """Bins of rotation. A vote is shared between the two nearest bins, so that no border splits a true peak."""


AGREEMENT: Final = AgreementNumbers()

SLOT_VOTES: Final = np.dtype([("best", np.int32), ("score", np.float32)])
"""The votes of a slot: the hit that most others agree with, numbered from 1 (0: none); and the total weight of that hit
and those that agree with it."""


class QuadHits(NamedTuple):
    """The hits of a search and the query's quads, as a plain tuple for kernels.

    Attributes:
        hits: (R,) of `HIT`.
        latest: (S, SECTORS) int32, the latest hit of each slot in each sector of rotation, numbered from 1; 0 if none.
        totals: (R,) float32, total weight of each hit and of the earlier ones that agree with it.
        centres: (Q, 2) float64, metres, centred frame: centres of the query's quads.
        weights: (Q,) float64, weight of a hit of each query quad.
    """

    hits: NDArray[Any]
    latest: NDArray[np.int32]
    totals: NDArray[np.float32]
    centres: NDArray[np.float64]
    weights: NDArray[np.float64]


@kernel
def tally(before: int, count: int, hits: NDArray[Any], quads: int) -> NDArray[np.float64]:
    """Sum (Q,) of the likelihoods of each query quad's hits among the hits `before` to `count`."""
    likely = np.zeros(quads)
    for h in range(before, count):
        likely[hits[h].quad] += math.exp(hits[h].fit)
    return likely


@kernel
def order_by_slots(before: int, count: int, hits: NDArray[Any], slots: int) -> NDArray[np.int32]:
    """The hits `before` to `count`, sorted by blocks of neighbouring slots; stable within a block.

    A block has about `AGREEMENT.together` hits, so the earlier hits of a slot are still in the cache when a hit is
    compared with them.
    """
    size = max(slots * AGREEMENT.together // max(count, 1), 1)
    begins = np.zeros((slots - 1) // size + 2, np.int64)
    for h in range(before, count):
        begins[hits[h].slot // size + 1] += 1
    begins[:] = np.cumsum(begins)
    order = np.empty(count - before, np.int32)
    for h in range(before, count):
        block = hits[h].slot // size
        order[begins[block]] = h
        begins[block] += 1
    return order


@kernel
def vote(
    order: NDArray[np.int32],
    found: QuadHits,
    slot_votes: NDArray[Any],
    listed_slots: NDArray[np.int32],
    listed: int,
) -> int:
    """Compare each hit, in the given `order`, with earlier hits of its slot, and update the votes of the slots.

    Hits that agree lie in one sector of rotation or in two neighbouring ones, so a hit is compared with these alone.

    Args:
        order: (K,), indices of the new hits.
        slot_votes: (S,) of `SLOT_VOTES`, updated.
        listed_slots: (S,), slots that have hits, of which the first `listed` are filled in; updated.

    Returns:
        The new number of listed slots.
    """
    hits, latest, totals, centres, weights = found
    touched = 0
    for i in range(len(order)):
        h = order[i]
        if i % AGREEMENT.ahead == 0:
            # Hits are scattered in memory; loads that do not depend on each other run in parallel.
            for k in range(i, min(i + AGREEMENT.ahead, len(order))):
                touched += latest[hits[order[k]].slot, hits[order[k]].turn // SECTOR]
            for k in range(i, min(i + AGREEMENT.ahead, len(order))):
                touched += hits[max(latest[hits[order[k]].slot, hits[order[k]].turn // SECTOR] - 1, 0)].turn
        slot, sector = hits[h].slot, hits[h].turn // SECTOR
        total = max(weights[hits[h].quad] + hits[h].fit, 0.0)
        for near in (sector, sector_beside(hits[h].turn)):
            other, walked = latest[slot, near] - 1, 0
            while other >= 0 and walked < AGREEMENT.walk:
                if agree(h, other, hits, centres):
                    total += max(weights[hits[other].quad] + hits[other].fit, 0.0)
                other = hits[other].earlier - 1
                walked += 1
        hits[h].earlier, latest[slot, sector], totals[h] = latest[slot, sector], h + 1, total
        if slot_votes[slot].best == 0:
            listed_slots[listed] = slot
            listed += 1
        if slot_votes[slot].best == 0 or total > slot_votes[slot].score:
            slot_votes[slot].score, slot_votes[slot].best = total, h + 1
    # `touched` is never negative; the comparison keeps the compiler from removing the loads.
    return listed if touched >= 0 else -1


@kernel
def sector_beside(turn: int) -> int:
    """The sector next to that of a rotation, 256ths of a turn, in which hits may be that agree with it."""
    sector = turn // SECTOR
    return (sector - 1) % SECTORS if turn % SECTOR < SECTOR // 2 else (sector + 1) % SECTORS


@kernel
def agree(first: int, second: int, hits: NDArray[Any], centres: NDArray[np.float64]) -> bool:
    """Whether two hits of one slot, of different query quads, give about the same pose.

    `hits`: (R,) of `HIT`; `centres`: (Q, 2), metres, of the query's quads.
    """
    q, r = hits[first].quad, hits[second].quad
    a, b = np.int64(hits[first].turn), np.int64(hits[second].turn)
    apart = ((b - a + TURNS // 2) & (TURNS - 1)) - TURNS // 2
    if q == r or abs(apart) > AGREEMENT.turn:
        return False
    ux, uy = hits[second].x - hits[first].x, hits[second].y - hits[first].y
    vx, vy = centres[r, 0] - centres[q, 0], centres[r, 1] - centres[q, 1]
    here = math.sqrt(vx * vx + vy * vy)
    slack = AGREEMENT.stretch + hits[first].step
    if abs(math.sqrt(ux * ux + uy * uy) - here) > slack:
        return False
    yaw = (a + 0.5 * apart) * (2.0 * math.pi / TURNS)
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = c * vx - s * vy - ux, s * vx + c * vy - uy
    return bool(dx * dx + dy * dy <= (slack + AGREEMENT.bend * here) ** 2)


@kernel
def fit_poses(
    chosen: NDArray[np.int32], count: int, slot_votes: NDArray[Any], found: QuadHits
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Up to `count` distinct poses for each of the slots `chosen` (K,).

    A pose is the weighted least-squares fit to a hit and to all earlier ones that agree with it. Each hit counts with
    two points, `AGREEMENT.lever` to either side of its centre along its direction, so that both its position and its
    rotation count.

    Returns:
        Number of hits (K,) that agree on the best pose; and poses (K, count, 3): x, y, yaw of `submap_T_query`, centred
        frames, the best first, NaN if there are fewer.
    """
    hits, latest, _, centres, weights = found
    support, poses = np.zeros(len(chosen), np.int64), np.full((len(chosen), count, 3), np.nan)
    picked = np.empty(count, np.int64)
    for i in range(len(chosen)):
        picks = 0
        pick = slot_votes[chosen[i]].best - 1
        while picks < count and pick >= 0:
            total = px = py = ux = uy = dot = cross = 0.0
            agreeing = 0
            for near in (hits[pick].turn // SECTOR, sector_beside(hits[pick].turn)):
                other, walked = latest[chosen[i], near] - 1, 0
                while other >= 0 and walked <= AGREEMENT.walk:
                    if other == pick or (other < pick and agree(pick, other, hits, centres)):
                        w = max(weights[hits[other].quad] + hits[other].fit, 0.1)
                        yaw = hits[other].turn * (2.0 * math.pi / TURNS)
                        qx, qy = centres[hits[other].quad, 0], centres[hits[other].quad, 1]
                        sx, sy = hits[other].x, hits[other].y
                        total += w
                        px += w * qx
                        py += w * qy
                        ux += w * sx
                        uy += w * sy
                        dot += w * (qx * sx + qy * sy + AGREEMENT.lever * AGREEMENT.lever * math.cos(yaw))
                        cross += w * (qx * sy - qy * sx + AGREEMENT.lever * AGREEMENT.lever * math.sin(yaw))
                        agreeing += 1
                    walked += other <= pick
                    other = hits[other].earlier - 1
            px, py, ux, uy = px / total, py / total, ux / total, uy / total
            yaw = math.atan2(cross - total * (px * uy - py * ux), dot - total * (px * ux + py * uy))
            c, s = math.cos(yaw), math.sin(yaw)
            poses[i, picks, 0], poses[i, picks, 1], poses[i, picks, 2] = ux - c * px + s * py, uy - s * px - c * py, yaw
            if picks == 0:
                support[i] = agreeing
            picked[picks] = pick
            picks += 1
            pick = best_other(chosen[i], picked[:picks], found)
    return support, poses


@kernel
def best_other(slot: int, picked: NDArray[np.int64], found: QuadHits) -> int:
    """The hit of a slot with the largest total that agrees with none of the hits `picked` (P,); -1 if there is none."""
    hits, latest, totals, centres, _ = found
    best = -1
    for sector in range(SECTORS):
        other, walked = latest[slot, sector] - 1, 0
        while other >= 0 and walked < AGREEMENT.deep:
            if best < 0 or totals[other] > totals[best]:
                new = True
                for pick in picked:
                    if other == pick or agree(pick, other, hits, centres):
                        new = False
                if new:
                    best = other
            other = hits[other].earlier - 1
            walked += 1
    return best


@kernel
def rank_turns(
    listed: NDArray[np.int32],
    count: int,
    latest: NDArray[np.int32],
    hits: NDArray[Any],
    shares: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float64]]:
    """The `count` heaviest peaks of rotation among the slots `listed` (L,), in no order.

    `latest`: as in `QuadHits`; `shares`: (Q,), weight of a hit of each query quad here.

    Returns:
        Slots (K,), bins of rotation (K,) from 0 to `AGREEMENT.turn_bins` - 1, and weights (K,).
    """
    out_slots, out_bins = np.empty(count, np.int32), np.empty(count, np.int64)
    weights = np.zeros(count)
    table = np.empty(AGREEMENT.turn_bins)
    found = 0
    for i in range(len(listed)):
        table[:] = 0.0
        for sector in range(SECTORS):
            h = latest[listed[i], sector] - 1
            while h >= 0:
                place = hits[h].turn * (AGREEMENT.turn_bins / TURNS)
                below = int(place)
                weight = math.exp(hits[h].fit) * shares[hits[h].quad]
                table[below] += weight * (below + 1 - place)
                table[(below + 1) % AGREEMENT.turn_bins] += weight * (place - below)
                h = hits[h].earlier - 1
        for b in range(AGREEMENT.turn_bins):
            weight = table[b]
            if weight <= 0.0 or weight < table[b - 1] or weight <= table[(b + 1) % AGREEMENT.turn_bins]:
                continue
            # A heap of the heaviest peaks so far, with the lightest of them at its root.
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
