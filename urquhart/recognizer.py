"""The whole method: where in this collection was this observation made?

    describe   landmarks -> tessellation -> polygons and quads     landmarks, tessellation, descriptor, quads, features
    propose    features -> near ones -> votes -> hypotheses        index, quad_index, voting, matching, sweep, proposing
    verify     each hypothesis against all landmarks               pairing, verification
    doubt      what else would explain the data as well            confidence, doubt
    rank       candidates, verdict, reason                         ranking

Polygons are asked first; quads where polygons do not settle it; where both find nothing, the query is turned and
shifted over the few submaps that come closest.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from urquhart.collection_index import CollectionIndex
from urquhart.confidence import (
    against_chance,
    log_odds,
    log_volume,
)
from urquhart.config import Config
from urquhart.doubt import Standing, doubt
from urquhart.features import Features, describe
from urquhart.landmarks import LandmarkError
from urquhart.proposing import (
    Proposal,
    Sighting,
    propose_by_paper,
    propose_by_polygons,
    propose_by_quads,
    propose_by_sweep,
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
from urquhart.sweep import sees_ends
from urquhart.verification import pattern, verify

Method = Literal["robust", "paper"]


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
        diameters: ArrayLike | None = None,
        limit: int = 5,
        method: Method = "robust",
        exclude: Collection[int] = (),
        rng: np.random.Generator | None = None,
    ) -> Recognition:
        """Look an observation up.

        Args:
            xy: (N, 2), metres, any rigid frame.
            diameters: (N,), stem diameters in any unit, NaN where not known; they count where a submap has them too.
            limit: most candidates returned.
            exclude: keys of submaps that are not to be considered.
            rng: randomness of the paper's method (sampling, RANSAC); a fixed seed by default.

        Raises:
            LandmarkError: for input that is wrong. Too few landmarks, or all on one line, is normal life for a robot
                and answered with `no_match` and the reason.
        """
        stages, excluded, found = Stages(), frozenset(exclude), list[Finding]()
        try:
            query = self._look(xy, diameters, excluded, stages)
        except LandmarkError as error:
            if error.code not in ("too_few", "collinear"):
                raise
            return Recognition("no_match", f"{error.code}_landmarks", (), (), None, stages.done(), ())
        if not self._index.has_others(excluded):
            return Recognition("no_match", "empty_collection", (), (), None, stages.done(), ())

        if method == "paper":
            proposals = propose_by_paper(self._index, query, rng or np.random.default_rng(0), stages)
            standing = doubt(self._index, query, proposals, stages, found)
        else:
            standing = Standing([], None, [])
            # Polygons and quads choose among submaps; a single one is swept at once, which needs no choice, but for one
            # so much larger than the query that a sweep would leave out its ends.
            if len(self) > 1 or not all(sees_ends(query.pattern, self._index.pattern(key)) for key in self._index):
                proposals = propose_by_polygons(self._index, query, stages)
                standing = doubt(self._index, query, proposals, stages, found)
                if not self._settled(standing, query):
                    proposals = propose_by_quads(self._index, query, stages)
                    standing = doubt(self._index, query, proposals, stages, found, standing.ranked)
            if self._lost(standing.ranked, query):
                proposals = propose_by_sweep(self._index, query, stages)
                standing = doubt(self._index, query, proposals, stages, found, standing.ranked)
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
        query, submap = self._look(xy, diameters, frozenset(), stages), self._index.features(key)
        start = SE2.shift(submap.origin).inverse() @ transform @ SE2.shift(query.features.origin)
        with stages.timed("verify given"):
            verified = verify(query.pattern, self._index.pattern(key), start, self._index.reach)
        standing = doubt(self._index, query, [Proposal(key, "given", 0, verified)], stages, found)
        return self._conclude(standing, query, 1, stages, found)

    def _look(self, xy: ArrayLike, diameters: ArrayLike | None, excluded: frozenset[int], stages: Stages) -> Sighting:
        with stages.timed("describe") as counts:
            features = describe(xy, self.config, diameters)
            counts.update(features.counts())
            laid = pattern(features, self._index.reach)
        return Sighting(features, laid, excluded, log_volume(len(self), laid))

    def _conclude(
        self, standing: Standing, query: Sighting, limit: int, stages: Stages, found: list[Finding]
    ) -> Recognition:
        ranked, lead, config = standing.ranked, standing.lead, self.config
        candidates = tuple(
            make_candidate(proposal, self.features(proposal.key), query, standing.lead_of(proposal), config)
            for proposal in ranked[:limit]
        )
        verdict, reason = decide(candidates) if found else ("no_match", "no_votes")
        rivals: tuple[Rival, ...] = ()
        if ranked:
            rivals = make_rivals(
                standing.rivals, ranked[0].verified, query, lambda key: self.features(key).origin, config
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
    recognizer.add(enumerate([*features, describe(rows, config)]))
    for xy in (here, elsewhere, unknown, rows):
        recognizer.recognize(xy)
        recognizer.recognize(xy, method="paper")
