"""Queries: landmarks in, a verdict with its evidence out; and the stored ones again."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

import urquhart
from server import links
from server.catalog import Catalog, View
from server.errors import InvalidField, NotFound, TooLarge
from server.metrics import Metrics
from server.poses import query_in_map, with_covariance
from server.prepare import check_landmark_count, invalid_landmarks
from server.schemas.queries import (
    CandidateAnswer,
    CandidateLinks,
    Inlier,
    QueryAnswer,
    QueryInput,
    QueryLinks,
    StageAnswer,
)
from server.settings import Limits
from server.store.codec import unpack_ids, unpack_positions
from server.store.database import Database
from server.store.submaps import Submaps, stored_place
from server.store.tables import CollectionRow, SubmapRow
from server.stored_queries import keep
from server.threads import pin_threads
from urquhart import Candidate, LandmarkError, Recognition


@dataclass(frozen=True, slots=True)
class Observation:
    """What is asked with: landmarks (N, 2) float64, metres, query frame; `ids` None where they are the positions."""

    xy: NDArray[np.float64]
    ids: list[str] | None
    frame_id: str | None
    stamp: datetime | None

    def names(self) -> list[str]:
        return self.ids if self.ids is not None else [str(i) for i in range(len(self.xy))]


@dataclass(frozen=True, slots=True)
class Look:
    """A query that was looked up: the answer, and what a drawing of it needs.

    `submaps` are the landmarks of each candidate, (N, 2) float64, metres, submap frame, where they were read.
    """

    asked: Observation
    collection: CollectionRow
    answer: QueryAnswer
    candidates: tuple[Candidate, ...]
    submaps: tuple[NDArray[np.float64], ...]

    def draw(self, rank: int, title: str) -> str:
        """SVG of the candidate at `rank`, from 1."""
        return urquhart.draw_match(self.asked.xy, self.submaps[rank - 1], self.candidates[rank - 1], title=title)


def answer_query(
    database: Database, catalog: Catalog, metrics: Metrics, limits: Limits, collection_id: str, body: QueryInput
) -> QueryAnswer:
    """Look a query up and keep the answer where that was asked for. Raises as `look_up`, and StorageError."""
    look = look_up(catalog, metrics, limits, collection_id, body)
    if not body.store:
        return look.answer
    return keep(database, limits, look.collection, look.asked.xy, look.asked.ids, look.candidates, look.answer)


def look_up(
    catalog: Catalog,
    metrics: Metrics,
    limits: Limits,
    collection_id: str,
    body: QueryInput,
    *,
    to_draw: bool = False,
) -> Look:
    """Place an observation in a collection; with `to_draw`, read the candidates' landmarks too.

    Too few or collinear landmarks are an answer, not an error. Raises NotFound (the collection, or `submap_id`),
    InvalidLandmarks, InvalidField, TooLarge and StorageError.
    """
    check_landmark_count(body, limits)
    _check_sizes(body, limits)
    pin_threads()
    with catalog.view(collection_id) as view:
        submaps = Submaps(view.session, view.collection.key)
        excluded = set(submaps.keys(body.exclude.submap_ids).values()) if body.exclude.submap_ids else set()
        if body.submap_id is None:
            asked = Observation(body.positions(), body.landmark_ids(), body.frame_id, body.stamp)
        else:
            row = submaps.get_whole(body.submap_id)
            if row is None:
                raise NotFound("submap", body.submap_id)
            excluded.add(row.key)
            asked = _stored_observation(row, body)
        rng = None if body.seed is None else np.random.default_rng(body.seed)
        try:
            found = view.recognizer.recognize(asked.xy, limit=body.limit, method=body.method, exclude=excluded, rng=rng)
        except LandmarkError as error:
            raise invalid_landmarks(error, body) from error
        rows = submaps.by_keys([candidate.key for candidate in found.candidates], landmarks=to_draw)
        answer = _answer(view, body, asked, found, rows)
        drawn = found.candidates if to_draw else ()
        landmarks = tuple(unpack_positions(rows[candidate.key].landmarks) for candidate in drawn)
    metrics.verdicts.labels(answer.verdict).inc()
    for stage in answer.stages:
        metrics.observe_stage(stage.name, stage.milliseconds)
    return Look(asked, view.collection, answer, found.candidates, landmarks)


def _check_sizes(body: QueryInput, limits: Limits) -> None:
    if body.limit > limits.candidates:
        raise InvalidField(f"must be at most {limits.candidates}", code="less_than_equal", pointer="/limit")
    excluded = len(body.exclude.submap_ids)
    if excluded > limits.excluded_submaps:
        raise TooLarge("excluded_submaps", limits.excluded_submaps, excluded, "Exclude fewer submaps.")


def _stored_observation(row: SubmapRow, body: QueryInput) -> Observation:
    xy = unpack_positions(row.landmarks)
    ids = None if row.landmark_ids is None else unpack_ids(row.landmark_ids, len(xy))
    return Observation(xy, ids, body.frame_id or row.frame_id, body.stamp or row.stamp)


def _answer(
    view: View, body: QueryInput, asked: Observation, found: Recognition, rows: dict[int, SubmapRow]
) -> QueryAnswer:
    names = asked.names()
    return QueryAnswer(
        id=None,
        collection=view.collection.id,
        verdict=found.verdict,
        reason=found.reason,
        frame_id=asked.frame_id,
        stamp=asked.stamp,
        method=body.method,
        revision=view.revision,
        landmarks=len(asked.xy),
        margin=found.margin,
        candidates=[
            _candidate_answer(rank, view.collection.id, candidate, rows[candidate.key], names)
            for rank, candidate in enumerate(found.candidates, start=1)
        ],
        stages=[StageAnswer(name=s.name, milliseconds=s.milliseconds, counts=s.counts) for s in found.stages],
        links=QueryLinks(self=None, collection=links.collection(view.collection.id)),
    )


def _candidate_answer(
    rank: int, collection_id: str, candidate: Candidate, row: SubmapRow, query_names: list[str]
) -> CandidateAnswer:
    submap_names = unpack_ids(row.landmark_ids, row.landmark_count)
    place = stored_place(row)
    return CandidateAnswer(
        rank=rank,
        submap_id=row.id,
        session=row.session,
        stamp=row.stamp,
        frame_id=row.frame_id,
        transform=with_covariance(candidate.transform, candidate.covariance),
        map_pose=None if place is None else query_in_map(place, candidate.transform, candidate.covariance),
        inliers=[
            Inlier(query=query_names[q], submap=submap_names[s], residual=float(residual))
            for q, s, residual in zip(
                candidate.query_indices, candidate.submap_indices, candidate.residuals, strict=True
            )
        ],
        inlier_count=len(candidate.query_indices),
        inlier_ratio=candidate.inlier_ratio,
        rms=candidate.rms,
        overlap=candidate.overlap,
        votes=candidate.votes,
        level=candidate.level,
        evidence=candidate.evidence,
        log_odds=candidate.log_odds,
        confidence=candidate.confidence,
        refused=candidate.refused,
        links=CandidateLinks(submap=links.submap(collection_id, row.id), match=None),
    )
