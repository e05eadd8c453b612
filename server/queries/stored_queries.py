"""Stored answers: written, read, drawn, and explained."""

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

import urquhart
from server.collections.crud import get_collection
from server.config.settings import Limits
from server.errors import Gone, NotFound
from server.index.row_decoding import config_of
from server.queries.answers import gates_answer
from server.queries.explanations import QueryExplanation
from server.queries.older_answers import completed, gone, read_older
from server.resources import idempotency, links
from server.resources.idempotency import IdempotencyKey, StoredResponse, find_response
from server.schemas.candidates import CandidateAnswer, CandidateLinks, GatesAnswer
from server.schemas.queries import MatchAnswer, QueryAnswer, QueryLinks
from server.store.codec import pack_json, pack_positions, unpack_ids, unpack_positions
from server.store.records import CollectionRecord, QueryRecord
from server.store.storage import ReadTransaction, Storage
from server.store.submap_records import SubmapContent
from urquhart import SE2, Budget, Candidate
from urquhart.pose_covariance import PoseUncertainty


@dataclass(frozen=True, slots=True)
class AnswerKey:
    """How a repeated request finds its stored answer: by Idempotency-Key, and by position in a batch, counted from
    1.
    """

    idempotency_key: IdempotencyKey | None = None
    position: int = 0

    def operation(self, collection: CollectionRecord) -> str:
        """The operation under which the idempotency key is stored."""
        return f"query {collection.key}" if self.position == 0 else f"query {collection.key} {self.position}"


NO_KEY: Final = AnswerKey()
_FORMERLY: Final = {"overlap": "overlap_ratio", "votes": "support"}
"""Attributes of a candidate that had another name in versions before 0.2.0."""


@dataclass(frozen=True, slots=True)
class NewAnswer:
    """An answer to store, with the query's landmarks (N, 2) float64, metres, query frame, and their ids."""

    collection: CollectionRecord
    xy: NDArray[np.float64]
    ids: list[str] | None
    found: Sequence[Candidate]
    answer: QueryAnswer


def keep(database: Storage, limits: Limits, new: NewAnswer, key: AnswerKey) -> QueryAnswer:
    """Store an answer, unless that was done before. Returns the answer with its id and links. The oldest answers beyond
    the limit are deleted.

    Raises NotFound and KeyReused.
    """
    collection, operation = new.collection, key.operation(new.collection)
    with database.write() as tx:
        if get_collection(tx, collection.id).key != collection.key:
            raise NotFound("collection", collection.id)
        response = find_response(tx, key.idempotency_key, operation)
        if response is not None:
            return _again(tx, collection, response)
        number = tx.collections.next_query_number(collection.key)
        answer = _numbered(new.answer, collection.id, number)
        queries = tx.queries(collection.key)
        candidates = [
            _pack(candidate if not shown.inliers_omitted else _without_pairs(candidate))
            for candidate, shown in zip(new.found, answer.candidates, strict=True)
        ]
        packed = answer.model_dump_json().encode()
        queries.add(QueryRecord(number, candidates, pack_positions(new.xy), pack_json(new.ids), packed))
        queries.drop_through(number - limits.stored_queries)
        # The answer itself is stored with the query; this refers to it.
        named = StoredResponse(200, {}, str(number).encode())
        idempotency.store_response(tx, key.idempotency_key, operation, named)
    return answer


def _numbered(answer: QueryAnswer, collection_id: str, number: int) -> QueryAnswer:
    """The answer with the id and the links of a stored query."""
    candidates = [
        shown.model_copy(
            update={
                "links": CandidateLinks(submap=shown.links.submap, match=links.match(collection_id, number, shown.rank))
            }
        )
        for shown in answer.candidates
    ]
    own = QueryLinks(
        self=links.query(collection_id, number),
        collection=answer.links.collection,
        explanation=links.explanation(collection_id, number),
    )
    return answer.model_copy(update={"id": str(number), "candidates": candidates, "links": own})


def kept_answer(database: Storage, collection_id: str, key: AnswerKey) -> QueryAnswer | None:
    """The stored answer to the same query under the same key; None if there is none.

    Raises NotFound, KeyReused, and Gone for an answer that is no longer stored.
    """
    if key.idempotency_key is None:
        return None
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        response = find_response(tx, key.idempotency_key, key.operation(collection))
        return None if response is None else _again(tx, collection, response)


def _again(tx: ReadTransaction, collection: CollectionRecord, response: StoredResponse) -> QueryAnswer:
    if not response.body.isdigit():  # earlier versions stored the whole answer here, too
        return read_older(QueryAnswer, orjson.loads(response.body), "The answer to this Idempotency-Key")
    number = response.body.decode()
    return read_older(QueryAnswer, _answer_of(_stored(tx, collection, number), collection), f"Query {number}")


def stored_answer(database: Storage, collection_id: str, query_id: str) -> bytes:
    """A stored answer as JSON. Raises NotFound, and Gone if it is no longer kept."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        return orjson.dumps(_answer_of(_stored(tx, collection, query_id), collection))


@dataclass(frozen=True, slots=True)
class Match:
    """A candidate of a stored query with the landmarks of both sides, each (N, 2) float64, metres, in its own frame,
    and their ids.
    """

    query_id: str
    answer: CandidateAnswer
    query_xy: NDArray[np.float64]
    submap_xy: NDArray[np.float64]
    query_ids: list[str]
    submap_ids: list[str]
    candidate: Candidate

    def to_answer(self) -> MatchAnswer:
        """The match as data."""
        return MatchAnswer(
            query_id=self.query_id,
            candidate=self.answer,
            query_landmarks=[(float(x), float(y)) for x, y in self.query_xy],
            submap_landmarks=[(float(x), float(y)) for x, y in self.submap_xy],
            query_ids=self.query_ids,
            submap_ids=self.submap_ids,
        )

    def to_svg(self, budget: Budget) -> str:
        """The match as a drawing. Raises urquhart.budget.DeadlinePassed and Abandoned."""
        title = f"query {self.query_id} on {self.answer.submap_id}: {self.answer.inlier_count} inliers"
        return urquhart.draw_match(self.query_xy, self.submap_xy, self.candidate, title=title, budget=budget)


def stored_match(database: Storage, collection_id: str, query_id: str, rank: int) -> Match:
    """A candidate of a stored query, to be read or drawn.

    Raises NotFound, and Gone if the query is no longer kept, its pairs were not stored, or the submap's landmarks have
    changed since.
    """
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        stored = _stored(tx, collection, query_id)
        answer = read_older(QueryAnswer, _answer_of(stored, collection), f"Query {query_id}")
        if not 1 <= rank <= len(answer.candidates):
            raise NotFound(f"candidate of query {query_id!r} with rank", str(rank))
        if answer.candidates[rank - 1].inliers_omitted:
            raise Gone(
                f"The pairs of candidate {rank} were not stored, because better candidates used up the limit "
                "answer_pairs. Send the query again with a smaller `limit`."
            )
        if rank > len(stored.candidates) or (candidate := _unpack(stored.candidates[rank - 1])) is None:
            raise gone(f"The match of query {query_id}")
        row = tx.candidates(collection.key).read([candidate.key], landmarks=True).get(candidate.key)
        if row is None or row.content_revision > answer.revision:
            what = "deleted" if row is None else "given other landmarks"
            raise Gone(
                f"The submap of candidate {rank} was {what} after the query. Send the query again to search the "
                "present submaps."
            )
        shown = answer.candidates[rank - 1]
        query_xy, submap_xy = unpack_positions(stored.landmarks), unpack_positions(row.landmarks)
        query_ids = unpack_ids(stored.landmark_ids, len(query_xy))
        submap_ids = unpack_ids(row.landmark_ids, len(submap_xy))
        return Match(query_id, shown, query_xy, submap_xy, query_ids, submap_ids, candidate)


def stored_answers(tx: ReadTransaction, collection: CollectionRecord, *, after: int, limit: int) -> list[QueryAnswer]:
    """Up to `limit` stored answers in the order of their numbers, beginning after one, whichever version wrote them."""
    rows = tx.queries(collection.key).page(after=after, limit=limit)
    return [read_older(QueryAnswer, _answer_of(row, collection), f"Query {row.number}") for row in rows]


def stored_landmark_ids(tx: ReadTransaction, collection: CollectionRecord, query_id: str) -> list[str]:
    """Ids of the landmarks of a stored query, or their positions in the list as text. Raises NotFound and Gone."""
    stored = _stored(tx, collection, query_id)
    count = len(stored.landmarks) // 16
    return unpack_ids(stored.landmark_ids, count)


def stored_explanation(database: Storage, collection_id: str, query_id: str) -> QueryExplanation:
    """The explanation of a stored answer. Raises NotFound, and Gone if it is no longer kept.

    Submaps whose landmarks changed since are left out.
    """
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        stored = _stored(tx, collection, query_id)
        answer = read_older(QueryAnswer, _answer_of(stored, collection), f"Query {query_id}")
        submaps = tx.submaps(collection.key)
        shown = {one.submap_id for one in answer.candidates[:1]} | {one.submap_id for one in answer.rivals[:1]}
        rows = [row for name in shown if (row := submaps.get(name, SubmapContent)) is not None]
        landmarks = {row.id: unpack_positions(row.landmarks) for row in rows if row.content_revision <= answer.revision}
        return QueryExplanation(f"query {query_id}", answer, unpack_positions(stored.landmarks), landmarks)


def _answer_of(stored: QueryRecord, collection: CollectionRecord) -> dict[str, Any]:
    """The members of a stored answer, whichever version wrote it. Members that it did not write say that there is
    none.
    """
    number, members = str(stored.number), orjson.loads(stored.answer)
    own = QueryLinks(
        self=links.query(collection.id, stored.number),
        collection=links.collection(collection.id),
        explanation=links.explanation(collection.id, stored.number),
    )
    gates = gates_answer(config_of(collection)).model_dump()
    gates |= completed(GatesAnswer, members.get("gates") or {}, known_only=True)
    if "landmarks" not in members:
        members = {"landmark_count": len(stored.landmarks) // 16} | members
    members |= {"id": number, "collection": collection.id, "gates": gates, "links": own.model_dump()}
    for rank, shown in enumerate(members.get("candidates", ()), start=1):
        if isinstance(shown.get("submap_id"), str):
            shown["links"] = {
                "submap": links.submap(collection.id, shown["submap_id"]),
                "match": links.match(collection.id, stored.number, rank),
            }
        shown.setdefault("rank", rank)
    for rival in members.get("rivals", ()):
        if isinstance(rival.get("submap_id"), str):
            rival["links"] = {"submap": links.submap(collection.id, rival["submap_id"])}
    return completed(QueryAnswer, members)


def _stored(tx: ReadTransaction, collection: CollectionRecord, query_id: str) -> QueryRecord:
    number = int(query_id) if query_id.isascii() and query_id.isdigit() and len(query_id) <= 18 else 0
    row = tx.queries(collection.key).get(number)
    if row is not None:
        return row
    if 1 <= number <= collection.query_sequence:
        raise Gone(f"Query {query_id} is no longer kept: only the newest queries of a collection are. Send it again.")
    raise NotFound("stored query", query_id)


def _pack(candidate: Candidate) -> dict[str, Any]:
    packed: dict[str, Any] = {}
    for field in fields(Candidate):
        value = getattr(candidate, field.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, SE2):
            value = [value.x, value.y, value.yaw]
        elif isinstance(value, PoseUncertainty):
            value = [value.source.tolist(), value.covariance.tolist()]
        packed[field.name] = value
    return packed


def _without_pairs(candidate: Candidate) -> Candidate:
    none = np.empty(0, dtype=np.int64)
    return replace(candidate, query_indices=none, submap_indices=none, residuals=np.empty(0))


def _unpack(packed: dict[str, Any]) -> Candidate | None:
    """A candidate as it was stored; None if the version that stored it left out what this one needs."""
    names = {field.name for field in fields(Candidate)}
    required = {field.name for field in fields(Candidate) if field.default is field.default_factory is MISSING}
    packed = {_FORMERLY.get(name, name): value for name, value in packed.items()}
    known = {name: value for name, value in packed.items() if name in names}
    if "covariance" in packed:  # earlier versions stored uncertainties about the query's origin
        known.setdefault("uncertainty", [[0.0, 0.0], packed["covariance"]])
    if not required <= known.keys():
        return None
    transform = SE2(*known["transform"])
    source, covariance = (np.array(value, dtype=np.float64) for value in known["uncertainty"])
    known |= {name: np.array(known[name], dtype=np.int64) for name in ("query_indices", "submap_indices")}
    known["residuals"] = np.array(known["residuals"], dtype=np.float64)
    known["uncertainty"] = PoseUncertainty.about_point(source, transform, covariance.reshape(3, 3))
    return Candidate(**known | {"transform": transform, "warnings": tuple(known.get("warnings", ()))})
