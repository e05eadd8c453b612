"""Submaps in: validated, described, stored. Idempotent by content.

Describing takes milliseconds and needs no database, so it is done before the write transaction begins; the transaction
looks again at what is there and at the preconditions.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from sqlalchemy.orm import Session

from server import batches
from server.batches import Described, Refusal
from server.derive import config_of
from server.errors import Conflict, NotFound
from server.idempotency import Kept, Once, keep, recall
from server.preconditions import ANYTHING, Preconditions
from server.prepare import Prepared, check_properties, content_etag, place_from, settle
from server.registry import get_collection
from server.schemas.submaps import NamedSubmap, SubmapInput, SubmapPatch
from server.settings import Limits
from server.store.codec import unpack_positions
from server.store.collections import Collections
from server.store.database import Database
from server.store.submaps import Identity, SubmapRecord, Submaps, stored_place
from server.store.tables import CollectionRow
from server.threads import pin_threads
from server.workers import Work, Workers

_Given = TypeVar("_Given")
_Task = TypeVar("_Task")
Outcome = Literal["created", "replaced", "unchanged"]


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of a submap."""

    outcome: Outcome
    etag: str
    revision: int
    counts: dict[str, int]


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
        collection = _same_collection(session, collection_id, collection.key)
        known = Submaps(session, collection.key).identities([submap_id]).get(submap_id)
        preconditions.check(known.etag if known else None)
        return _store(session, collection, [(known, prepared.record(known, config))])[0]


def post(
    database: Database,
    collection_id: str,
    submap_id: str,
    body: SubmapInput,
    limits: Limits,
    once: Once | None,
    answer: Callable[[Receipt], Kept],
) -> Kept:
    """Store a new submap under an id that is not taken, unless the same was done before; what is answered.

    Raises NotFound, InvalidLandmarks, TooLarge, KeyReused and StorageError; then nothing is stored.
    """
    pin_threads()
    prepared = Prepared(submap_id, body, limits)
    with database.read() as session:
        collection = get_collection(session, collection_id)
    config = config_of(collection)
    prepared.describe(config)
    with database.write() as session:
        collection = _same_collection(session, collection_id, collection.key)
        kept = recall(session, once, _posting(collection))
        if kept is not None:
            return kept
        receipt = _store(session, collection, [(None, prepared.record(None, config))])[0]
        return keep(session, once, _posting(collection), answer(receipt))


def posted(database: Database, collection_id: str, once: Once | None) -> Kept | None:
    """What was answered to a POST that was sent before. Raises NotFound and KeyReused."""
    with database.read() as session:
        return recall(session, once, _posting(get_collection(session, collection_id)))


def _posting(collection: CollectionRow) -> str:
    return f"postSubmap {collection.key}"


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
    workers: Workers | None = None,
) -> Iterator[BatchResult]:
    """Store many submaps, a transaction for each batch; yields what became of each batch once it is durable.

    A submap that cannot be used is reported in `refused` and does not stop the others. An id that is there already is
    replaced; of an id that comes twice in a batch, the last stands. While a batch is written, the next ones are
    described by `workers` (of `batches.describers`; without it a pool for this call, a process for each core), which
    are started when the work goes on for more than a second.

    Raises NotFound, StorageError and WorkerLost; what was yielded is stored.
    """
    limits = limits or Limits()
    work = batches.of_submaps(database, collection_id, limits)
    return _ingest(database, collection_id, work, batches.cut(submaps, batch_size, batches.weigh_submap), workers)


def ingest_lines(
    database: Database,
    collection_id: str,
    lines: Iterable[bytes],
    *,
    batch_size: int = 500,
    limits: Limits | None = None,
    workers: Workers | None = None,
) -> Iterator[BatchResult]:
    """Store submaps that come as lines of NDJSON, each the body of a PUT with the submap's `id`; as `ingest_many`.

    Lines are read where they are described, which is the fastest way in. Empty ones are passed over.
    """
    limits = limits or Limits()
    work = batches.of_lines(database, collection_id, limits)
    return _ingest(database, collection_id, work, batches.cut(lines, batch_size, len), workers)


def _ingest(
    database: Database,
    collection_id: str,
    work: Work[_Given, _Task, Described],
    given: Iterable[_Given],
    workers: Workers | None,
) -> Iterator[BatchResult]:
    pin_threads()
    with (
        nullcontext(workers) if workers is not None else batches.describers() as pool,
        closing(pool.map(work, given)) as results,
    ):
        for described in results:
            yield _write(database, collection_id, described)


def _write(database: Database, collection_id: str, batch: Described) -> BatchResult:
    result = BatchResult(replaced=batch.superseded, refused=batch.refused, landmarks=batch.landmarks)
    with database.write() as session:
        collection = _same_collection(session, collection_id, batch.collection_key)
        known = Submaps(session, collection.key).identities([record.id for record in batch.records])
        receipts = _store(session, collection, [(known.get(record.id), record) for record in batch.records])
        result.revision = max((receipt.revision for receipt in receipts), default=collection.revision)
    for receipt in receipts:
        setattr(result, receipt.outcome, getattr(result, receipt.outcome) + 1)
    return result


def _same_collection(session: Session, collection_id: str, key: int) -> CollectionRow:
    now = get_collection(session, collection_id)
    if now.key != key:
        raise Conflict(f"The collection {collection_id!r} was deleted and made again meanwhile; send the submap again.")
    return now


def _store(
    session: Session, collection: CollectionRow, pairs: list[tuple[Identity | None, SubmapRecord]]
) -> list[Receipt]:
    """Write what differs from what is known, under one new revision."""
    config = config_of(collection)
    changes = [
        (known, settle(record, known, config)) for known, record in pairs if known is None or known.etag != record.etag
    ]
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
