"""Submaps in: validated, described, stored. Idempotent by content.

Describing takes milliseconds and needs no database, so it is done before the write transaction begins; the transaction
looks again at what is there and at the preconditions.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

from sqlalchemy.orm import Session

from server.derive import config_of
from server.errors import Conflict, DomainError, NotFound
from server.preconditions import ANYTHING, Preconditions
from server.prepare import Prepared, check_properties, content_etag, place_from
from server.registry import get_collection
from server.schemas.submaps import NamedSubmap, SubmapInput, SubmapPatch
from server.settings import Limits
from server.store.codec import unpack_positions
from server.store.collections import Collections
from server.store.database import Database
from server.store.submaps import Identity, SubmapRecord, Submaps, stored_place
from server.store.tables import CollectionRow
from server.threads import pin_threads
from urquhart import Config

Outcome = Literal["created", "replaced", "unchanged"]


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of a submap."""

    outcome: Outcome
    etag: str
    revision: int
    counts: dict[str, int]


@dataclass(frozen=True, slots=True)
class Refusal:
    """A submap that was not stored, and why."""

    submap_id: str
    error: DomainError


@dataclass(slots=True)
class BatchResult:
    """What became of one batch of `ingest_many`; durable when it is yielded."""

    created: int = 0
    replaced: int = 0
    unchanged: int = 0
    refused: list[Refusal] = field(default_factory=list)
    landmarks: int = 0
    revision: int = 0

    @property
    def submaps(self) -> int:
        """How many submaps of the input this batch accounts for."""
        return self.created + self.replaced + self.unchanged + len(self.refused)


def put(
    database: Database,
    collection_id: str,
    submap_id: str,
    body: SubmapInput,
    limits: Limits,
    preconditions: Preconditions = ANYTHING,
) -> Receipt:
    """Store a submap under an id: created, replaced, or unchanged when it is there already with the same content.

    Raises NotFound, PreconditionFailed, InvalidLandmarks, TooLarge and StorageError; then nothing is stored.
    """
    pin_threads()
    prepared = Prepared(submap_id, body, limits)
    with database.read() as session:
        collection = get_collection(session, collection_id)
        known = Submaps(session, collection.key).identities([submap_id]).get(submap_id)
    preconditions.check(known.etag if known else None)
    if known is not None and known.etag == prepared.etag:
        return Receipt("unchanged", known.etag, known.revision, known.counts)
    config = config_of(collection)
    if not prepared.has_features(known):
        prepared.describe(config)
    with database.write() as session:
        collection = _same_collection(session, collection)
        known = Submaps(session, collection.key).identities([submap_id]).get(submap_id)
        preconditions.check(known.etag if known else None)
        return _store(session, collection, [(known, prepared)], config)[0]


def patch(
    database: Database,
    collection_id: str,
    submap_id: str,
    body: SubmapPatch,
    limits: Limits,
    preconditions: Preconditions = ANYTHING,
) -> None:
    """Change a submap's pose in the map or its properties; its landmarks and the index are left alone.

    Raises NotFound, PreconditionFailed, TooLarge and StorageError.
    """
    check_properties(body.properties, limits)
    with database.write() as session:
        collection = get_collection(session, collection_id)
        submaps = Submaps(session, collection.key)
        row = submaps.get_whole(submap_id)
        if row is None:
            raise NotFound("submap", submap_id)
        preconditions.check(row.etag)
        given = body.model_fields_set
        place = place_from(body.map_pose, unpack_positions(row.landmarks)) if "map_pose" in given else stored_place(row)
        properties = body.properties if "properties" in given else row.properties
        etag = content_etag(
            row.landmarks_hash,
            row.landmark_ids,
            row.attributes,
            frame_id=row.frame_id,
            session=row.session,
            stamp=row.stamp,
            place=place,
            properties=properties,
        )
        if etag != row.etag:
            revision = Collections(session).advance(collection.key)
            submaps.edit(row.key, place=place, properties=properties, etag=etag, revision=revision)


def delete(database: Database, collection_id: str, submap_id: str, preconditions: Preconditions = ANYTHING) -> None:
    """Remove a submap. Raises NotFound, PreconditionFailed and StorageError."""
    with database.write() as session:
        collection = get_collection(session, collection_id)
        submaps = Submaps(session, collection.key)
        known = submaps.identities([submap_id]).get(submap_id)
        if known is None:
            raise NotFound("submap", submap_id)
        preconditions.check(known.etag)
        revision = Collections(session).advance(
            collection.key, submaps=-1, landmarks=-known.landmark_count, polygons=-known.polygon_count
        )
        submaps.delete(known.key, revision)


def ingest_many(
    database: Database,
    collection_id: str,
    submaps: Iterable[NamedSubmap],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
) -> Iterator[BatchResult]:
    """Store many submaps, a transaction for each batch; yields what became of each batch once it is durable.

    A submap that cannot be used is reported in `refused` and does not stop the others. An id that is there already is
    replaced; of an id that comes twice in a batch, the last stands. Raises NotFound and StorageError.
    """
    limits = limits or Limits()
    pin_threads()
    rows = iter(submaps)
    while batch := list(islice(rows, batch_size)):
        yield _ingest_batch(database, collection_id, batch, limits)


def _ingest_batch(database: Database, collection_id: str, batch: list[NamedSubmap], limits: Limits) -> BatchResult:
    result = BatchResult()
    latest: dict[str, Prepared] = {}
    with database.read() as session:
        collection = get_collection(session, collection_id)
        known = Submaps(session, collection.key).identities({submap.id for submap in batch})
    config = config_of(collection)
    for submap in batch:
        try:
            prepared = Prepared(submap.id, submap, limits)
            if not prepared.has_features(known.get(submap.id)):
                prepared.describe(config)
        except DomainError as error:
            result.refused.append(Refusal(submap.id, error))
            continue
        if latest.pop(submap.id, None) is not None:
            result.replaced += 1
        latest[submap.id] = prepared
        result.landmarks += submap.landmark_count
    with database.write() as session:
        collection = _same_collection(session, collection)
        known = Submaps(session, collection.key).identities(latest)
        receipts = _store(session, collection, [(known.get(name), new) for name, new in latest.items()], config)
        result.revision = max((receipt.revision for receipt in receipts), default=collection.revision)
    for receipt in receipts:
        setattr(result, receipt.outcome, getattr(result, receipt.outcome) + 1)
    return result


def _same_collection(session: Session, before: CollectionRow) -> CollectionRow:
    now = get_collection(session, before.id)
    if now.key != before.key:
        raise Conflict(f"The collection {before.id!r} was deleted and made again meanwhile; send the submap again.")
    return now


def _store(
    session: Session, collection: CollectionRow, pairs: list[tuple[Identity | None, Prepared]], config: Config
) -> list[Receipt]:
    """Write what differs from what is known, under one new revision."""
    changes = [(known, new.record(known, config)) for known, new in pairs if known is None or known.etag != new.etag]
    revision = collection.revision
    if changes:
        replaced = [known for known, _ in changes if known is not None]
        revision = Collections(session).advance(
            collection.key,
            submaps=len(changes) - len(replaced),
            landmarks=sum(r.landmark_count for _, r in changes) - sum(known.landmark_count for known in replaced),
            polygons=sum(r.polygon_count for _, r in changes) - sum(known.polygon_count for known in replaced),
        )
        submaps = Submaps(session, collection.key)
        submaps.insert([record for known, record in changes if known is None], revision)
        for known, record in changes:
            if known is not None:
                submaps.replace(known.key, record, revision)
    written = {record.id: record for _, record in changes}
    return [_receipt(known, written.get(new.id), revision) for known, new in pairs]


def _receipt(known: Identity | None, record: SubmapRecord | None, revision: int) -> Receipt:
    if record is not None:
        return Receipt("created" if known is None else "replaced", record.etag, revision, record.counts)
    if known is None:
        raise AssertionError("a submap is written, or was there")
    return Receipt("unchanged", known.etag, known.revision, known.counts)
