"""Rows of collections. The revision only moves here, in the transaction of the write that moves it."""

from collections.abc import Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any, cast

import orjson
from sqlalchemy import Connection, Table, bindparam, delete, func, insert, literal_column, select, update

from server.store.columns import columns_of
from server.store.expressions import DirectStatement, batches, matches
from server.store.instants import read_instant, write_instant
from server.store.records import CollectionRecord, CollectionSize, FrameExtent, StandTotals
from server.store.tables import CollectionRow, MapFrameRow, StandRow, SubmapRow

# Every request begins with it: put together once.
_COLUMNS = columns_of(CollectionRecord, CollectionRow)
_ALL = select(*_COLUMNS)
_BY_ID = DirectStatement(
    select(*(CollectionRow.__table__.c[one.name] for one in fields(CollectionRecord))).where(
        CollectionRow.__table__.c.id == bindparam("id")
    )
)
# As every write does with it.
_TABLE = cast(Table, CollectionRow.__table__)
_ADVANCE = DirectStatement(
    update(_TABLE)
    .where(_TABLE.c.key == bindparam("of"))
    .values(
        revision=_TABLE.c.revision + literal_column("1"),
        submap_count=_TABLE.c.submap_count + bindparam("submaps"),
        landmark_count=_TABLE.c.landmark_count + bindparam("landmarks"),
        polygon_count=_TABLE.c.polygon_count + bindparam("polygons"),
        updated=bindparam("moment"),
    )
    .returning(_TABLE.c.revision)
)
_CONFIG, _MOMENTS = (
    [number for number, one in enumerate(fields(CollectionRecord)) if one.name in names]
    for names in (("config",), ("created", "updated"))
)


class CollectionReader:
    """Reads collections in a transaction of the caller."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def get(self, collection_id: str) -> CollectionRecord | None:
        """The collection of that id, or None."""
        for row in _BY_ID.rows(self._connection, id=collection_id):
            return _record(row)
        return None

    def all(self) -> list[CollectionRecord]:
        """All collections, in the order they were made."""
        return [CollectionRecord(*row) for row in self._connection.execute(_ALL.order_by(CollectionRow.key))]

    def page(self, patterns: Sequence[str], *, after_key: int = 0, limit: int) -> list[CollectionRecord]:
        """Up to `limit` collections whose ids match a pattern, in the order they were made, beginning after a key."""
        query = _ALL.where(CollectionRow.key > after_key).order_by(CollectionRow.key).limit(limit)
        if "*" not in patterns:
            query = query.where(matches(CollectionRow.id, patterns))
        return [CollectionRecord(*row) for row in self._connection.execute(query)]

    def ids(self) -> list[str]:
        """Ids of all collections."""
        return list(self._connection.scalars(select(CollectionRow.id).order_by(CollectionRow.key)))

    def revisions(self, least: int = 0) -> list[tuple[int, str, int]]:
        """Key, id and revision of all collections, or of those that are at `least` one: 1 where anything was stored."""
        columns = (CollectionRow.key, CollectionRow.id, CollectionRow.revision)
        query = select(*columns).where(CollectionRow.revision >= least).order_by(CollectionRow.key)
        return [(row.key, row.id, row.revision) for row in self._connection.execute(query)]

    def largest(self, limit: int) -> list[CollectionSize]:
        """Up to `limit` collections with the most submaps, the largest first."""
        columns = (CollectionRow.id, CollectionRow.submap_count, CollectionRow.landmark_count, CollectionRow.revision)
        order = (CollectionRow.submap_count.desc(), CollectionRow.key)
        return [
            CollectionSize(*row) for row in self._connection.execute(select(*columns).order_by(*order).limit(limit))
        ]

    def totals(self) -> tuple[int, int, int]:
        """How many collections there are, and the submaps and landmarks in all of them."""
        submaps, landmarks = func.sum(CollectionRow.submap_count), func.sum(CollectionRow.landmark_count)
        counted = self._connection.execute(select(func.count(), submaps, landmarks).select_from(CollectionRow)).one()
        return counted[0], counted[1] or 0, counted[2] or 0

    def contents(self) -> list[tuple[str, int, int]]:
        """Id, revision and number of submaps of all collections, oldest first."""
        query = select(CollectionRow.id, CollectionRow.revision, CollectionRow.submap_count)
        return [(row[0], row[1], row[2]) for row in self._connection.execute(query.order_by(CollectionRow.key))]

    def stand_totals(self, collections: Sequence[CollectionRecord]) -> dict[int, StandTotals]:
        """What the stands of each of some collections are together, by the collections' keys."""
        stands = {one.key: (0, 0) for one in collections}
        systems = {one.key: set() if one.crs is None else {one.crs} for one in collections}
        for some in batches(sorted(stands)):
            key, frame = StandRow.collection_key, MapFrameRow.collection_key
            counted = select(key, StandRow.crs, func.count(), func.sum(StandRow.tree_count)).where(key.in_(some))
            for of, crs, count, trees in self._connection.execute(counted.group_by(key, StandRow.crs)):
                stands[of] = (stands[of][0] + count, stands[of][1] + trees)
                systems[of] |= set() if crs is None else {crs}
            named = select(frame, MapFrameRow.crs).where(frame.in_(some)).distinct()
            for of, crs in self._connection.execute(named):
                systems[of].add(crs)
        return {of: StandTotals(*stands[of], tuple(sorted(systems[of]))) for of in stands}

    def extents(self, key: int) -> list[FrameExtent]:
        """What the collection's submaps cover, a map frame each, from the footprint index alone."""
        query = (
            select(
                SubmapRow.map_frame_id,
                func.min(SubmapRow.map_min_x),
                func.min(SubmapRow.map_min_y),
                func.max(SubmapRow.map_max_x),
                func.max(SubmapRow.map_max_y),
            )
            .where(SubmapRow.collection_key == key, SubmapRow.map_frame_id.is_not(None))
            .group_by(SubmapRow.map_frame_id)
        )
        return [
            FrameExtent(frame_id, min_x, min_y, max_x, max_y)
            for frame_id, min_x, min_y, max_x, max_y in self._connection.execute(query)
            if frame_id is not None
            and min_x is not None
            and min_y is not None
            and max_x is not None
            and max_y is not None
        ]

    def interval(self, key: int) -> tuple[datetime, datetime] | None:
        """The first and the last stamp of the collection's submaps, by two seeks in the stamp index."""
        stamped = select(SubmapRow.stamp).where(SubmapRow.collection_key == key, SubmapRow.stamp.is_not(None)).limit(1)
        first = self._connection.scalar(stamped.order_by(SubmapRow.stamp))
        last = self._connection.scalar(stamped.order_by(SubmapRow.stamp.desc()))
        return None if first is None or last is None else (first, last)


class Collections(CollectionReader):
    """Reads and writes collections in a transaction that the caller commits."""

    def create(
        self,
        collection_id: str,
        *,
        title: str | None,
        config: dict[str, Any],
        fingerprint: str,
        crs: str | None,
        origin: tuple[float, float] | None,
    ) -> CollectionRecord:
        """Add an empty collection at revision 0."""
        now = datetime.now(UTC)
        zero = ("revision", "submap_count", "landmark_count", "polygon_count", "query_sequence", "pruned_revision")
        values = {
            "id": collection_id,
            "title": title,
            "config": config,
            "fingerprint": fingerprint,
            "crs": crs,
            "origin_x": origin[0] if origin else None,
            "origin_y": origin[1] if origin else None,
            "created": now,
            "updated": now,
        }
        added = insert(CollectionRow).values(values | dict.fromkeys(zero, 0)).returning(*_COLUMNS)
        return CollectionRecord(*self._connection.execute(added).one())

    def describe(self, record: CollectionRecord) -> None:
        """Store title, crs and origin of a record; the revision stays."""
        values = {name: getattr(record, name) for name in ("title", "crs", "origin_x", "origin_y")}
        self._connection.execute(update(CollectionRow).where(CollectionRow.key == record.key).values(values))

    def advance(self, key: int, *, submaps: int = 0, landmarks: int = 0, polygons: int = 0) -> int:
        """Move the revision on by one and the counts by what is given; the new revision."""
        more = {"submaps": submaps, "landmarks": landmarks, "polygons": polygons}
        ((revision,),) = _ADVANCE.rows(self._connection, of=key, moment=write_instant(datetime.now(UTC)), **more)
        return int(revision)

    def next_query_number(self, key: int) -> int:
        """Take the next number for a stored query."""
        statement = (
            update(CollectionRow)
            .where(CollectionRow.key == key)
            .values(query_sequence=CollectionRow.query_sequence + 1)
            .returning(CollectionRow.query_sequence)
        )
        return self._connection.scalars(statement).one()

    def delete(self, key: int) -> None:
        """Remove a collection with everything in it."""
        self._connection.execute(delete(CollectionRow).where(CollectionRow.key == key))


def _record(row: Sequence[Any]) -> CollectionRecord:
    """The record of a row as the driver has it."""
    values = list(row)
    for number in _CONFIG:
        values[number] = orjson.loads(values[number])
    for number in _MOMENTS:
        values[number] = read_instant(values[number])
    return CollectionRecord(*values)
