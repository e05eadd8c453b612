"""The ranking of all proposals, and the rivals of the best one.

Rivals are searched unless the best proposal is hopeless: in its own submap by shifting it along the pattern of the
trees, and among the proposals in other submaps, unless those are the same place seen twice.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from urquhart.budget import DeadlinePassed
from urquhart.decide.candidates import Finding, make_finding
from urquhart.decide.confidence import (
    CONFIDENCE,
    chance_logit,
    comparable,
    extrapolated,
    log_odds,
    odds_of_coincidence,
    odds_of_coincidence_nearby,
    refusal,
    rival_threshold,
    unexplained,
)
from urquhart.decide.rivals import hill_climb, same_place
from urquhart.propose.query import Proposal, Query
from urquhart.verify.evidence import PoseEvidence


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """The proposals for one query, ranked.

    Attributes:
        proposals: one for each submap, the best first.
        lead: evidence of the first proposal minus that of its strongest rival; None if it has no rival.
        rivals: of the first proposal: submap, pose between centred frames, and the evidence of each that counts.
        alike: submaps that are the same place as that of the first proposal.
        complete: whether all rivals that matter were compared before the deadline.
        findings: the best pose of each level in each submap, in the order of the levels, the best first.
    """

    proposals: list[Proposal]
    lead: float | None = None
    rivals: tuple[tuple[int, PoseEvidence, float], ...] = ()
    alike: frozenset[int] = frozenset()
    complete: bool = True
    findings: tuple[Finding, ...] = ()

    def lead_of(self, proposal: Proposal) -> float | None:
        """The lead of a proposal over its strongest rival; for one at another place, the first proposal is the rival.

        If the first proposal has no rival, the forest does not repeat itself, and only chance must be ruled out.
        """
        first = self.proposals[0]
        if proposal is first or proposal.key in self.alike or self.lead is None:
            return self.lead
        return proposal.verified.evidence - first.verified.evidence

    def is_certain(self, query: Query, saw_few: bool = False) -> bool:
        """Whether the first proposal is so certain that no further level could change the answer.

        `saw_few`: the levels so far may have missed rivals in other submaps. Then it must have no rival at all: if a
        forest repeats itself, some pose in the same submap is one.
        """
        if not self.proposals or not self.complete or (saw_few and self.lead is not None):
            return False
        first, margin, gate = self.proposals[0].verified, query.config.lead_per_landmark, query.searched_gate
        odds = log_odds(first, query.grid, query.volume)
        return odds > 2.0 * gate and refusal(first, odds, self.lead, margin, gate) is None

    def is_lost(self, query: Query) -> bool:
        """Whether no proposal beats chance. Close rivals do not count here: more proposals would not remove them."""
        if not self.proposals:
            return True
        return chance_logit(log_odds(self.proposals[0].verified, query.grid, query.volume)) < query.searched_gate


NOTHING: Final = Ranking([])
"""The ranking before anything is proposed."""


def rank(query: Query, proposals: list[Proposal], earlier: Ranking = NOTHING) -> Ranking:
    """Rank the proposals of a level together with those of `earlier` levels, and search rivals of the best."""
    with query.trace.timed("find rivals") as counts:
        counts["rivals"] = 0
        findings = (*earlier.findings, *(make_finding(one, query) for one in best_by_submap(proposals)))
        ranked = best_by_submap([*earlier.proposals, *proposals])
        if not ranked or log_odds(ranked[0].verified, query.grid, query.volume) < CONFIDENCE.unknown:
            return Ranking(ranked, findings=findings)
        try:
            ranking = _against_rivals(query, ranked)
        except DeadlinePassed:
            return Ranking(ranked, complete=False, findings=findings)
        counts["rivals"] = len(ranking.rivals)
        return replace(ranking, findings=findings)


def best_by_submap(proposals: Iterable[Proposal]) -> list[Proposal]:
    """The best proposal of each submap, the best first, ties by key; without those of fewer than two inliers."""
    best: dict[int, Proposal] = {}
    for proposal in proposals:
        known = best.get(proposal.key)
        if len(proposal.verified.residuals) >= 2 and (
            known is None or proposal.verified.evidence > known.verified.evidence
        ):
            best[proposal.key] = proposal
    return sorted(best.values(), key=lambda p: (-p.verified.evidence, p.key))


def _against_rivals(query: Query, ranked: list[Proposal]) -> Ranking:
    """The ranking of proposals that are sorted already. If a rival in its own submap is better, it becomes the first.

    Raises:
        DeadlinePassed: the deadline passed before all rivals were compared.
    """
    config, budget = query.config, query.budget
    here, key = query.submaps.grid(ranked[0].key), ranked[0].key
    sure = 2.0 * query.searched_gate
    best, rivals_here = hill_climb(query.grid, here, ranked[0].verified, sure, config, budget)
    ranked[0] = replace(ranked[0], verified=best)
    behind = rival_threshold(best, sure, config.lead_per_landmark)
    area = max(here.area, query.grid.area)
    counted = (
        (one, unexplained(given, odds_of_coincidence_nearby(one, query.grid, area))) for one, given in rivals_here
    )
    rivals = [(key, rival, evidence) for rival, evidence in counted if evidence > behind]
    strongest = max((evidence for _, _, evidence in rivals), default=-math.inf)
    alike = set[int]()
    # Only rivals that could change the verdict are compared, because many submaps may overlap at one place.
    for other, evidence in _comparable(query, ranked[1:], best):
        if evidence <= max(strongest, behind):
            break
        budget.check()
        there = query.submaps.grid(other.key)
        if same_place(here, best.transform, there, other.verified.transform, config, budget):
            alike.add(other.key)
        else:
            strongest = evidence
            rivals.append((other.key, other.verified, evidence))
    return Ranking(ranked, best.evidence - strongest if rivals else None, tuple(rivals), frozenset(alike))


def _comparable(query: Query, others: list[Proposal], best: PoseEvidence) -> list[tuple[Proposal, float]]:
    """The proposals that are comparable with `best`, with the evidence that counts, the strongest first."""
    near = [other for other in others if comparable(other.verified, best)]
    evidence = np.array([other.verified.evidence for other in near])
    overlap = np.array([other.verified.overlap for other in near], np.float64)
    counted = [
        (other, unexplained(given, odds_of_coincidence(other.verified, query.grid, query.volume)))
        for other, given in zip(near, extrapolated(evidence, overlap, best.overlap).tolist(), strict=True)
    ]
    return sorted(counted, key=lambda pair: -pair[1])
