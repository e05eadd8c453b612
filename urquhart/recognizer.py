"""The whole method: where in this collection was this observation made?

    describe   landmarks -> tessellation -> polygons and quads     landmarks, tessellation, descriptor, quads, features
    propose    features -> near ones -> votes -> hypotheses        index, quad_index, voting, matching, proposing
    verify     each hypothesis against all landmarks               pairing, verification
    doubt      what else would explain the data as well            confidence
    rank       candidates, verdict, reason                         ranking

Polygons are asked first; quads where polygons do not settle it; where both find nothing, the nearest submaps are
compared one by one.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from urquhart.collection_index import CollectionIndex
from urquhart.confidence import climb, log_odds, log_volume, same_place
from urquhart.config import Config
from urquhart.features import Features, describe
from urquhart.landmarks import LandmarkError
from urquhart.proposing import (
    Proposal,
    Sighting,
    propose_by_pairs,
    propose_by_paper,
    propose_by_polygons,
    propose_by_quads,
)
from urquhart.ranking import Candidate, Verdict, best_by_submap, decide, make_candidate, refusal
from urquhart.stages import Stage, Stages
from urquhart.verification import pattern

Method = Literal["robust", "paper"]


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """The answer to one observation.

    Attributes:
        verdict, reason: what to make of it, in one word each.
        candidates: verified submaps, best first.
        margin: evidence of the best candidate over the best distinct pose; None where it was too weak to be compared.
        stages: what each stage found and cost, in order.
    """

    verdict: Verdict
    reason: str
    candidates: tuple[Candidate, ...]
    margin: float | None
    stages: tuple[Stage, ...]


class Recognizer:
    """Submaps of one collection, and the look-up in them.

    Not safe for `add` or `remove` during a `recognize`; any number of `recognize` may run side by side.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self._index = CollectionIndex(config)

    def __len__(self) -> int:
        return len(self._index)

    def __contains__(self, key: int) -> bool:
        return key in self._index

    def features(self, key: int) -> Features:
        """Features of a submap. Raises KeyError."""
        return self._index.features(key)

    def add(self, items: Iterable[tuple[int, Features]]) -> None:
        """Add submaps by key; a key that is present is replaced. Many at once are far cheaper than one by one.

        Raises:
            ValueError: features made with another configuration; nothing is added.
        """
        self._index.add(items)

    def remove(self, keys: Iterable[int]) -> None:
        """Forget submaps; unknown keys are ignored."""
        self._index.remove(keys)

    def recognize(
        self,
        xy: ArrayLike,
        *,
        limit: int = 5,
        method: Method = "robust",
        exclude: Collection[int] = (),
        rng: np.random.Generator | None = None,
    ) -> Recognition:
        """Look an observation up.

        Args:
            xy: (N, 2), metres, any rigid frame.
            limit: most candidates returned.
            exclude: keys of submaps that are not to be considered.
            rng: randomness of the paper's method (sampling, RANSAC); a fixed seed by default.

        Raises:
            LandmarkError: for input that is wrong. Too few landmarks, or all on one line, is normal life for a robot
                and answered with `no_match` and the reason.
        """
        stages, excluded = Stages(), frozenset(exclude)
        try:
            with stages.timed("describe") as counts:
                features = describe(xy, self.config)
                counts.update(features.counts())
        except LandmarkError as error:
            if error.code not in ("too_few", "collinear"):
                raise
            return Recognition("no_match", f"{error.code}_landmarks", (), None, stages.done())
        if not self._index.has_others(excluded):
            return Recognition("no_match", "empty_collection", (), None, stages.done())

        laid = pattern(features, self._index.reach)
        query = Sighting(features, laid, excluded, log_volume(len(self), laid))
        if method == "paper":
            proposals = propose_by_paper(self._index, query, rng or np.random.default_rng(0), stages)
            ranked, lead = self._doubt(proposals, query, stages)
        else:
            proposals = propose_by_polygons(self._index, query, stages)
            ranked, lead = self._doubt(proposals, query, stages)
            if not self._settled(ranked, lead, query):
                proposals = ranked + propose_by_quads(self._index, query, stages)
                ranked, lead = self._doubt(proposals, query, stages)
            if self._lost(ranked, query):
                proposals = ranked + propose_by_pairs(self._index, query, self._nearest(ranked, excluded), stages)
                ranked, lead = self._doubt(proposals, query, stages)

        candidates = tuple(
            make_candidate(proposal, self.features(proposal.key), query, lead if i == 0 else None, self.config)
            for i, proposal in enumerate(ranked[:limit])
        )
        verdict, reason = decide(candidates) if proposals else ("no_match", "no_votes")
        return Recognition(verdict, reason, candidates, lead, stages.done())

    def _settled(self, ranked: list[Proposal], lead: float | None, query: Sighting) -> bool:
        """Whether the first proposal is so sure that another level could not change the answer."""
        if not ranked:
            return False
        odds = log_odds(ranked[0].verified, query.pattern, query.volume)
        return odds > 2.0 * self.config.gate and refusal(ranked[0].verified, odds, lead, self.config) is None

    def _lost(self, ranked: list[Proposal], query: Sighting) -> bool:
        """Whether no proposal is better than chance. Too close a rival is another matter: more poses do not mend it."""
        return not ranked or log_odds(ranked[0].verified, query.pattern, query.volume) < self.config.gate

    def _nearest(self, ranked: list[Proposal], excluded: frozenset[int]) -> list[int]:
        """Submaps to compare one by one: those proposed so far, then any others where there are not many."""
        proposed = dict.fromkeys(proposal.key for proposal in ranked)
        if len(self) <= self.config.pairs:
            proposed |= dict.fromkeys(key for key in self._index if key not in excluded)
        return list(proposed)[: self.config.pairs]

    def _doubt(self, proposals: list[Proposal], query: Sighting, stages: Stages) -> tuple[list[Proposal], float | None]:
        """Proposals best first, one a submap, and the evidence of the first over the best pose of another place."""
        with stages.timed("doubt") as counts:
            counts["rivals"] = 0
            ranked, reach = best_by_submap(proposals), self._index.reach
            if self._lost(ranked, query):
                return ranked, None
            here = self._index.pattern(ranked[0].key)
            best, rivals = climb(query.pattern, here, ranked[0].verified, reach)
            ranked[0] = replace(ranked[0], verified=best)
            evidence = max([0.0, *(rival.evidence for rival in rivals)])
            # Only what could change the verdict is looked at: overlapping submaps of one place are many.
            harmless = (1.0 - self.config.margin) * best.evidence - self.config.gate
            for other in ranked[1:]:
                if other.verified.evidence <= max(evidence, harmless):
                    break
                there = self._index.pattern(other.key)
                if not same_place(here, best.transform, there, other.verified.transform, reach):
                    evidence = other.verified.evidence
            counts["rivals"] = len(rivals)
            return ranked, best.evidence - evidence


def warm_up(config: Config) -> None:
    """Compile every kernel, or load it from the cache, so that no query has to wait for that."""
    rng = np.random.default_rng(0)
    recognizer = Recognizer(config)
    here, elsewhere, unknown = (rng.uniform(-20.0, 20.0, (60, 2)) for _ in range(3))
    features = [describe(here, config), Features.unpack(describe(here, config).pack()), describe(elsewhere, config)]
    recognizer.add(enumerate(features))
    for xy in (here, elsewhere, unknown):
        recognizer.recognize(xy)
        recognizer.recognize(xy, method="paper")
