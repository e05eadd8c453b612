"""Features as they are stored, read for the index: what changed, what is gone, what a look-up asks for."""

from collections.abc import Collection, Iterator
from typing import Final

from sqlalchemy import Connection, bindparam, func, select

from server.store.columns import columns_of
from server.store.expressions import DirectStatement, batches, beside_key, listed
from server.store.submap_records import StoredFeatures
from server.store.tables import DeletionRow, SubmapRow

_STORED: Final = select(*columns_of(StoredFeatures, SubmapRow))
_PACKED: Final = DirectStatement(
    select(SubmapRow.key, SubmapRow.content_revision, SubmapRow.features).where(
        beside_key(bindparam("collection_key")), SubmapRow.key.in_(listed("keys"))
    )
)


class FeatureRows:
    """Reads what is indexed of one collection, in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def changed_since(self, revision: int, *, batch: int) -> Iterator[StoredFeatures]:
        """Features of the submaps whose landmarks changed after a revision, in the order of the change, streamed."""
        query = _STORED.where(SubmapRow.collection_key == self._collection_key, SubmapRow.content_revision > revision)
        query = query.order_by(SubmapRow.content_revision)
        for row in self._connection.execute(query.execution_options(yield_per=batch)):
            yield StoredFeatures(*row)

    def stored(self, keys: Collection[int]) -> Iterator[StoredFeatures]:
        """Features of those of the submaps that exist."""
        for some in batches(keys):
            query = _STORED.where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            for row in self._connection.execute(query):
                yield StoredFeatures(*row)

    def packed(self, keys: Collection[int]) -> list[tuple[int, int, bytes]]:
        """Key, content revision and packed features of those of the submaps that exist.

        A look-up reads some dozens in each of several goes: what a statement costs in itself counts here.
        """
        rows = _PACKED.rows(self._connection, collection_key=self._collection_key, keys=keys)
        return [(row[0], row[1], row[2]) for row in rows]

    def count_changed(self, revision: int, most: int) -> int:
        """How many submaps' landmarks changed after a revision; counted up to `most`."""
        changed = (
            select(SubmapRow.key)
            .where(SubmapRow.collection_key == self._collection_key, SubmapRow.content_revision > revision)
            .limit(most)
        )
        return self._connection.scalar(select(func.count()).select_from(changed.subquery())) or 0

    def content_revisions(self, revision: int, until: int | None = None) -> dict[int, int]:
        """Content revision, by key, of the submaps whose landmarks changed after a revision, and up to `until`."""
        query = select(SubmapRow.key, SubmapRow.content_revision).where(
            SubmapRow.collection_key == self._collection_key, SubmapRow.content_revision > revision
        )
        if until is not None:
            query = query.where(SubmapRow.content_revision <= until)
        return {row[0]: row[1] for row in self._connection.execute(query)}

    def deleted_since(self, revision: int) -> list[int]:
        """Keys of the submaps that were deleted after a revision, as far as that is not forgotten."""
        query = select(DeletionRow.submap_key).where(
            DeletionRow.collection_key == self._collection_key, DeletionRow.revision > revision
        )
        return list(self._connection.scalars(query))

    def last_deletion(self) -> int:
        """The revision of the last deletion that is not forgotten, 0 if there is none."""
        mine = DeletionRow.collection_key == self._collection_key
        return self._connection.scalar(select(func.max(DeletionRow.revision)).where(mine)) or 0

    def deleted_and_there(self) -> bool:
        """Whether a submap is noted as deleted and is there nevertheless, which cannot be."""
        query = select(DeletionRow.submap_key).where(
            DeletionRow.collection_key == self._collection_key, DeletionRow.submap_key.in_(select(SubmapRow.key))
        )
        return self._connection.scalar(query.limit(1)) is not None
