"""The stands of a collection: listed, read, removed."""

from server.collections.crud import get_collection
from server.errors import NotFound
from server.store.records import CountedStand
from server.store.storage import ReadTransaction, Storage


def listed(database: Storage, collection_id: str) -> list[CountedStand]:
    """All stands of a collection, in the order they were first stored. Raises NotFound."""
    with database.read() as tx:
        return tx.stands(get_collection(tx, collection_id).key).page()


def read(database: Storage, collection_id: str, name: str) -> CountedStand:
    """A stand. Raises NotFound."""
    with database.read() as tx:
        return get_stand(tx, collection_id, name)


def remove(database: Storage, collection_id: str, name: str) -> int:
    """Delete a stand with all its submaps, in one transaction; the number of submaps. Raises NotFound.

    Submaps that were taken out of the stand, because somebody stored others under their ids, stay.
    """
    with database.write() as tx:
        stand = get_stand(tx, collection_id, name)
        return tx.stands(get_collection(tx, collection_id).key).delete(stand.key)


def get_stand(tx: ReadTransaction, collection_id: str, name: str) -> CountedStand:
    """A stand of a collection. Raises NotFound if there is no such collection or stand."""
    stand = tx.stands(get_collection(tx, collection_id).key).counted(name)
    if stand is None:
        raise NotFound("stand", name)
    return stand
