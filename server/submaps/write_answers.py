"""Answers to writes of submaps."""

from dataclasses import dataclass
from typing import Literal

from server.errors import InvalidLandmarks
from server.resources import links
from server.resources.idempotency import StoredResponse
from server.schemas.common import to_json
from server.schemas.queries import QueryAnswer
from server.schemas.submaps import Submap, SubmapReceipt
from server.store.records import CollectionRecord
from server.store.submap_records import Identity
from server.submaps import reader

Outcome = Literal["created", "replaced", "unchanged"]


@dataclass(frozen=True, slots=True)
class Receipt:
    """The outcome of a write.

    `cleared`: optional members that the submap had before and no longer has, by their names in the API.
    """

    outcome: Outcome
    etag: str
    revision: int
    counts: dict[str, int]
    cleared: tuple[str, ...] = ()


def receipt_answer(collection_id: str, submap_id: str, receipt: Receipt, found: QueryAnswer | None) -> StoredResponse:
    """The answer to a PUT or POST, with the result of its query if it had one."""
    headers = {"ETag": f'"{receipt.etag}"'}
    if receipt.outcome == "created":
        headers["Location"] = links.submap(collection_id, submap_id)
    answer = SubmapReceipt(
        id=submap_id,
        collection=collection_id,
        outcome=receipt.outcome,
        counts=receipt.counts,
        etag=receipt.etag,
        revision=receipt.revision,
        cleared=list(receipt.cleared),
        links=reader.submap_links(collection_id, submap_id),
        query=found,
    )
    return StoredResponse(201 if receipt.outcome == "created" else 200, headers, to_json(answer))


def refusal_answer(
    collection: CollectionRecord,
    submap_id: str | None,
    known: Identity | None,
    error: InvalidLandmarks,
    found: QueryAnswer,
) -> StoredResponse:
    """The answer to a submap with a query that cannot be stored. `known` is what stays stored."""
    answer = SubmapReceipt(
        id=submap_id,
        collection=collection.id,
        outcome="not_stored",
        reason=found.reason,
        detail=str(error),
        counts={} if known is None else known.counts,
        etag=None if known is None else known.etag,
        revision=collection.revision if known is None else known.revision,
        links=None if known is None or submap_id is None else reader.submap_links(collection.id, submap_id),
        query=found,
    )
    return StoredResponse(200, {} if known is None else {"ETag": f'"{known.etag}"'}, to_json(answer))


def submap_answer(submap: Submap) -> StoredResponse:
    """The answer to a PATCH."""
    return StoredResponse(200, {"ETag": f'"{submap.etag}"'}, to_json(submap))
