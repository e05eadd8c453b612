"""How the best proposal compares with everything else that could explain the observation.

Its rivals are looked for unless it is hopeless anyway: in its own submap by shifting it along the pattern, and among
the proposals in other submaps, unless those are the same place seen twice.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from urquhart.budget import OutOfTime
from urquhart.decide.candidates import Finding, make_finding
from urquhart.decide.confidence import (
    CONFIDENCE,
    chance_logit,
    comparable,
    extrapolated,
    log_odds,
    refusal,
    rival_threshold,
)
from urquhart.decide.rivals import hill_climb, same_place
from urquhart.propose.query import Proposal, Query
from urquhart.verify.evidence import PoseEvidence


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """How proposals for one query compare with each other.

    Attributes:
        proposals: one for each submap, the best first.
        lead: evidence by which the first leads its rivals, None where nothing rivals it.
        rivals: of the first proposal: submap, pose, and the evidence that is credited to it.
        alike: submaps that turned out to be the same place as the first one's.
        complete: whether all rivals that matter were looked at; the deadline may have come first.
        findings: what each level found in each submap, in the order of the levels, the best first.
    """

    proposals: list[Proposal]
    lead: float | None = None
    rivals: tuple[tuple[int, PoseEvidence, float], ...] = ()
    alike: frozenset[int] = frozenset()
    complete: bool = True
    findings: tuple[Finding, ...] = ()

    def lead_of(self, proposal: Proposal) -> float | None:
        """Evidence by which a proposal leads its rivals; one at another place than the first has the first as a rival.

        Where nothing rivals the first, the forest does not repeat itself, and only chance is to be ruled out.
        """
        first = self.proposals[0]
        if proposal is first or proposal.key in self.alike or self.lead is None:
            return self.lead
        return proposal.verified.evidence - first.verified.evidence

    def is_certain(self, query: Query) -> bool:
        """Whether the first proposal is so sure that another level could not change the answer."""
        if not self.proposals or not self.complete:
            return False
        first, config = self.proposals[0].verified, query.config
        odds = log_odds(first, query.grid, query.volume)
        return odds > 2.0 * config.gate and refusal(first, odds, self.lead, config) is None

    def is_lost(self, query: Query) -> bool:
        """Whether no proposal is better than chance. Too close a rival is another matter: more poses do not mend it."""
        if not self.proposals:
            return True
        return chance_logit(log_odds(self.proposals[0].verified, query.grid, query.volume)) < query.config.gate


NOTHING: Final = Ranking([])
"""Before anything is proposed."""


def rank(query: Query, proposals: list[Proposal], earlier: Ranking = NOTHING) -> Ranking:
    """Rank what a level proposed together with what `earlier` levels did, and look for rivals of the first."""
    with query.trace.timed("find rivals") as counts:
        counts["rivals"] = 0
        findings = (*earlier.findings, *(make_finding(one, query) for one in best_by_submap(proposals)))
        ranked = best_by_submap([*earlier.proposals, *proposals])
        if not ranked or log_odds(ranked[0].verified, query.grid, query.volume) < CONFIDENCE.unknown:
            return Ranking(ranked, findings=findings)
        try:
            ranking = _against_rivals(query, ranked)
        except OutOfTime:
            return Ranking(ranked, complete=False, findings=findings)
        counts["rivals"] = len(ranking.rivals)
        return replace(ranking, findings=findings)


def best_by_submap(proposals: Iterable[Proposal]) -> list[Proposal]:
    """The best proposal of each submap that has two inliers at least (fewer fix no pose), best first, ties by key."""
    best: dict[int, Proposal] = {}
    for proposal in proposals:
        known = best.get(proposal.key)
        if len(proposal.verified.residuals) >= 2 and (
            known is None or proposal.verified.evidence > known.verified.evidence
        ):
            best[proposal.key] = proposal
    return sorted(best.values(), key=lambda p: (-p.verified.evidence, p.key))


def _against_rivals(query: Query, ranked: list[Proposal]) -> Ranking:
    """The ranking of `ranked`, whose first is exchanged for its best rival in its own submap, if that is better.

    Raises:
        OutOfTime: the deadline passed before all rivals were looked at.
    """
    config, budget = query.config, query.budget
    here, key = query.submaps.grid(ranked[0].key), ranked[0].key
    sure = 2.0 * config.gate
    best, rivals_here = hill_climb(query.grid, here, ranked[0].verified, sure, config, budget)
    ranked[0] = replace(ranked[0], verified=best)
    rivals = [(key, rival, evidence) for rival, evidence in rivals_here]
    strongest = max((evidence for _, evidence in rivals_here), default=-math.inf)
    alike = set[int]()
    # Only what could change the verdict is looked at: overlapping submaps of one place are many.
    for other, evidence in _comparable(ranked[1:], best):
        if evidence <= max(strongest, rival_threshold(best, sure, config.margin)):
            break
        budget.check()
        there = query.submaps.grid(other.key)
        if same_place(here, best.transform, there, other.verified.transform, config, budget):
            alike.add(other.key)
        else:
            strongest = evidence
            rivals.append((other.key, other.verified, evidence))
    return Ranking(ranked, best.evidence - strongest if rivals else None, tuple(rivals), frozenset(alike))


def _comparable(others: list[Proposal], best: PoseEvidence) -> list[tuple[Proposal, float]]:
    """Those of `others` that could rival `best`, with the evidence they are credited with, the strongest first."""
    near = [other for other in others if comparable(other.verified, best)]
    evidence = np.array([other.verified.evidence for other in near])
    overlap = np.array([other.verified.overlap for other in near], np.float64)
    given = extrapolated(evidence, overlap, best.overlap).tolist()
    return sorted(zip(near, given, strict=True), key=lambda pair: -pair[1])
