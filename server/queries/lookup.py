"""One query from its landmarks to its answer: filters, the search, contradicting maps, and what the answer shows."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Concatenate, Final, ParamSpec

import numpy as np
from numpy.typing import NDArray

import urquhart
from server.config.settings import Limits
from server.errors import NotFound
from server.index.live_indexes import LiveIndexes
from server.observability.metrics import Metrics
from server.observability.request_notes import note_query
from server.platform.precedence import turn
from server.platform.thread_limits import pin_threads
from server.queries.answers import (
    SearchOutcome,
    answer_json,
    carried,
    drawn_keys,
    listed,
    named_keys,
    query_answer,
    within,
)
from server.queries.explanations import QueryExplanation, sentences
from server.queries.query import PlaceQuery, QueryLandmarks
from server.queries.search import SubmapSearch, describe_query
from server.queries.stored_queries import NO_KEY, AnswerKey, NewAnswer, keep
from server.schemas.common import Members, to_json
from server.schemas.queries import QueryAnswer
from server.store.codec import unpack_diameters, unpack_ids, unpack_positions
from server.store.records import CollectionRecord
from server.store.repositories.submaps import SubmapReader
from server.store.storage import Storage
from server.store.submap_records import SubmapContent
from urquhart import (
    Budget,
    Candidate,
    Description,
    Features,
    Recognition,
    unsearched,
)

_TO_ANSWER: Final = 0.2
"""Seconds before the deadline at which a search ends, because ending it and writing the answer take time,"""
_ANSWER_SHARE: Final = 0.1
"""but at most this share of the time."""

P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class QueryContext:
    """What all queries of a process need: database, indexes, metrics, and limits."""

    database: Storage
    indexes: LiveIndexes
    metrics: Metrics
    limits: Limits


@dataclass(frozen=True, slots=True)
class PendingSubmap:
    """A submap that is looked up before it is stored. `id` is None if the service generates it."""

    id: str | None
    description: Description


@dataclass(frozen=True)
class LookupResult:
    """The result of a query, and what a drawing of it needs.

    `members` are those of the answer, `answer` is the same as a model, made when it is asked for.
    `submaps` are the landmarks of the candidates and the strongest rival, (N, 2) float64, metres, submap frame, by
    submap id, if they were read. `content_revisions` are the revisions at which the landmarks of the candidates, and of
    the submap in the query if it names one, were stored, by submap id.
    """

    asked: QueryLandmarks
    collection: CollectionRecord
    members: Members
    candidates: tuple[Candidate, ...]
    submaps: dict[str, NDArray[np.float64]]
    content_revisions: dict[str, int]

    @cached_property
    def answer(self) -> QueryAnswer:
        """The answer as a model."""
        answer = QueryAnswer.model_validate(self.members)
        return answer if answer.findings is None else answer.model_copy(update={"sentences": sentences(answer)})

    def draw(self, rank: int, title: str) -> str:
        """The candidate at `rank` (from 1) as SVG."""
        xy = self.submaps[self.answer.candidates[rank - 1].submap_id]
        return urquhart.draw_match(self.asked.xy, xy, self.candidates[rank - 1], title=title)

    def explain(self, name: str) -> QueryExplanation:
        """The explanation of the answer. `name` is that of the query, for people."""
        return QueryExplanation(name, self.answer, self.asked.xy, self.submaps)


def answer_query(
    context: QueryContext,
    collection_id: str,
    query: PlaceQuery,
    *,
    key: AnswerKey = NO_KEY,
    pairs: int | None = None,
    budget: Budget | None = None,
) -> QueryAnswer:
    """Answer a query, and store the answer under its `key` if the query asks for that.

    Raises as `look_up`, and KeyReused.

    `pairs`: most pairs of landmarks in the answer, by default `limits.answer_pairs`. With a `budget`, the search ends
    `limits.query_seconds` or `timeout_ms` after the budget began; without one it takes as long as it needs.
    """
    look = _look_up_in_time(context, collection_id, query, budget)
    answer = look.answer
    if query.store:
        new = NewAnswer(look.collection, look.asked.xy, look.asked.ids, look.candidates, answer)
        answer = keep(context.database, context.limits, new, key)
    return shown(answer, query, pairs)


def answer_as_json(
    context: QueryContext,
    collection_id: str,
    query: PlaceQuery,
    *,
    pairs: int | None = None,
    budget: Budget | None = None,
) -> tuple[bytes, int]:
    """Answer a query that is not stored, as `answer_query` does: JSON, and the number of pairs in it."""
    if query.explain:
        answer = answer_query(context, collection_id, query, pairs=pairs, budget=budget)
        return to_json(answer), carried(answer)
    if pairs is not None:
        context = replace(context, limits=context.limits.model_copy(update={"answer_pairs": pairs}))
    members = _look_up_in_time(context, collection_id, query, budget).members
    return answer_json(members), listed(members)


def _look_up_in_time(
    context: QueryContext, collection_id: str, query: PlaceQuery, budget: Budget | None
) -> LookupResult:
    with turn():
        budget = None if budget is None else share_of(budget, query, context.limits)
        return look_up(context, collection_id, query, budget=budget)


def shown(answer: QueryAnswer, query: PlaceQuery, pairs: int | None = None) -> QueryAnswer:
    """An answer with at most so many pairs. A stored answer has more of them, for later requests."""
    if not query.pairs:
        pairs = 0
    if pairs is not None:
        answer = within(answer, pairs)
    if query.explain or answer.findings is None:
        return answer
    return answer.model_copy(update={"findings": None, "findings_total": None, "sentences": None})


def _retry_without_damaged_segments(
    look: Callable[Concatenate[QueryContext, str, P], LookupResult],
) -> Callable[Concatenate[QueryContext, str, P], LookupResult]:
    """Search again if a segment turned out to be damaged during the search."""

    @wraps(look)
    def looked_up(context: QueryContext, collection_id: str, /, *args: P.args, **named: P.kwargs) -> LookupResult:
        return context.indexes.whatever_happens(collection_id, lambda: look(context, collection_id, *args, **named))

    return looked_up


@_retry_without_damaged_segments
def look_up(
    context: QueryContext,
    collection_id: str,
    query: PlaceQuery,
    *,
    pending: PendingSubmap | None = None,
    to_draw: bool = False,
    budget: Budget | None = None,
) -> LookupResult:
    """Search a collection. With `to_draw`, also read the landmarks of the candidates and the first rival.

    A `pending` submap is described already, and what is stored under its id is left out of the search. With a `budget`,
    the search ends when that is spent, and without an answer if it is abandoned.

    Too few or collinear landmarks are an answer, not an error. Raises NotFound (the collection, or `submap_id`),
    InvalidLandmarks, InvalidField, StorageError, and Abandoned (the caller has gone).
    """
    limits = context.limits
    pin_threads()
    with context.indexes.view(collection_id) as view:
        submaps = view.tx.submaps(view.collection.key)
        asked, own = _asked(submaps, query)
        if own is not None:
            query = replace(query, frame_id=query.frame_id or own.frame_id, stamp=query.stamp or own.stamp)
        excluded = query.exclude.keys(submaps, query.stamp)
        if own is not None:
            excluded.add(own.key)
        if pending is not None and pending.id is not None:
            excluded.update(submaps.keys([pending.id]).values())
        if pending is not None:
            observation = pending.description
        else:
            own_key = None if own is None else own.key
            observation = describe_query(view, asked, query.pointer, own_key, budget)
        rows = view.tx.candidates(view.collection.key)
        if isinstance(observation.result, Features):
            only = None if query.near is None else query.near.keys(submaps)
            search = SubmapSearch(view, query, observation.result, query.limit, only, budget, rows)
            found, hint = search.find(excluded)
        else:
            found, hint = unsearched(observation.result), None
        found = replace(found, stages=observation.stages + found.stages)
        drawn = rows.read(drawn_keys(found), landmarks=True) if to_draw else {}
        outcome = SearchOutcome(found, hint, rows.read(named_keys(found), landmarks=False))
        members = query_answer(view, query, asked, outcome, limits.answer_pairs)
        landmarks = {one.id: unpack_positions(one.landmarks) for one in drawn.values()}
        revisions = {one.id: one.content_revision for one in outcome.rows.values()}
        if own is not None:
            revisions[own.id] = own.content_revision
    _observe(context.metrics, found)
    return LookupResult(asked, view.collection, members, found.candidates, landmarks, revisions)


def _asked(submaps: SubmapReader, query: PlaceQuery) -> tuple[QueryLandmarks, SubmapContent | None]:
    """The landmarks of the query, and the stored submap that they are from if it names one. Raises NotFound."""
    if query.landmarks is not None:
        return query.landmarks, None
    row = None if query.submap_id is None else submaps.get(query.submap_id, SubmapContent)
    if row is None:
        raise NotFound("submap", query.submap_id or "")
    xy = unpack_positions(row.landmarks)
    ids = None if row.landmark_ids is None else unpack_ids(row.landmark_ids, len(xy))
    return QueryLandmarks(xy, unpack_diameters(row.attributes), ids), row


def _observe(metrics: Metrics, found: Recognition) -> None:
    metrics.verdicts.labels(found.verdict).inc()
    for stage in found.stages:
        metrics.observe_stage(stage.name, stage.milliseconds)
    note_query(found.verdict, ((stage.name, stage.milliseconds) for stage in found.stages))


def share_of(budget: Budget, query: PlaceQuery, limits: Limits) -> Budget:
    """The part of a request's budget that the search may use, so that the answer is ready at the deadline."""
    seconds = limits.query_seconds if query.seconds is None else min(limits.query_seconds, query.seconds)
    return budget.within(seconds - min(_TO_ANSWER, _ANSWER_SHARE * seconds) - budget.elapsed)
