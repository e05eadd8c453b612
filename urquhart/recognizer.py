"""The whole method: where in this collection was this observation made?

    describe   landmarks -> tessellation -> polygons and quads     features
    propose    features -> near ones -> votes -> hypotheses        index, propose
    verify     each hypothesis against all landmarks               verify
    decide     rivals, candidates, verdict, reason                 decide

Quads are asked first, the rarest half of them before all; polygons where that does not settle it; where both find
nothing, quads with a wider tolerance, and at last the query is turned and shifted over the submaps that come closest.
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.decide.confidence import (
    log_volume,
)
from urquhart.decide.doubt import Standing, doubt
from urquhart.decide.ranking import (
    Candidate,
    Finding,
    Rival,
    Verdict,
    decide,
    make_candidate,
    make_rivals,
)
from urquhart.features.describe import Features, describe
from urquhart.features.landmarks import LandmarkError
from urquhart.index.collection_index import CollectionIndex
from urquhart.levels import is_lost, is_settled, propose_by_level
from urquhart.propose.proposals import (
    Proposal,
    Sighting,
    propose_by_paper,
)
from urquhart.propose.quad_consensus import ROOMS
from urquhart.propose.submaps import Memory, Source, Submaps
from urquhart.se2 import SE2
from urquhart.trace import SearchEnd, Stage, Stages, StoppedBy
from urquhart.verify.evidence import pattern, verify

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
        search: why the search ended, and which limits left something out.
    """

    verdict: Verdict
    reason: str
    candidates: tuple[Candidate, ...]
    rivals: tuple[Rival, ...]
    margin: float | None
    stages: tuple[Stage, ...]
    findings: tuple[Finding, ...]
    search: SearchEnd


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
            return _unsearched("no_match", f"{error.code}_landmarks", stages)
        if not len(self.index):
            return _unsearched("no_match", "empty_collection", stages)
        if not len(query.index):
            return _unsearched("no_match", "nothing_left", stages)
        if method == "paper":
            levels = iter([propose_by_paper(query, rng or np.random.default_rng(0), stages)])
            return self._search(query, levels, [], limit, stages, found)
        with ROOMS.lend() as room:
            ranked = list[Proposal]()
            levels = propose_by_level(query, limit, room, stages, ranked)
            return self._search(query, levels, ranked, limit, stages, found)

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
        return self._conclude(standing, query, 1, stages, found, "exhausted")

    def _search(
        self,
        query: Sighting,
        levels: Iterator[list[Proposal]],
        ranked: list[Proposal],
        limit: int,
        stages: Stages,
        found: list[Finding],
    ) -> Recognition:
        """Level by level, until one leaves nothing to doubt or the time is over.

        Args:
            levels: what each level proposes.
            ranked: filled with the proposals so far, best first, before the next level begins.
        """
        standing = Standing([], None, [])
        stopped: StoppedBy | None = None
        for proposals in levels:
            standing = doubt(query, proposals, stages, found, ranked)
            ranked[:] = standing.ranked
            if is_settled(standing, query):
                stopped = "settled"
            elif query.budget.is_spent():
                stopped = "deadline"
            if stopped is not None:
                break
        if stopped is None:
            stopped = "exhausted" if is_lost(ranked, query) else "beats_chance"
        return self._conclude(standing, query, limit, stages, found, stopped)

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
        self,
        standing: Standing,
        query: Sighting,
        limit: int,
        stages: Stages,
        found: list[Finding],
        stopped: StoppedBy,
    ) -> Recognition:
        ranked, lead, config = standing.ranked, standing.lead, self.config
        candidates = tuple(
            make_candidate(proposal, query.submaps.features(proposal.key), query, standing.lead_of(proposal), config)
            for proposal in ranked[:limit]
        )
        verdict, reason = decide(candidates) if found else ("no_match", "no_votes")
        if stopped == "deadline":
            verdict, reason = "no_match", "deadline"
            # Not all that could speak against a candidate has been looked at.
            candidates = tuple(replace(one, refused=one.refused or "deadline") for one in candidates)
        rivals: tuple[Rival, ...] = ()
        if ranked:
            rivals = make_rivals(
                standing.rivals, ranked[0].verified, query, lambda key: query.submaps.features(key).origin, config
            )
        end = stages.end(stopped)
        return Recognition(verdict, reason, candidates, rivals, lead, stages.done(), tuple(found), end)


def _unsearched(verdict: Verdict, reason: str, stages: Stages) -> Recognition:
    return Recognition(verdict, reason, (), (), None, stages.done(), (), stages.end("not_started"))
