"""Sessions as a whole: all submaps of one drive deleted in one transaction."""

from server.collections.crud import get_collection
from server.errors import NotFound
from server.resources.idempotency import NO_CONTENT, IdempotencyKey, StoredResponse, find_response, store_response
from server.store.storage import Storage
from server.store.submap_records import SubmapFilter


def delete_session(
    database: Storage, collection_id: str, session: str, idempotency_key: IdempotencyKey | None = None
) -> StoredResponse:
    """Delete all submaps of a session, under one new revision. Returns the answer.

    Raises NotFound (the collection, or no submap is of the session), KeyReused and StorageError.
    """
    with database.write() as tx:
        collection = get_collection(tx, collection_id)
        operation = f"deleteSession {collection.key} {session}"
        response = find_response(tx, idempotency_key, operation)
        if response is not None:
            return response
        keys = tx.submaps(collection.key).matching(SubmapFilter(session=session))
        if not keys:
            raise NotFound("session", session)
        tx.stands(collection.key).remove(keys)
        return store_response(tx, idempotency_key, operation, NO_CONTENT)
