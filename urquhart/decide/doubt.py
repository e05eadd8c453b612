"""Doubt: how the best proposal stands to everything else that could explain the observation.

Its rivals are looked for, where it is not hopeless anyway: in its own submap by shifting it along the pattern, and
among what was proposed in other submaps, unless those are the same place seen twice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from urquhart.budget import OutOfTime
from urquhart.decide.confidence import comparable, credited, log_odds, surely_behind
from urquhart.decide.ranking import Finding, best_by_submap, make_finding
from urquhart.decide.rivals import climb, same_place
from urquhart.propose.proposals import Proposal, Sighting
from urquhart.trace import Stages
from urquhart.verify.evidence import Verified

_HOPELESS: Final = -8.0
"""Log-odds below which no pose is worth a search for its rivals: hardly one in ten is right."""


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """How proposals stand to each other.

    Attributes:
        ranked: proposals best first, one a submap.
        lead: evidence by which the first leads its rivals, None where nothing rivals it.
        rivals: those, each with its submap and the evidence it is credited with.
        alike: submaps that were found to be the same place as the first's.
        complete: whether rivals were looked for as far as they matter; the deadline may have been in the way.
    """

    ranked: list[Proposal]
    lead: float | None
    rivals: list[tuple[int, Verified, float]]
    alike: frozenset[int] = frozenset()
    complete: bool = True

    def lead_of(self, proposal: Proposal) -> float | None:
        """Evidence by which a proposal leads its rivals: one that is not the first's place has the first for a rival.

        Where nothing rivals the first, the forest does not repeat itself, and chance alone is to be doubted.
        """
        first = self.ranked[0]
        if proposal is first or proposal.key in self.alike or self.lead is None:
            return self.lead
        return proposal.verified.evidence - first.verified.evidence


def doubt(
    query: Sighting,
    proposals: list[Proposal],
    stages: Stages,
    found: list[Finding],
    earlier: Sequence[Proposal] = (),
) -> Standing:
    """Rank what a level proposed together with what `earlier` ones did, and look for what rivals the first.

    What the level found is added to `found`.
    """
    config = query.index.config
    with stages.timed("doubt") as counts:
        counts["rivals"] = 0
        found.extend(make_finding(proposal, query, config) for proposal in best_by_submap(proposals))
        ranked = best_by_submap([*earlier, *proposals])
        if not ranked or log_odds(ranked[0].verified, query.pattern, query.volume) < _HOPELESS:
            return Standing(ranked, None, [])
        try:
            return _against_rivals(query, ranked, counts)
        except OutOfTime:
            return Standing(ranked, None, [], complete=False)


def _against_rivals(query: Sighting, ranked: list[Proposal], counts: dict[str, int]) -> Standing:
    """The standing of `ranked`, whose first is changed for its best rival in its own submap, if that is better.

    Raises:
        OutOfTime: the deadline passed before all rivals were looked at.
    """
    config, reach, budget = query.index.config, query.index.reach, query.budget
    here, key = query.submaps.pattern(ranked[0].key), ranked[0].key
    margin, sure = config.margin, 2.0 * config.gate
    best, rivals_here = climb(query.pattern, here, ranked[0].verified, reach, sure, margin, budget)
    ranked[0] = replace(ranked[0], verified=best)
    rivals = [(key, rival, evidence) for rival, evidence in rivals_here]
    strongest = max((evidence for _, evidence in rivals_here), default=-math.inf)
    alike = set[int]()
    # Only what could change the verdict is looked at: overlapping submaps of one place are many.
    for other, evidence in _comparable(ranked[1:], best):
        if evidence <= max(strongest, surely_behind(best, sure, margin)):
            break
        budget.check()
        there = query.submaps.pattern(other.key)
        if same_place(here, best.transform, there, other.verified.transform, reach, margin, budget):
            alike.add(other.key)
        else:
            strongest = evidence
            rivals.append((other.key, other.verified, evidence))
    counts["rivals"] = len(rivals)
    return Standing(ranked, best.evidence - strongest if rivals else None, rivals, frozenset(alike))


def _comparable(others: list[Proposal], best: Verified) -> list[tuple[Proposal, float]]:
    """Those of `others` that could rival `best`, with the evidence they are credited with, the strongest first."""
    near = [other for other in others if comparable(other.verified, best)]
    evidence = np.array([other.verified.evidence for other in near])
    overlap = np.array([other.verified.overlap for other in near], np.float64)
    given = credited(evidence, overlap, best.overlap).tolist()
    return sorted(zip(near, given, strict=True), key=lambda pair: -pair[1])
