"""The search through tables of quads, rarest first, for submaps in which many hits agree on a pose.

A hit is a stored quad whose five lengths agree with those of a query quad within a tolerance. A single hit says little,
because most hits are coincidences. But each hit gives a pose, by the direction and the centre of both quads, and the
true hits agree on one. Every hit is compared with earlier hits in its submap, and the weights of those that agree are
added up. The weight of a hit is the logarithm of how much likelier it is under the right pose than by chance, so a rare
shape counts more than a common one. Quads are searched in the order of their rarity: the rarer half takes a fifth of
the time and answers most queries.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import Budget
from urquhart.index.quad_hits import MOST_SEARCHED, WantedQuads, count_hits, place_hits
from urquhart.index.quad_search import QuadShard, count_neighbourhoods, gather
from urquhart.index.quad_table import TURNS, QuadShapes
from urquhart.propose.hit_buffer import HitBuffer
from urquhart.propose.quad_vote_kernels import (
    AGREEMENT,
    SLOT_VOTES,
    QuadHits,
    fit_poses,
    order_by_slots,
    rank_turns,
    tally,
    vote,
)


class ConsensusNumbers(NamedTuple):
    """The weight of a hit, and how much work a search does between two checks of its budget. Chosen by hand, not
    fitted, unless a field says otherwise."""

    chunk: int = 32
    """Query quads that are searched in all tables before the number of hits is checked."""
    seen: float = 0.2
    """Rough share of a query's quads that are found under the right pose; it only shifts the weight of a hit."""
    agree: float = 2e-4
    """Chance that two hits of a submap agree on a pose within the tolerances of `AgreementNumbers`. Measured once in
    the paper's forest; no command repeats it."""
    compared: int = 50_000
    """Hits that are compared with others before the budget is checked: 20 ms."""
    rare: int = 4
    """Stored quads in the cell of a query quad up to which it is as rare as any. In a small collection, cells hold so
    few that a quad with none is rather one that is not stored."""
    spread: float = 0.8
    """Usual error of a length as a share of the tolerance."""
    common: int = 64
    """A query quad is skipped in a table if its hits there exceed the limit of the search divided by this."""


CONSENSUS: Final = ConsensusNumbers()
TURN: Final = 1.2 * 2.0 * math.pi / AGREEMENT.turn_bins
"""Radians: largest distance of a submap's rotation from the peak of its votes."""


@dataclass(frozen=True, slots=True, eq=False)
class QuadLeaders:
    """The submaps in which quads agree best on a pose, the best first.

    Attributes:
        slots: (K,) int64, numbered through all shards.
        scores: (K,) float64, logarithm of how much likelier the hits are under the right pose than by chance.
        support: (K,) int64, number of hits that agree on the best pose.
        poses: (K, P, 3) float64, x, y, yaw of `submap_T_query` between centred frames, right to about a metre; the best
            first, NaN if there are fewer.
    """

    slots: NDArray[np.int64]
    scores: NDArray[np.float64]
    support: NDArray[np.int64]
    poses: NDArray[np.float64]


class QuadConsensus:
    """One search. `advance` searches for the next query quads; `leaders` returns where the hits agree best.

    Attributes:
        hits: number of hits so far.
        passed_over: how often a query quad was skipped in a table because it is too common there.
    """

    def __init__(
        self,
        shards: Sequence[QuadShard],
        shapes: QuadShapes,
        tolerance: float,
        most: int,
        *,
        buffer: HitBuffer | None = None,
        budget: Budget | None = None,
    ) -> None:
        """Prepare to search `shards` for the quads of a query.

        Args:
            shapes: of the query's Q quads.
            tolerance: metres, largest difference of a length.
            most: hits after which the search ends. A query quad that alone has a large part of them is skipped: in rows
                of trees all quads are alike, and finding each of them in every row would take most of the time.
            buffer: memory for the hits as long as the search is used; by default its own.
            budget: when it is spent, the search ends with the hits so far; by default never.

        Raises:
            ValueError: more submaps than one search can tell apart.
        """
        slots = sum(len(shard.alive) for shard in shards)
        if slots > MOST_SEARCHED:
            raise ValueError(f"{slots} submaps, but one search takes at most {MOST_SEARCHED}")
        self._shards, self._most = shards, most
        self._living = max(sum(int(np.count_nonzero(shard.alive)) for shard in shards), 1)
        lengths, directions, self._centres = shapes
        turns = (directions * TURNS + 0.5).astype(np.int64) % TURNS
        self._wanted = WantedQuads(lengths, turns, tolerance, max(most // CONSENSUS.common, 1))
        rarity = np.zeros(len(lengths), np.int64)
        for shard in shards:
            count_neighbourhoods(shard.table.codes, shard.table.starts, lengths, rarity)
        self._order = np.argsort(np.maximum(rarity, CONSENSUS.rare), kind="stable")
        self._buffer = buffer if buffer is not None else HitBuffer()
        self._budget = budget or Budget()
        self._begin()

    def _begin(self) -> None:
        self._looked = self.hits = self._placed = self._listed = self.passed_over = 0
        self._weights, self._shares = np.zeros(len(self._order)), np.zeros(len(self._order))
        slots = sum(len(shard.alive) for shard in self._shards)
        # Zeros cost nothing until they are touched.
        self._slot_votes, self._listed_slots = np.zeros(slots, SLOT_VOTES), np.empty(slots, np.int32)
        self._latest = self._buffer.latest(slots)

    def begun_again(self, tolerance: float) -> "QuadConsensus":
        """A new search for the same quads with another `tolerance`, metres. This one must not be used any more."""
        again = copy(self)
        again._wanted = self._wanted._replace(tolerance=tolerance)
        again._begin()
        return again

    @property
    def finished(self) -> bool:
        """Whether all query quads have been searched for, or there are enough hits."""
        return self._looked == len(self._order) or self.hits >= self._most

    @property
    def is_cut_short(self) -> bool:
        """Whether the search ended by the number of hits, before all query quads had been searched for."""
        return self._looked < len(self._order) and self.hits >= self._most

    def advance(self, share: float = 1.0, least: int = 1) -> None:
        """Search for the next rarest quads, up to a `share` of all, or until there are enough hits.

        Args:
            share: of all quads of the query.
            least: hits are not compared in submaps in which fewer than this can agree, so `leaders` leaves those out.

        Raises:
            Abandoned: nobody waits for the answer any more.
        """
        target = share * len(self._order)
        before, began = self.hits, self._looked
        while not self.finished and self._looked < target and not self._budget.is_spent():
            chunk = self._order[self._looked : self._looked + CONSENSUS.chunk]
            first, passed = 0, self.passed_over
            for shard in self._shards:
                if self._budget.is_spent():
                    break
                self._gather(shard, first, chunk)
                first += len(shard.alive)
            self._looked += len(chunk)
            if self.passed_over - passed == len(chunk) * len(self._shards):
                # The next quads are more common still. In dense stands, to try them takes most of the time.
                self.passed_over += (len(self._order) - self._looked) * len(self._shards)
                self._looked = len(self._order)
        self._vote(before, self._order[began : self._looked], least)

    def leaders(self, count: int, poses: int, least: int = 1) -> QuadLeaders:
        """The `count` submaps with the best scores, with up to `poses` distinct poses each.

        Submaps in which fewer than `least` hits agree on the best pose are left out.
        """
        listed = self._listed_slots[: self._listed]
        scores = self._slot_votes["score"][listed]
        if len(listed) > count:
            chosen = np.argpartition(-scores, count)[:count]
            listed, scores = listed[chosen], scores[chosen]
        order = np.lexsort((listed, -scores))
        listed, scores = listed[order], scores[order]
        support, rows = fit_poses(listed, poses, self._slot_votes, self._hits())
        kept = support >= least
        return QuadLeaders(listed[kept].astype(np.int64), scores[kept], support[kept], rows[kept])

    def turns(self, count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The `count` pairs of a slot (K,) and a rotation (K,), radians, with the most votes, the best first.

        Here, all hits of a query quad share one vote. A slot comes once for each rotation that is a peak of its votes;
        the true rotation is within `TURN` of a peak.
        """
        slots, peaks, weights = rank_turns(
            self._listed_slots[: self._listed], count, self._latest, self._buffer.hits, self._shares
        )
        order = np.lexsort((slots, -weights))
        return slots[order].astype(np.int64), np.asarray(peaks[order] * (2.0 * np.pi / AGREEMENT.turn_bins), np.float64)

    def _gather(self, shard: QuadShard, first: int, chunk: NDArray[np.int64]) -> None:
        searched = shard.searched(first)
        while len(chunk):
            done, self.hits, passed, full = gather(searched, self._wanted, chunk, self._buffer.raw, self.hits)
            chunk = chunk[done:]
            self.passed_over += passed
            if full:
                self._buffer.grow()
            if self._budget.is_spent():
                return

    def _vote(self, before: int, quads: NDArray[np.int64], least: int) -> None:
        began = self._placed
        found = self._place(self._buffer.raw[before : self.hits], least)
        likely = tally(began, self._placed, self._buffer.hits, len(self._weights))
        self._weights[quads] = np.log(CONSENSUS.seen * self._living / (CONSENSUS.agree * (found[quads] + 1.0)))
        self._shares[quads] = 1.0 / (likely[quads] + 0.1)
        order = order_by_slots(began, self._placed, self._buffer.hits, len(self._slot_votes))
        for begin in range(0, len(order), CONSENSUS.compared):
            if self._budget.is_spent():
                return
            chunk = order[begin : begin + CONSENSUS.compared]
            self._listed = vote(chunk, self._hits(), self._slot_votes, self._listed_slots, self._listed)

    def _place(self, raw: NDArray[Any], least: int) -> NDArray[np.float64]:
        """Give a pose to the hits that at least `least` may agree with; return the number of hits of each quad."""
        sectors = self._buffer.sectors(len(self._slot_votes) if least > 1 else 0)
        found = count_hits(raw, self._wanted.directions, sectors)
        self._buffer.make_room(self._placed + len(raw))
        first, error = 0, CONSENSUS.spread * self._wanted.tolerance
        for shard in self._shards:
            if self._budget.is_spent():
                break
            enough = (least, sectors, error)
            hits, count = self._buffer.hits, self._placed
            self._placed = place_hits(raw, self._wanted, (first, shard.scales), enough, hits, count)
            first += len(shard.alive)
        return found

    def _hits(self) -> QuadHits:
        return QuadHits(self._buffer.hits, self._latest, self._buffer.totals, self._centres, self._weights)
