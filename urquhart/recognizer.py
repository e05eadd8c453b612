"""The whole method: where in this collection was this observation made?

    describe   landmarks -> tessellation -> polygons and quads     landmarks, tessellation, descriptor, quads, features
    propose    features -> near ones -> votes -> hypotheses        segment, consensus, voting, sweep, proposing
    verify     each hypothesis against all landmarks               pairing, verification
    doubt      what else would explain the data as well            confidence, doubt
    rank       candidates, verdict, reason                         ranking

Quads are asked first, the rarest half of them before all; polygons where that does not settle it; where both find
nothing, quads with a wider tolerance, and at last the query is turned and shifted over the submaps that come closest.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from urquhart.budget import Budget
from urquhart.collection_index import CollectionIndex
from urquhart.confidence import (
    against_chance,
    log_odds,
    log_volume,
)
from urquhart.config import Config
from urquhart.consensus import ROOMS, Room
from urquhart.doubt import Standing, doubt
from urquhart.features import Features, describe
from urquhart.landmarks import LandmarkError
from urquhart.proposing import (
    TIGHT,
    WIDE,
    Proposal,
    Sighting,
    is_large,
    is_small,
    propose_by_paper,
    propose_by_polygons,
    propose_by_quads,
    propose_by_sweep,
    search_quads,
)
from urquhart.ranking import (
    Candidate,
    Finding,
    Rival,
    Verdict,
    decide,
    make_candidate,
    make_rivals,
    refusal,
)
from urquhart.se2 import SE2
from urquhart.stages import Stage, Stages
from urquhart.submaps import Memory, Source, Submaps
from urquhart.sweep import sees_ends
from urquhart.verification import pattern, verify

Method = Literal["robust", "paper"]

_HALF: Final = 0.5
"""Share of a query's quads, the rarest, that mostly settle it,"""
_FIRST: Final = 4
"""and submaps that are verified then at least."""
_MOST: Final = 0.7
"""Share of them that settles most of what is left, where lengths may be off by more."""


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """The answer to one observation.

    Attributes:
        verdict, reason: what to make of it, in one word each.
        candidates: verified submaps, best first.
        rivals: other poses that explain the data about as well as the first candidate's, the strongest first.
        margin: evidence of the best candidate over the best distinct pose; None where it was too weak to be compared.
        stages: what each stage found and cost, in order.
        findings: what each level found in each submap it looked at, in the order of the levels, the best first.
    """

    verdict: Verdict
    reason: str
    candidates: tuple[Candidate, ...]
    rivals: tuple[Rival, ...]
    margin: float | None
    stages: tuple[Stage, ...]
    findings: tuple[Finding, ...]


class Recognizer:
    """Submaps of one collection, and the look-up in them. A look-up sees the collection as it was when it began."""

    def __init__(self, config: Config, index: CollectionIndex | None = None, source: Source | None = None) -> None:
        """Start empty, or with an `index` over submaps whose features are in `source`; by default in memory."""
        self.config = config
        # One pair, replaced as one: a look-up in another thread must not get the index of one state and the features of
        # another.
        self._held = (CollectionIndex(config) if index is None else index, Memory() if source is None else source)

    @property
    def index(self) -> CollectionIndex:
        """What is searched."""
        return self._held[0]

    def __len__(self) -> int:
        return len(self.index)

    def __contains__(self, key: int) -> bool:
        return key in self.index

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        return self._held[1].read((key,))[key]

    def add(self, items: Iterable[tuple[int, Features]]) -> None:
        """Add submaps by key; a key that is present is replaced. Many at once are far cheaper than one by one.

        Raises:
            ValueError: features made with another configuration; nothing is added.
            TypeError: the features are kept elsewhere.
        """
        memory, new = self._memory(), dict(items)
        self._held = (self.index.with_changes(new.items()), memory.with_changes(new, ()))

    def remove(self, keys: Iterable[int]) -> None:
        """Forget submaps; unknown keys are ignored. Raises TypeError: the features are kept elsewhere."""
        memory, gone = self._memory(), list(keys)
        self._held = (self.index.with_changes(removed=gone), memory.with_changes({}, gone))

    def recognize(
        self,
        xy: ArrayLike,
        *,
        diameters: ArrayLike | None = None,
        limit: int = 5,
        method: Method = "robust",
        exclude: Collection[int] = (),
        only: Collection[int] | None = None,
        rng: np.random.Generator | None = None,
        budget: Budget | None = None,
    ) -> Recognition:
        """Look an observation up.

        Args:
            xy: (N, 2), metres, any rigid frame.
            diameters: (N,), stem diameters in any unit, NaN where not known; they count where a submap has them too.
            limit: most candidates returned.
            exclude: keys of submaps that are not to be considered.
            only: keys of those that are; all by default.
            rng: randomness of the paper's method (sampling, RANSAC); a fixed seed by default.
            budget: when the search must end; by default it ends when it is done. An answer at the deadline is
                `no_match` with the reason `deadline` and the candidates found so far: rivals may not have been seen.

        Raises:
            Abandoned: nobody waits for the answer any more.
            LandmarkError: for input that is wrong. Too few landmarks, or all on one line, is normal life for a robot
                and answered with `no_match` and the reason.
        """
        stages, found = Stages(), list[Finding]()
        try:
            query = self._look(xy, diameters, stages, exclude, only, budget)
        except LandmarkError as error:
            if error.code not in ("too_few", "collinear"):
                raise
            return Recognition("no_match", f"{error.code}_landmarks", (), (), None, stages.done(), ())
        if not len(self.index):
            return Recognition("no_match", "empty_collection", (), (), None, stages.done(), ())
        if not len(query.index):
            return Recognition("no_match", "nothing_left", (), (), None, stages.done(), ())
        if method == "paper":
            proposals = propose_by_paper(query, rng or np.random.default_rng(0), stages)
            standing = doubt(query, proposals, stages, found)
        else:
            with ROOMS.lend() as room:
                standing = self._search(query, limit, room, stages, found)
        return self._conclude(standing, query, limit, stages, found)

    def check(self, xy: ArrayLike, key: int, transform: SE2, *, diameters: ArrayLike | None = None) -> Recognition:
        """Verify a given pose as if it had been found, with the same doubts and the same verdict.

        Args:
            transform: `submap_T_query`, in the frames as posted.

        Raises:
            KeyError: no such submap.
            LandmarkError: for input that cannot be described.
        """
        stages, found = Stages(), list[Finding]()
        query = self._look(xy, diameters, stages)
        start = SE2.shift(query.submaps.features(key).origin).inverse() @ transform @ SE2.shift(query.features.origin)
        with stages.timed("verify given"):
            verified = verify(query.pattern, query.submaps.pattern(key), start, query.index.reach)
        standing = doubt(query, [Proposal(key, "given", 0, verified)], stages, found)
        return self._conclude(standing, query, 1, stages, found)

    def _search(self, query: Sighting, limit: int, room: Room, stages: Stages, found: list[Finding]) -> Standing:
        """The levels in the order of their cost, until one leaves nothing to doubt."""
        standing, wide = Standing([], None, []), None
        # Quads and polygons choose among submaps; a single one is swept at once, which needs no choice, but for one so
        # much larger than the query that a sweep would leave out its ends.
        if len(query.index) > 1 or not sees_ends(query.pattern, query.submaps.pattern(next(iter(query.index)))):
            tight = search_quads(query, TIGHT, room)
            for share, count in ((_HALF, max(limit, _FIRST)), (1.0, self.config.candidates)):
                proposals = propose_by_quads(query, tight, share, count, stages)
                standing = doubt(query, proposals, stages, found, standing.ranked)
                if self._settled(standing, query) or query.budget.is_spent():
                    return standing
            proposals = propose_by_polygons(query, stages)
            standing = doubt(query, proposals, stages, found, standing.ranked)
            if query.budget.is_spent():
                return standing
            if self._lost(standing.ranked, query) and not is_small(query.index):
                wide = search_quads(query, WIDE, room)
                for share in (_MOST, 1.0):
                    proposals = propose_by_quads(query, wide, share, self.config.candidates, stages)
                    standing = doubt(query, proposals, stages, found, standing.ranked)
                    if self._settled(standing, query) or query.budget.is_spent():
                        return standing
        if self._lost(standing.ranked, query) and not is_large(query.index):
            proposals = propose_by_sweep(query, wide, stages)
            standing = doubt(query, proposals, stages, found, standing.ranked)
        return standing

    def _look(
        self,
        xy: ArrayLike,
        diameters: ArrayLike | None,
        stages: Stages,
        exclude: Collection[int] = (),
        only: Collection[int] | None = None,
        budget: Budget | None = None,
    ) -> Sighting:
        index, source = self._held
        with stages.timed("describe") as counts:
            features = describe(xy, self.config, diameters)
            counts.update(features.counts())
            laid = pattern(features, index.reach)
        index = index.narrowed(only, exclude)
        submaps, volume = Submaps(source, index.reach), log_volume(len(index), laid)
        return Sighting(features, laid, index, submaps, volume, budget or Budget())

    def _memory(self) -> Memory:
        source = self._held[1]
        if not isinstance(source, Memory):
            raise TypeError("the features of these submaps are kept elsewhere")
        return source

    def _conclude(
        self, standing: Standing, query: Sighting, limit: int, stages: Stages, found: list[Finding]
    ) -> Recognition:
        ranked, lead, config = standing.ranked, standing.lead, self.config
        candidates = tuple(
            make_candidate(proposal, query.submaps.features(proposal.key), query, standing.lead_of(proposal), config)
            for proposal in ranked[:limit]
        )
        verdict, reason = decide(candidates) if found else ("no_match", "no_votes")
        if query.budget.is_spent() and not self._settled(standing, query):
            verdict, reason = "no_match", "deadline"
        rivals: tuple[Rival, ...] = ()
        if ranked:
            rivals = make_rivals(
                standing.rivals, ranked[0].verified, query, lambda key: query.submaps.features(key).origin, config
            )
        return Recognition(verdict, reason, candidates, rivals, lead, stages.done(), tuple(found))

    def _settled(self, standing: Standing, query: Sighting) -> bool:
        """Whether the first proposal is so sure that another level could not change the answer."""
        if not standing.ranked:
            return False
        first = standing.ranked[0].verified
        odds = log_odds(first, query.pattern, query.volume)
        return odds > 2.0 * self.config.gate and refusal(first, odds, standing.lead, self.config) is None

    def _lost(self, ranked: list[Proposal], query: Sighting) -> bool:
        """Whether no proposal is better than chance. Too close a rival is another matter: more poses do not mend it."""
        return (
            not ranked or against_chance(log_odds(ranked[0].verified, query.pattern, query.volume)) < self.config.gate
        )


def warm_up(config: Config) -> None:
    """Compile every kernel, or load it from the cache, so that no query has to wait for that."""
    rng = np.random.default_rng(0)
    recognizer = Recognizer(config)
    here, elsewhere, unknown = (rng.uniform(-20.0, 20.0, (60, 2)) for _ in range(3))
    # Only rows of trees have rivals to be looked at.
    rows = 3.0 * np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    features = [describe(here, config), Features.unpack(describe(here, config).pack()), describe(elsewhere, config)]
    # The second segment is merged with the first.
    recognizer.add(enumerate(features))
    recognizer.add([(len(features), describe(rows, config))])
    for xy in (here, elsewhere, unknown, rows):
        recognizer.recognize(xy)
        recognizer.recognize(xy, method="paper")
