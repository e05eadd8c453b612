"""Rows of segments: which files make the index of a collection."""

from collections.abc import Sequence
from datetime import UTC, datetime

from sqlalchemy import Connection, case, delete, insert, select, update

from server.store.columns import columns_of, values_of
from server.store.records import SegmentRecord, trusted
from server.store.tables import CollectionRow, DeletionRow, SegmentRow

_COLUMNS = columns_of(SegmentRecord, SegmentRow)


class AllSegments:
    """Reads the segments of every collection in a transaction of the caller."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def chains(self) -> dict[int, tuple[SegmentRecord, ...]]:
        """The segments of every collection that has any, by its key, as `SegmentReader.chain`; one query for all."""
        query = select(SegmentRow.collection_key, *_COLUMNS).order_by(SegmentRow.since, SegmentRow.key)
        chains: dict[int, tuple[SegmentRecord, ...]] = {}
        for key, *values in self._connection.execute(query):
            chains[key] = (*chains.get(key, ()), SegmentRecord(*values))
        return chains

    def names(self) -> set[str]:
        """Names of the segments of every collection."""
        return set(self._connection.scalars(select(SegmentRow.name)))


class SegmentReader:
    """Reads one collection's segments in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def chain(self) -> tuple[SegmentRecord, ...]:
        """All segments, the oldest first, whether or not they make a chain."""
        query = (
            select(*_COLUMNS)
            .where(SegmentRow.collection_key == self._collection_key)
            .order_by(SegmentRow.since, SegmentRow.key)
        )
        return tuple(SegmentRecord(*row) for row in self._connection.execute(query))


class Segments(SegmentReader):
    """Reads and writes one collection's segments in a transaction that the caller commits."""

    def exchange(self, old: Sequence[SegmentRecord], new: Sequence[SegmentRecord]) -> bool:
        """Put segments in the place of others and forget the deletions that no segment needs any more.

        False, and nothing is changed, where that would not make a chain that this collection can have: others changed
        it meanwhile, the collection is gone, or it was put back to before what the new ones hold.
        """
        revision = self._connection.scalar(
            select(CollectionRow.revision).where(CollectionRow.key == self._collection_key)
        )
        before = self.chain()
        gone = {segment.name for segment in old}
        after = sorted([s for s in before if s.name not in gone] + list(new), key=lambda s: (s.since, s.revision))
        if (
            revision is None
            or not gone <= {segment.name for segment in before}
            or trusted(after) < len(after)
            or any(segment.revision > revision for segment in new)
        ):
            return False
        self._delete(gone)
        if new:
            shared = {"collection_key": self._collection_key, "created": datetime.now(UTC)}
            self._connection.execute(insert(SegmentRow), [values_of(segment) | shared for segment in new])
        if after:
            self._prune(after[0].revision)
        return True

    def drop_from(self, name: str) -> int:
        """Forget a segment that cannot be used, and those after it; how many rows that were, 0 if it is not there."""
        chain = self.chain()
        places = [i for i, segment in enumerate(chain) if segment.name == name]
        gone = {segment.name for segment in chain[places[0] :]} if places else set[str]()
        self._delete(gone)
        return len(gone)

    def _delete(self, names: set[str]) -> None:
        self._connection.execute(
            delete(SegmentRow).where(SegmentRow.collection_key == self._collection_key, SegmentRow.name.in_(names))
        )

    def _prune(self, revision: int) -> None:
        # A submap deleted by then is in no segment: every one was made of rows that were read later.
        pruned = CollectionRow.pruned_revision
        gone = delete(DeletionRow).where(
            DeletionRow.collection_key == self._collection_key, DeletionRow.revision <= revision
        )
        self._connection.execute(gone)
        self._connection.execute(
            update(CollectionRow)
            .where(CollectionRow.key == self._collection_key)
            .values(pruned_revision=case((pruned < revision, revision), else_=pruned))
        )
