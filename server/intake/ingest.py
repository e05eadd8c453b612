"""Submaps in: validated, described, stored. Idempotent by content.

Describing takes milliseconds and needs no database, so it is done before the write transaction begins; the transaction
looks again at what is there and at the preconditions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from sqlalchemy.orm import Session

from server import geo
from server.errors import Conflict, NotFound
from server.idempotency import Kept, Once, keep, recall
from server.index.derive import config_of
from server.intake.prepare import Prepared, check_properties, place_from, row_etag, settle
from server.preconditions import ANYTHING, Preconditions
from server.registry import get_collection
from server.schemas.submaps import SubmapInput, SubmapPatch
from server.settings import Limits
from server.store.codec import unpack_positions
from server.store.collections import Collections
from server.store.database import Database
from server.store.frames import Frames
from server.store.submaps import Identity, Place, SubmapRecord, Submaps, stored_place
from server.store.tables import CollectionRow
from server.threads import pin_threads

Outcome = Literal["created", "replaced", "unchanged"]


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of a submap."""

    outcome: Outcome
    etag: str
    revision: int
    counts: dict[str, int]


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
        check_place(session, collection, prepared.place)
        known = Submaps(session, collection.key).identities([submap_id]).get(submap_id)
    preconditions.check(known.etag if known else None)
    if known is not None and known.etag == prepared.etag:
        return Receipt("unchanged", known.etag, known.revision, known.counts)
    config = config_of(collection)
    if not prepared.has_features(known):
        prepared.describe(config)
    with database.write() as session:
        collection = same_collection(session, collection_id, collection.key)
        known = Submaps(session, collection.key).identities([submap_id]).get(submap_id)
        preconditions.check(known.etag if known else None)
        return store(session, collection, [(known, prepared.record(known, config))])[0]


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
        check_place(session, collection, prepared.place)
    config = config_of(collection)
    prepared.describe(config)
    with database.write() as session:
        collection = same_collection(session, collection_id, collection.key)
        kept = recall(session, once, _posting(collection))
        if kept is not None:
            return kept
        receipt = store(session, collection, [(None, prepared.record(None, config))])[0]
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
        if "map_pose" in given:
            check_place(session, collection, place)
        properties = body.properties if "properties" in given else row.properties
        etag = row_etag(row, place, properties)
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


def check_place(session: Session, collection: CollectionRow, place: Place | None) -> None:
    """Raise InvalidField when the pose in the map is where the map frame's CRS does not reach."""
    if place is not None:
        geo.check_place(place, Frames(session, collection).some([place.map_frame_id]).get(place.map_frame_id))


def same_collection(session: Session, collection_id: str, key: int) -> CollectionRow:
    """The collection, as long as it is the one of that key. Raises NotFound and Conflict."""
    now = get_collection(session, collection_id)
    if now.key != key:
        raise Conflict(f"The collection {collection_id!r} was deleted and made again meanwhile; send the submap again.")
    return now


def store(
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
        submaps.replace([(known.key, record) for known, record in changes if known is not None], revision)
    written = {record.id: record for _, record in changes}
    return [_receipt(known, written.get(new.id), revision) for known, new in pairs]


def _receipt(known: Identity | None, record: SubmapRecord | None, revision: int) -> Receipt:
    if record is not None:
        return Receipt("created" if known is None else "replaced", record.etag, revision, record.counts)
    if known is None:
        raise AssertionError("a submap is written, or was there")
    return Receipt("unchanged", known.etag, known.revision, known.counts)
