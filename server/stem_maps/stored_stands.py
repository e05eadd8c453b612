"""The stands of a collection: listed, read, deleted."""

import re

from server.collections.crud import get_collection
from server.config.settings import Limits
from server.errors import NotFound
from server.resources import links
from server.resources.idempotency import NO_CONTENT, IdempotencyKey, StoredResponse, find_response, store_response
from server.resources.paging import page_size, read_cursor, write_cursor
from server.resources.preconditions import ANYTHING, Preconditions
from server.schemas.collections import Stand, StandLinks, StandPage
from server.schemas.common import to_json
from server.store.codec import digest
from server.store.records import CollectionRecord, CountedStand, FrameReference
from server.store.storage import ReadTransaction, Storage


def listed(database: Storage, collection_id: str) -> list[Stand]:
    """All stands of a collection, in the order they were first stored. Raises NotFound."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        return _answers(tx, collection, tx.stands(collection.key).page())


def page(database: Storage, limits: Limits, collection_id: str, limit: int | None, cursor: str | None) -> StandPage:
    """A page of a collection's stands, in the order they were first stored. Raises NotFound and InvalidField."""
    size = page_size(limit, limits)
    after = read_cursor("stands", cursor)
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        rows = tx.stands(collection.key).page(after_key=after, limit=size + 1)
        answers = _answers(tx, collection, rows[:size])
    return StandPage(stands=answers, next=write_cursor("stands", rows[size - 1].key) if len(rows) > size else None)


def read(database: Storage, collection_id: str, name: str) -> Stand:
    """A stand. Raises NotFound."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        return _answers(tx, collection, [_get(tx, collection, name)])[0]


def find(tx: ReadTransaction, collection: CollectionRecord, name: str) -> Stand | None:
    """A stand as it is stored now; None if there is none of this name."""
    row = tx.stands(collection.key).counted(name)
    return None if row is None else _answers(tx, collection, [row])[0]


def stored_whole(tx: ReadTransaction, collection: CollectionRecord, name: str) -> bool:
    """Whether a stand was stored with its file, or each of its plots, as one submap, and not cut into circles.

    Then its radius is its spacing, which may also be chosen for circles; but those are called by column and row.
    """
    stands = tx.stands(collection.key)
    row = stands.get(name)
    if row is None or row.radius != row.spacing:
        return False
    circle = re.compile(re.escape(name) + r"-[0-9]+-[0-9]+")
    return not any(circle.fullmatch(one) for one in stands.members(row.key))


def remove(database: Storage, collection_id: str, name: str) -> int:
    """Delete a stand with all its submaps, in one transaction; the number of submaps. Raises NotFound.

    Submaps that were taken out of the stand, because somebody stored others under their ids, stay.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        return tx.stands(collection.key).delete(_get(tx, collection, name).key)


def delete(
    database: Storage,
    collection_id: str,
    name: str,
    preconditions: Preconditions = ANYTHING,
    *,
    idempotency_key: IdempotencyKey | None = None,
) -> StoredResponse:
    """Delete a stand as `remove` does. Returns the answer.

    Raises NotFound, PreconditionFailed, KeyReused and StorageError.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"deleteStand {collection.key} {name}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        row = _get(tx, collection, name)
        preconditions.check(_answers(tx, collection, [row])[0].etag)
        tx.stands(collection.key).delete(row.key)
        return store_response(tx, idempotency_key, operation, NO_CONTENT)


def _get(tx: ReadTransaction, collection: CollectionRecord, name: str) -> CountedStand:
    row = tx.stands(collection.key).counted(name)
    if row is None:
        raise NotFound("stand", name)
    return row


def _answers(tx: ReadTransaction, collection: CollectionRecord, rows: list[CountedStand]) -> list[Stand]:
    references = tx.map_frames(collection).some([row.frame_id for row in rows])
    return [_answer(collection.id, row, references.get(row.frame_id)) for row in rows]


def _answer(collection_id: str, row: CountedStand, reference: FrameReference | None) -> Stand:
    answer = Stand(
        name=row.name,
        frame_id=row.frame_id,
        crs=None if reference is None else reference.crs,
        origin=None if reference is None else reference.origin,
        trees=row.tree_count,
        submaps=row.submap_count,
        radius=row.radius,
        spacing=row.spacing,
        source_hash=row.source_hash or None,
        source_crs=row.crs,
        trees_hash=row.trees_hash,
        created=row.created,
        updated=row.updated,
        etag="",
        links=StandLinks(self=links.stand(collection_id, row.name), collection=links.collection(collection_id)),
    )
    # Of all that is told: the time of the last write, the number of submaps, and where the map frame is.
    return answer.model_copy(update={"etag": digest(to_json(answer))})
