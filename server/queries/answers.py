"""The method's result as the service answers it: ids, links, poses in the map, and a limited number of landmark
pairs.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Final

from pydantic import TypeAdapter

import urquhart
from server.platform.precedence import give_way
from server.queries.poses import query_in_map, transform_answer
from server.resources import links
from server.schemas.candidates import (
    CandidateAnswer,
    CandidateLinks,
    FindingAnswer,
    GatesAnswer,
    Inlier,
    PromiseAnswer,
    RivalAnswer,
    RivalLinks,
    SearchAnswer,
    StageAnswer,
)
from server.schemas.poses import Transform
from server.schemas.queries import FINDINGS, QueryAnswer
from server.store.codec import unpack_ids
from server.store.submap_records import FoundSubmap
from urquhart import Candidate, Config, Finding, Rival, Stage
from urquhart.options import Options
from urquhart.report.explanation import search_sentence
from urquhart.trace import SearchEnd

_INLIERS: Final = TypeAdapter(list[Inlier])
_PORTION: Final = 500
"""Pairs that pydantic makes at once, half a millisecond. It holds the interpreter, so all other requests wait."""


class PairAllowance:
    """Number of landmark pairs that an answer may still contain. Candidates take their pairs from it, best first."""

    def __init__(self, most: int) -> None:
        self._left = most

    def take(self, count: int) -> bool:
        """Whether a candidate's pairs fit. After the first that do not fit, none are listed."""
        fits = count <= self._left
        self._left = self._left - count if fits else 0
        return fits or count == 0


def within(answer: QueryAnswer, most: int) -> QueryAnswer:
    """The answer with at most so many pairs. A candidate whose pairs are left out says how many it has."""
    if carried(answer) <= most:
        return answer
    allowance = PairAllowance(most)
    candidates = [
        one
        if allowance.take(len(one.inliers))
        else one.model_copy(update={"inliers": [], "inliers_omitted": one.inlier_count})
        for one in answer.candidates
    ]
    return answer.model_copy(update={"candidates": candidates})


def carried(answer: QueryAnswer) -> int:
    """Number of pairs in an answer."""
    return sum(len(one.inliers) for one in answer.candidates)


class Shares:
    """Landmark pairs for several answers: each gets an equal share of the rest, so that none uses up all of it."""

    def __init__(self, most: int, answers: int) -> None:
        self._left, self._answers = most, answers

    def next(self) -> int:
        """The share of the next answer."""
        return self._left // max(self._answers, 1)

    def used(self, pairs: int) -> None:
        """Record the number of pairs in that answer."""
        self._left -= pairs
        self._answers -= 1


@lru_cache(maxsize=64)
def gates_answer(config: Config, min_confidence: float | None = None) -> GatesAnswer:
    """The gates of a query of a collection with this configuration.

    A given confidence is answered as it was given. That of a gate is not rounded: the confidence of a candidate that
    just passes would look smaller than it.
    """
    gate = Options(min_confidence=min_confidence).gate(config)
    if min_confidence is None:
        min_confidence = 1.0 / (1.0 + math.exp(-gate))
    return GatesAnswer(**asdict(urquhart.Gates.of(config, gate)) | {"confidence": min_confidence})


def stage_answers(stages: Sequence[Stage]) -> list[StageAnswer]:
    """The stages, in order."""
    return [StageAnswer(name=s.name, milliseconds=s.milliseconds, counts=s.counts) for s in stages]


def search_answer(end: SearchEnd) -> SearchAnswer:
    """How a search ended, in stable words and as a sentence."""
    promised = None if end.promised is None else PromiseAnswer(**end.promised._asdict())
    return SearchAnswer(
        stopped_by=end.stopped_by, skipped=list(end.skipped), promised=promised, sentence=search_sentence(end)
    )


def candidate_answers(
    collection_id: str,
    candidates: Sequence[Candidate],
    rows: Mapping[int, FoundSubmap],
    query_names: Sequence[str],
    pairs: int,
) -> list[CandidateAnswer]:
    """The candidates, best first, with at most `pairs` pairs of landmarks in total.

    `rows`: their submaps by key; `query_names`: landmark ids of the query.
    """
    allowance = PairAllowance(pairs)
    return [
        _candidate_answer(rank, collection_id, candidate, rows[candidate.key], query_names, allowance)
        for rank, candidate in enumerate(candidates, start=1)
    ]


def rival_answers(collection_id: str, rivals: Sequence[Rival], ids: Mapping[int, str]) -> list[RivalAnswer]:
    """The rivals, strongest first. `ids`: submap ids by key."""
    return [
        RivalAnswer(
            submap_id=ids[rival.key],
            transform=Transform(x=rival.transform.x, y=rival.transform.y, yaw=rival.transform.yaw),
            evidence=rival.evidence,
            inlier_count=rival.inliers,
            links=RivalLinks(submap=links.submap(collection_id, ids[rival.key])),
        )
        for rival in rivals
    ]


def strongest(findings: Sequence[Finding]) -> list[Finding]:
    """The `FINDINGS` findings with the best log-odds, in their former order."""
    best = sorted(range(len(findings)), key=lambda i: -findings[i].log_odds)[:FINDINGS]
    return [findings[i] for i in sorted(best)]


def finding_answers(findings: Sequence[Finding], ids: Mapping[int, str]) -> list[FindingAnswer]:
    """The findings, in their order. `ids`: submap ids by key."""
    return [
        FindingAnswer(
            level=found.level,
            submap_id=ids[found.key],
            support=found.support,
            inlier_count=found.inliers,
            overlap_count=found.overlap_count,
            evidence=found.evidence,
            log_odds=found.log_odds,
            refused=found.refused,
        )
        for found in findings
    ]


def _inliers(candidate: Candidate, found: FoundSubmap, query_names: Sequence[str]) -> list[Inlier]:
    """The pairs of landmarks: most of an answer, and made several times faster by pydantic than one by one."""
    submap_names = unpack_ids(found.landmark_ids, found.landmark_count)
    members = [
        {"query": query_names[q], "submap": submap_names[s], "residual": residual}
        for q, s, residual in zip(
            candidate.query_indices.tolist(),
            candidate.submap_indices.tolist(),
            candidate.residuals.tolist(),
            strict=True,
        )
    ]
    inliers: list[Inlier] = []
    for begin in range(0, len(members), _PORTION):
        give_way()
        inliers += _INLIERS.validate_python(members[begin : begin + _PORTION])
    return inliers


def _candidate_answer(
    rank: int,
    collection_id: str,
    candidate: Candidate,
    found: FoundSubmap,
    query_names: Sequence[str],
    allowance: PairAllowance,
) -> CandidateAnswer:
    count = len(candidate.query_indices)
    given = allowance.take(count)
    place = found.place
    return CandidateAnswer(
        rank=rank,
        submap_id=found.id,
        session=found.session,
        stamp=found.stamp,
        frame_id=found.frame_id,
        transform=transform_answer(candidate.transform, candidate.uncertainty),
        map_pose=None if place is None else query_in_map(place, candidate.transform, candidate.uncertainty),
        inliers=_inliers(candidate, found, query_names) if given else [],
        inlier_count=count,
        inliers_omitted=0 if given else count,
        inlier_ratio=candidate.inlier_ratio,
        rms=candidate.rms,
        overlap_ratio=candidate.overlap_ratio,
        support=candidate.support,
        level=candidate.level,
        evidence=candidate.evidence,
        log_odds=candidate.log_odds,
        confidence=candidate.confidence,
        refused=candidate.refused,
        warnings=list(candidate.warnings),
        links=CandidateLinks(submap=links.submap(collection_id, found.id), match=None),
    )
