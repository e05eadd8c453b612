"""Writes of submaps: validated, described, stored. Idempotent by content and by Idempotency-Key.

Describing takes milliseconds and needs no database, so it comes before the write transaction. The transaction reads
again what is stored and checks the preconditions. The answer is read in it as well, so nobody is told of another
caller's write.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from server.collections import georeference
from server.collections.crud import get_collection
from server.config.settings import Limits
from server.errors import Conflict, InvalidLandmarks, NotFound, Overloaded
from server.index.row_decoding import config_of, features_of
from server.platform.precedence import turn
from server.platform.thread_limits import pin_threads
from server.resources.idempotency import NO_CONTENT, IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.preconditions import ANYTHING, Preconditions
from server.schemas.submaps import SubmapInput, SubmapPatch
from server.store.codec import MEMBERS
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from server.store.submap_records import Identity, Place, SubmapContent, SubmapRecord
from server.submaps import reader
from server.submaps.loop_closing import LoopClosing, SearchOutdated
from server.submaps.preparation import Prepared, Trees, check_properties, patched, reconcile
from server.submaps.write_answers import Outcome, Receipt, receipt_answer, refusal_answer, submap_answer
from urquhart import OBSTACLES, Description, Features

_ATTEMPTS: Final = 8
"""Searches after which a submap with a query is refused, because others store submaps faster than one search takes."""


@dataclass(frozen=True, slots=True)
class Stored:
    """The answer to a write. `outcome` is None if this request stored nothing."""

    outcome: Outcome | None
    response: StoredResponse


@dataclass(frozen=True, slots=True)
class WriteTerms:
    """The conditions of a write.

    Attributes:
        preconditions: what must be true of the submap that is there.
        idempotency_key: a request that repeats it is answered as the first one was.
        loop_closing: the search for the place of the submap before it is stored, if there is one.
        is_named: whether the id is the caller's; else the service made it, and a repeated request has another.
    """

    preconditions: Preconditions = ANYTHING
    idempotency_key: IdempotencyKey | None = None
    loop_closing: LoopClosing | None = None
    is_named: bool = True


NO_TERMS: Final = WriteTerms()


def put(
    database: Storage,
    collection_id: str,
    submap_id: str,
    body: SubmapInput,
    limits: Limits,
    terms: WriteTerms = NO_TERMS,
) -> Stored:
    """Store a submap under an id: created, replaced, or unchanged if it is stored already with the same content.

    With a search for loops in its `terms`, landmarks that cannot make a submap are answered, and nothing is stored.

    Raises NotFound, PreconditionFailed, InvalidLandmarks, TooLarge, KeyReused, Overloaded and StorageError; then
    nothing is stored.
    """
    pin_threads()
    prepared = Prepared(submap_id, body, limits)
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        operation = _operation(collection, submap_id, terms)
        response = find_response(tx, terms.idempotency_key, operation)
        if response is not None:
            return Stored(None, response)
        check_place(tx, collection, prepared.place)
        known = tx.submaps(collection.key).identities([submap_id]).get(submap_id)
        if known is not None and terms.loop_closing is not None and prepared.has_features(known):
            prepared.trees.reuse(_stored_features(tx, collection, known.key))
    terms.preconditions.check(known.etag if known else None)
    same = known is not None and known.etag == prepared.etag
    if known is not None and same and terms.idempotency_key is None:
        found = None
        if terms.loop_closing is not None:
            with turn():
                found = terms.loop_closing.ask(Description(prepared.describe(config_of(collection))))
        receipt = Receipt("unchanged", known.etag, known.revision, known.counts)
        return Stored("unchanged", receipt_answer(collection_id, submap_id, receipt, found))
    return _store(database, collection, prepared, known, terms)


def _operation(collection: CollectionRecord, submap_id: str, terms: WriteTerms) -> str:
    """The operation that an idempotency key is bound to."""
    return f"putSubmap {collection.key} {submap_id}" if terms.is_named else f"postSubmap {collection.key}"


def _store(
    database: Storage, collection: CollectionRecord, prepared: Prepared, known: Identity | None, terms: WriteTerms
) -> Stored:
    """Search, then store in a transaction, until nothing was committed in between that the search should have seen."""
    config, loop_closing = config_of(collection), terms.loop_closing
    observation = found = None
    if loop_closing is not None or not prepared.has_features(known):
        try:
            with turn():
                observation = Description(prepared.describe(config))
        except InvalidLandmarks as error:
            if loop_closing is None or error.code not in OBSTACLES:
                raise
            found = loop_closing.ask(Description(OBSTACLES[error.code]))
            return Stored(
                None, refusal_answer(collection, prepared.id if terms.is_named else None, known, error, found)
            )
    for attempt in range(_ATTEMPTS):
        if loop_closing is not None and observation is not None:
            loop_closing.ask(observation)
        try:
            return _write(database, collection, prepared, terms, attempt)
        except SearchOutdated:
            continue
    raise Overloaded(
        "Other callers store submaps near this one faster than they can be searched, so nothing was stored. Send it "
        "again.",
        1.0,
    )


def _write(
    database: Storage, collection: CollectionRecord, prepared: Prepared, terms: WriteTerms, attempt: int
) -> Stored:
    """One transaction with the submap and its answer. Raises SearchOutdated."""
    config, submap_id = config_of(collection), prepared.id
    operation = _operation(collection, submap_id, terms)
    with database.write(shares=True) as tx:
        now = same_collection(tx, collection.id, collection.key)
        response = find_response(tx, terms.idempotency_key, operation)
        if response is not None:
            return Stored(None, response)
        submaps = tx.submaps(now.key)
        known = submaps.identities([submap_id]).get(submap_id)
        terms.preconditions.check(known.etag if known else None)
        found = (
            None
            if terms.loop_closing is None
            else terms.loop_closing.confirm(tx, now, known.key if known else None, attempt)
        )
        before = frozenset[str]() if known is None else submaps.members(known.key)
        record = prepared.record(known, config)
        receipt = store(tx, now, [(known, record)])[0]
        gone = before - record.members()
        receipt = replace(receipt, cleared=tuple(name for name in MEMBERS if name in gone))
        answer = receipt_answer(now.id, submap_id, receipt, found)
        return Stored(receipt.outcome, store_response(tx, terms.idempotency_key, operation, answer))


def patch(
    database: Storage,
    collection_id: str,
    submap_id: str,
    body: SubmapPatch,
    limits: Limits,
    terms: WriteTerms = NO_TERMS,
) -> StoredResponse:
    """Change the members of a submap that the body names. The index changes only with the landmarks. Returns the
    answer.

    Raises NotFound, PreconditionFailed, InvalidLandmarks, TooLarge, KeyReused and StorageError; then nothing changes.
    """
    pin_threads()
    check_properties(body.properties, limits)
    trees = Trees(body, limits) if body.has_landmarks else None
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
    config = config_of(collection)
    if trees is not None:
        with turn():
            trees.describe(config)
    with database.write(shares=True) as tx:
        now = same_collection(tx, collection_id, collection.key)
        operation = f"patchSubmap {now.key} {submap_id}"
        response = find_response(tx, terms.idempotency_key, operation)
        if response is not None:
            return response
        submaps = tx.submaps(now.key)
        row, known = submaps.get(submap_id, SubmapContent), submaps.identities([submap_id]).get(submap_id)
        if row is None or known is None:
            raise NotFound("submap", submap_id)
        terms.preconditions.check(row.etag)
        record = patched(row, body, trees, config)
        if "map_pose" in body.model_fields_set:
            check_place(tx, now, record.place)
        store(tx, now, [(known, record)])
        changed = submaps.get(submap_id, SubmapContent)
        assert changed is not None
        return store_response(
            tx, terms.idempotency_key, operation, submap_answer(reader.submap_of(collection_id, changed))
        )


def delete(
    database: Storage,
    collection_id: str,
    submap_id: str,
    preconditions: Preconditions = ANYTHING,
    *,
    idempotency_key: IdempotencyKey | None = None,
) -> StoredResponse:
    """Delete a submap. Returns the answer. Raises NotFound, PreconditionFailed, KeyReused and StorageError."""
    with database.write(shares=True) as tx:
        collection = get_collection(tx, collection_id)
        operation = f"deleteSubmap {collection.key} {submap_id}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        submaps = tx.submaps(collection.key)
        known = submaps.identities([submap_id]).get(submap_id)
        if known is None:
            raise NotFound("submap", submap_id)
        preconditions.check(known.etag)
        revision = tx.collections.advance(
            collection.key, submaps=-1, landmarks=-known.landmark_count, polygons=-known.polygon_count
        )
        submaps.delete(known.key, revision)
        return store_response(tx, idempotency_key, operation, NO_CONTENT)


def _stored_features(tx: ReadTransaction, collection: CollectionRecord, key: int) -> Features:
    """The features of a stored submap."""
    row = next(tx.features(collection.key).stored([key]))
    return features_of(row.features, row.landmarks, row.attributes, config_of(collection))


def check_place(tx: ReadTransaction, collection: CollectionRecord, place: Place | None) -> None:
    """Raise InvalidField if the pose in the map is outside the area of the map frame's CRS."""
    if place is not None:
        georeference.check_place(place, tx.map_frames(collection).some([place.map_frame_id]).get(place.map_frame_id))


def same_collection(tx: ReadTransaction, collection_id: str, key: int) -> CollectionRecord:
    """The collection, if it still has that key. Raises NotFound and Conflict."""
    now = get_collection(tx, collection_id)
    if now.key != key:
        raise Conflict(
            f"The collection {collection_id!r} was deleted and created again during this request. Send the submap "
            "again."
        )
    return now


def store(
    tx: WriteTransaction, collection: CollectionRecord, pairs: Sequence[tuple[Identity | None, SubmapRecord]]
) -> list[Receipt]:
    """Write what differs from what is stored, under one new revision."""
    config = config_of(collection)
    changes = [
        (known, reconcile(record, known, config))
        for known, record in pairs
        if known is None or known.etag != record.etag
    ]
    revision = collection.revision
    if changes:
        replaced = [known for known, _ in changes if known is not None]
        revision = tx.collections.advance(
            collection.key,
            submaps=len(changes) - len(replaced),
            landmarks=sum(r.landmark_count for _, r in changes) - sum(known.landmark_count for known in replaced),
            polygons=sum(r.polygon_count for _, r in changes) - sum(known.polygon_count for known in replaced),
        )
        submaps = tx.submaps(collection.key)
        submaps.insert([record for known, record in changes if known is None], revision)
        submaps.replace([(known.key, record) for known, record in changes if known is not None], revision)
    written = {record.id: record for _, record in changes}
    return [_receipt(known, written.get(new.id), revision) for known, new in pairs]


def _receipt(known: Identity | None, record: SubmapRecord | None, revision: int) -> Receipt:
    if record is not None:
        return Receipt("created" if known is None else "replaced", record.etag, revision, record.counts)
    if known is None:
        raise AssertionError("a submap is written, or was there")
    return Receipt("unchanged", known.etag, known.revision, known.counts)
