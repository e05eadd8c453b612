"""The method's result as the service answers it: ids, links, poses in the map, and a limited number of landmark
pairs.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Final

import orjson

import urquhart
from server.index.live_indexes import View
from server.platform.precedence import give_way
from server.queries.explanations import hint_answers
from server.queries.poses import query_in_map, survey_poses, transform_answer
from server.queries.query import PlaceQuery, QueryLandmarks
from server.resources import links
from server.schemas.candidates import GatesAnswer
from server.schemas.common import Members, write_stamp
from server.schemas.queries import FINDINGS, QueryAnswer
from server.store.codec import unpack_ids
from server.store.submap_records import FoundSubmap
from urquhart import Candidate, Config, Finding, Recognition, Rival, Stage
from urquhart.hints import Hint
from urquhart.options import Options
from urquhart.report.explanation import search_sentence
from urquhart.trace import SearchEnd

_PORTION: Final = 5_000
"""Pairs between two pauses for shorter requests, about a millisecond."""
_LARGE: Final = 2_000
"""Pairs of a candidate from which it is written as JSON by itself: a millisecond, in which all other requests wait."""


class PairAllowance:
    """Number of landmark pairs that an answer may still contain. Candidates take their pairs from it, best first."""

    def __init__(self, most: int) -> None:
        self._left = most

    def take(self, count: int) -> bool:
        """Whether a candidate's pairs fit. After the first that do not fit, none are listed."""
        fits = count <= self._left
        self._left = self._left - count if fits else 0
        return fits or count == 0


def answer_json(answer: Members) -> bytes:
    """JSON of an answer that was built here; NaN and infinity are null."""
    candidates = answer["candidates"]
    if any(one["inlier_count"] > _LARGE for one in candidates):
        candidates = [orjson.Fragment(_pausing_json(one)) for one in candidates]
    return orjson.dumps({**answer, "candidates": candidates}, option=orjson.OPT_SERIALIZE_NUMPY)


def _pausing_json(members: Members) -> bytes:
    give_way()
    return orjson.dumps(members, option=orjson.OPT_SERIALIZE_NUMPY)


def within(answer: QueryAnswer, most: int) -> QueryAnswer:
    """The answer with at most so many pairs. A candidate whose pairs are left out says how many it has."""
    if carried(answer) <= most:
        return answer
    allowance = PairAllowance(most)
    candidates = [
        one
        if allowance.take(one.inlier_count - one.inliers_omitted)
        else one.model_copy(update={"inliers": [], "inlier_columns": None, "inliers_omitted": one.inlier_count})
        for one in answer.candidates
    ]
    return answer.model_copy(update={"candidates": candidates})


def carried(answer: QueryAnswer) -> int:
    """Number of pairs in an answer."""
    return sum(one.inlier_count - one.inliers_omitted for one in answer.candidates)


def listed(answer: Members) -> int:
    """Number of pairs in an answer that was built here."""
    return sum(one["inlier_count"] - one["inliers_omitted"] for one in answer["candidates"])


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


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """What a search found, what would make it match, and the rows of the submaps that the answer names, by key."""

    found: Recognition
    hint: Hint | None
    rows: dict[int, FoundSubmap]


def drawn_keys(found: Recognition) -> set[int]:
    """Keys of the submaps that a drawing of the answer shows."""
    return {one.key for one in found.candidates} | {rival.key for rival in found.rivals[:1]}


def named_keys(found: Recognition) -> set[int]:
    """Keys of the submaps that the answer names, but for findings."""
    return {one.key for one in found.candidates} | {rival.key for rival in found.rivals}


def query_answer(view: View, query: PlaceQuery, asked: QueryLandmarks, outcome: SearchOutcome, pairs: int) -> Members:
    """The members of a `QueryAnswer`."""
    collection_id, found = view.collection.id, outcome.found
    # Stored answers are complete, so that they can always be explained.
    findings = strongest(found.findings) if query.explain or query.store else None
    ids = {key: row.id for key, row in outcome.rows.items()}
    others = {one.key for one in (*(findings or ()), *filter(None, [outcome.hint]))} - ids.keys()
    if others:
        ids |= view.tx.submaps(view.collection.key).ids(others)
    names, most = None if query.columns else asked.names(), pairs if query.pairs or query.store else 0
    candidates = candidate_answers(collection_id, found.candidates, outcome.rows, names, most)
    surveys = survey_poses(view.tx, view.collection, found.candidates, outcome.rows, asked.xy)
    for candidate, survey in zip(candidates, surveys, strict=True):
        candidate["survey"] = survey
    return {
        "id": None,
        "collection": collection_id,
        "verdict": found.verdict,
        "reason": found.reason,
        "frame_id": query.frame_id,
        "stamp": None if query.stamp is None else write_stamp(query.stamp),
        "method": query.method,
        "effort": query.effort,
        "revision": view.revision,
        "landmark_count": len(asked.xy),
        "lead": found.lead,
        "warnings": ["mirrored"] if outcome.hint is not None and outcome.hint.word == "mirrored" else [],
        "hints": hint_answers(outcome.hint, ids),
        "gates": gates_answer(view.recognizer.config, query.min_confidence).model_dump(),
        "candidates": candidates,
        "rivals": rival_answers(collection_id, found.rivals, ids),
        "search": search_answer(found.search),
        "stages": stage_answers(found.stages),
        "findings": None if findings is None else finding_answers(findings, ids),
        "findings_total": None if findings is None else len(found.findings),
        "sentences": None,
        "links": {"self": None, "collection": links.collection(collection_id), "explanation": None},
    }


def stage_answers(stages: Sequence[Stage]) -> list[Members]:
    """The stages, in order: members of a `StageAnswer` each."""
    return [{"name": s.name, "milliseconds": s.milliseconds, "counts": s.counts} for s in stages]


def search_answer(end: SearchEnd) -> Members:
    """How a search ended, in stable words and as a sentence: members of a `SearchAnswer`."""
    return {
        "stopped_by": end.stopped_by,
        "skipped": list(end.skipped),
        "promised": None if end.promised is None else end.promised._asdict(),
        "sentence": search_sentence(end),
    }


def candidate_answers(
    collection_id: str,
    candidates: Sequence[Candidate],
    rows: Mapping[int, FoundSubmap],
    query_names: Sequence[str] | None,
    pairs: int,
) -> list[Members]:
    """The candidates, best first, with at most `pairs` pairs of landmarks: members of a `CandidateAnswer` each.

    `rows`: their submaps by key; `query_names`: landmark ids of the query, None for pairs as columns of positions.
    """
    allowance, submaps = PairAllowance(pairs), links.submaps(collection_id)
    return [
        _candidate_answer(rank, candidate, rows[candidate.key], query_names, allowance)
        | {"links": {"submap": f"{submaps}/{links.segment(rows[candidate.key].id)}", "match": None}}
        for rank, candidate in enumerate(candidates, start=1)
    ]


def rival_answers(collection_id: str, rivals: Sequence[Rival], ids: Mapping[int, str]) -> list[Members]:
    """The rivals, strongest first: members of a `RivalAnswer` each. `ids`: submap ids by key."""
    return [
        {
            "submap_id": ids[rival.key],
            "transform": {"x": rival.transform.x, "y": rival.transform.y, "yaw": rival.transform.yaw},
            "evidence": rival.evidence,
            "inlier_count": rival.inliers,
            "links": {"submap": links.submap(collection_id, ids[rival.key])},
        }
        for rival in rivals
    ]


def strongest(findings: Sequence[Finding]) -> list[Finding]:
    """The `FINDINGS` findings with the best log-odds, in their former order."""
    best = sorted(range(len(findings)), key=lambda i: -findings[i].log_odds)[:FINDINGS]
    return [findings[i] for i in sorted(best)]


def finding_answers(findings: Sequence[Finding], ids: Mapping[int, str]) -> list[Members]:
    """The findings, in their order: members of a `FindingAnswer` each. `ids`: submap ids by key."""
    return [
        {
            "level": found.level,
            "submap_id": ids[found.key],
            "support": found.support,
            "inlier_count": found.inliers,
            "overlap_count": found.overlap_count,
            "evidence": found.evidence,
            "log_odds": found.log_odds,
            "refused": found.refused,
        }
        for found in findings
    ]


def _inliers(candidate: Candidate, found: FoundSubmap, query_names: Sequence[str]) -> list[Members]:
    """The pairs of landmarks: most of an answer."""
    submap_names = unpack_ids(found.landmark_ids, found.landmark_count)
    queries, submaps = candidate.query_indices.tolist(), candidate.submap_indices.tolist()
    residuals = candidate.residuals.tolist()
    inliers: list[Members] = []
    for begin in range(0, len(queries), _PORTION):
        give_way()
        some = slice(begin, begin + _PORTION)
        inliers += [
            {"query": query_names[q], "submap": submap_names[s], "residual": residual}
            for q, s, residual in zip(queries[some], submaps[some], residuals[some], strict=True)
        ]
    return inliers


def _columns(candidate: Candidate) -> Members:
    return {
        "query": candidate.query_indices.tolist(),
        "submap": candidate.submap_indices.tolist(),
        "residual": candidate.residuals.round(4).tolist(),
    }


def _candidate_answer(
    rank: int,
    candidate: Candidate,
    found: FoundSubmap,
    query_names: Sequence[str] | None,
    allowance: PairAllowance,
) -> Members:
    count = len(candidate.query_indices)
    given = allowance.take(count)
    place, stamp = found.place, found.stamp
    return {
        "rank": rank,
        "submap_id": found.id,
        "session": found.session,
        "stamp": None if stamp is None else write_stamp(stamp),
        "frame_id": found.frame_id,
        "transform": transform_answer(candidate.transform, candidate.uncertainty),
        "map_pose": None if place is None else query_in_map(place, candidate.transform, candidate.uncertainty),
        "survey": None,
        "inliers": _inliers(candidate, found, query_names) if given and query_names is not None else [],
        "inlier_columns": _columns(candidate) if given and query_names is None else None,
        "inlier_count": count,
        "inliers_omitted": 0 if given else count,
        "inlier_ratio": candidate.inlier_ratio,
        "rms": candidate.rms,
        "overlap_ratio": candidate.overlap_ratio,
        "support": candidate.support,
        "level": candidate.level,
        "evidence": candidate.evidence,
        "log_odds": candidate.log_odds,
        "confidence": candidate.confidence,
        "refused": candidate.refused,
        "warnings": list(candidate.warnings),
    }
