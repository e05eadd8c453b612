"""The verdict of a search: `matched` only if chance and every rival pose are ruled out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from urquhart.decide.candidates import Candidate, Finding, Rival, make_candidate, make_rivals
from urquhart.decide.confidence import Refusal
from urquhart.decide.ranking import Ranking
from urquhart.features.observation import Obstacle
from urquhart.propose.query import Query
from urquhart.trace import SearchEnd, Stage, StoppedBy

Verdict = Literal["matched", "ambiguous", "no_match"]
Reason = Literal[
    "verified",
    "no_proposal",
    "empty_collection",
    "all_filtered_out",
    Obstacle,
    Refusal,
]
"""The reason of a verdict. The words are part of the API."""


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """The answer to one query.

    Attributes:
        verdict, reason: the result, in one word each.
        candidates: verified submaps, the best first.
        rivals: other poses that cannot be ruled out, the strongest first.
        lead: evidence of the best candidate minus that of the best distinct pose; None if no pose was compared.
        stages: counts and costs of each stage, in order.
        findings: the best pose of each level in each submap, in the order of the levels, the best first.
        search: why the search ended, and which limits left something out.
    """

    verdict: Verdict
    reason: Reason
    candidates: tuple[Candidate, ...]
    rivals: tuple[Rival, ...]
    lead: float | None
    stages: tuple[Stage, ...]
    findings: tuple[Finding, ...]
    search: SearchEnd


def decide(query: Query, ranking: Ranking, limit: int, stopped_by: StoppedBy) -> Recognition:
    """The answer to a query, from its ranked proposals.

    Args:
        limit: most candidates in the answer.
        stopped_by: why the search ended. After a deadline nothing is `matched`, because rivals may be missing.
    """
    candidates = tuple(
        make_candidate(proposal, query, ranking.lead_of(proposal)) for proposal in ranking.proposals[:limit]
    )
    verdict, reason = _judge(candidates)
    if not ranking.findings:
        reason = "no_proposal"
    if stopped_by == "deadline":
        verdict, reason = "no_match", "deadline"
        candidates = tuple(replace(one, refused=one.refused or "deadline") for one in candidates)
    rivals = make_rivals(ranking.rivals, ranking.proposals[0].verified, query) if ranking.proposals else ()
    stages, end = query.trace.done(), query.trace.end(stopped_by)
    return Recognition(verdict, reason, candidates, rivals, ranking.lead, stages, ranking.findings, end)


def unsearched(reason: Reason, stages: tuple[Stage, ...] = ()) -> Recognition:
    """The answer if there was nothing to search for, nothing to search in, or no time to begin."""
    stopped_by: StoppedBy = "deadline" if reason == "deadline" else "not_started"
    return Recognition("no_match", reason, (), (), None, stages, (), SearchEnd(stopped_by))


def _judge(candidates: Sequence[Candidate]) -> tuple[Verdict, Reason]:
    """Verdict and reason, from candidates with the best first."""
    if not candidates:
        return "no_match", "verification_failed"
    reason = candidates[0].refused
    if reason is None:
        return "matched", "verified"
    return ("ambiguous" if reason == "rival_too_close" else "no_match"), reason
