"""Rows of submaps, all seen through one collection: another collection's submap cannot be reached from here."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any, Final, TypeVar, cast

import orjson
from sqlalchemy import (
    ColumnElement,
    Connection,
    Row,
    Select,
    Table,
    bindparam,
    delete,
    func,
    insert,
    select,
    update,
)

from server.store.codec import members_of, unpack_attributes
from server.store.expressions import DirectStatement, Unindexed, batches, beside_key, listed
from server.store.submap_records import (
    Identity,
    Place,
    SubmapContent,
    SubmapFilter,
    SubmapMetadata,
    SubmapRecord,
    SubmapWhole,
)
from server.store.tables import DeletionRow, SubmapRow

_K = TypeVar("_K", bound=SubmapMetadata)
# Every write reads it twice: put together once.
_IDENTITIES = DirectStatement(
    select(*(SubmapRow.__table__.c[name] for name in ("id", *Identity.__slots__))).where(
        SubmapRow.__table__.c.collection_key == bindparam("collection_key"),
        SubmapRow.__table__.c.id.in_(listed("ids")),
    )
)
_COUNTS = Identity.__slots__.index("counts")
_STRETCH = 1000  # submaps that are looked at in order before a filter's own index is
_ROUNDING = 1e-9  # relative, and generous


class SubmapReader:
    """Reads one collection's submaps in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def get(self, submap_id: str, kind: type[_K]) -> _K | None:
        """The submap of that id, as a record of a kind; or None."""
        row = self._connection.execute(self._select(kind).where(SubmapRow.id == submap_id)).one_or_none()
        return None if row is None else _record(kind, row)

    def every(self, kind: type[_K], batch: int = 200) -> Iterator[_K]:
        """All submaps in the order they were added, as records of a kind, of which `batch` are read at once."""
        query = self._select(kind).order_by(SubmapRow.key).execution_options(yield_per=batch)
        return (_record(kind, row) for row in self._connection.execute(query))

    def totals(self) -> tuple[int, int, int]:
        """How many submaps there are, and their landmarks and polygons."""
        sums = (func.sum(SubmapRow.landmark_count), func.sum(SubmapRow.polygon_count))
        mine = SubmapRow.collection_key == self._collection_key
        row = self._connection.execute(select(func.count(), *sums).where(mine)).one()
        return row[0], row[1] or 0, row[2] or 0

    def identities(self, ids: Collection[str]) -> dict[str, Identity]:
        """Identities of those of the ids that exist."""
        rows = _IDENTITIES.rows(self._connection, collection_key=self._collection_key, ids=ids)
        return {submap_id: _identity(values) for submap_id, *values in rows}

    def members(self, key: int) -> frozenset[str]:
        """The optional members that a submap has, by their names in the API."""
        columns = (
            SubmapRow.frame_id,
            SubmapRow.session,
            SubmapRow.stamp,
            SubmapRow.map_frame_id,
            SubmapRow.properties,
            SubmapRow.landmark_ids,
            SubmapRow.attributes,
        )
        query = select(*columns).where(SubmapRow.collection_key == self._collection_key, SubmapRow.key == key)
        *members, attributes = self._connection.execute(query).one()
        return members_of(*members) | unpack_attributes(attributes).keys()

    def changed_since(self, revision: int, most: int) -> list[int]:
        """Keys of up to `most` submaps whose landmarks changed after a revision, those that changed first."""
        query = self._keys().where(SubmapRow.content_revision > revision).order_by(SubmapRow.content_revision)
        return list(self._connection.scalars(query.limit(most)))

    def keys(self, ids: Collection[str]) -> dict[str, int]:
        """Keys of those of the ids that exist."""
        found: dict[str, int] = {}
        for some in batches(ids):
            query = select(SubmapRow.id, SubmapRow.key).where(
                SubmapRow.collection_key == self._collection_key, SubmapRow.id.in_(some)
            )
            found.update({row.id: row.key for row in self._connection.execute(query)})
        return found

    def ids(self, keys: Collection[int]) -> dict[int, str]:
        """Ids of submaps by key."""
        found: dict[int, str] = {}
        for some in batches(keys):
            query = select(SubmapRow.key, SubmapRow.id).where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            found.update({row.key: row.id for row in self._connection.execute(query)})
        return found

    def some(self, keys: Collection[int], kind: type[_K]) -> list[_K]:
        """Those of the submaps that exist, as records of a kind, in the order of the keys."""
        found: list[_K] = []
        for part in batches(sorted(keys)):
            query = _SELECTS[kind].where(beside_key(self._collection_key), SubmapRow.key.in_(part))
            found += (_record(kind, row) for row in self._connection.execute(query.order_by(SubmapRow.key)))
        return found

    def page(self, chosen: SubmapFilter, kind: type[_K], *, after_key: int = 0, limit: int) -> list[_K]:
        """Up to `limit` submaps in the order they were added, beginning after a key, as records of a kind."""
        if chosen == SubmapFilter():
            query = self._select(kind).where(SubmapRow.key > after_key).order_by(SubmapRow.key).limit(limit)
            return [_record(kind, row) for row in self._connection.execute(query)]
        return self.some(self._page_keys(chosen, after_key, limit), kind)

    def matching(self, chosen: SubmapFilter, among: Sequence[int] | None = None) -> set[int]:
        """Keys of the submaps that are chosen, of all or `among` a few hundred at most."""
        conditions = self._conditions(chosen)
        if among is not None:
            of_these = select(SubmapRow.key).where(beside_key(self._collection_key), SubmapRow.key.in_(among))
            return set(self._connection.scalars(of_these.where(*conditions)))
        return set(self._connection.scalars(self._keys().where(*conditions)))

    def _page_keys(self, chosen: SubmapFilter, after_key: int, limit: int) -> list[int]:
        """Keys of a page. No index has both the filter and the order, and each way alone can be slow.

        Where many submaps are chosen, walking on in order soon fills the page, so a stretch of that is tried first.
        Where few are, all of them are taken from the filter's own index and sorted. A session is taken to be few.
        """
        conditions = self._conditions(chosen)
        if chosen.session is None:
            ahead = self._keys().where(SubmapRow.key > after_key).order_by(SubmapRow.key).limit(_STRETCH).subquery()
            walk = select(SubmapRow.key).where(beside_key(self._collection_key), *conditions)
            walk = walk.where(SubmapRow.key.in_(select(ahead.c.key))).order_by(SubmapRow.key).limit(limit)
            keys = list(self._connection.scalars(walk))
            if len(keys) == limit:
                return keys
        # Else SQLite walks through all of the collection in order.
        key = Unindexed(SubmapRow.key)
        return list(
            self._connection.scalars(self._keys().where(*conditions, key > after_key).order_by(key).limit(limit))
        )

    def _conditions(self, chosen: SubmapFilter) -> list[ColumnElement[bool]]:
        conditions = _conditions_of(chosen)
        if chosen.bbox is not None and chosen.map_frame_id is not None:
            of_frame = (SubmapRow.collection_key == self._collection_key, SubmapRow.map_frame_id == chosen.map_frame_id)
            widest = self._connection.scalar(select(func.max(SubmapRow.map_width)).where(*of_frame)) or 0.0
            # What the rest implies, with room for what rounding takes away: it ends the search in the index early.
            reach = widest * (1.0 + _ROUNDING) + abs(chosen.bbox[0]) * _ROUNDING
            conditions.append(SubmapRow.map_min_x >= chosen.bbox[0] - reach)
        return conditions

    def _keys(self) -> Select[int]:
        return select(SubmapRow.key).where(SubmapRow.collection_key == self._collection_key)

    def _select(self, kind: type[_K]) -> Select[Any]:
        return _SELECTS[kind].where(SubmapRow.collection_key == self._collection_key)


class Submaps(SubmapReader):
    """Reads and writes one collection's submaps in a transaction that the caller commits."""

    def insert(self, records: Sequence[SubmapRecord], revision: int) -> None:
        """Add submaps that are not there yet."""
        now = datetime.now(UTC)
        shared = {
            "collection_key": self._collection_key,
            "revision": revision,
            "content_revision": revision,
            "created": now,
            "updated": now,
        }
        if records:
            self._connection.execute(insert(SubmapRow), [record.columns() | shared for record in records])

    def replace(self, records: Sequence[tuple[int, SubmapRecord]], revision: int) -> None:
        """Put other content in the place of submaps', each given by its key, which stays."""
        now = datetime.now(UTC)
        kept, new = list[dict[str, Any]](), list[dict[str, Any]]()
        for key, record in records:
            values = record.columns() | {"revision": revision, "updated": now, "_key": key}
            if record.features is None:
                # The same positions: moving a submap in the map is not to write them all again.
                del values["features"], values["landmarks"]
                kept.append(values)
            else:
                new.append(values | {"content_revision": revision})
        table = cast(Table, SubmapRow.__table__)
        mine = (table.c.collection_key == self._collection_key, table.c.key == bindparam("_key"))
        for rows in (kept, new):
            if rows:
                # One statement for all: to put one together takes longer than to run it.
                self._connection.execute(update(table).where(*mine), rows)

    def delete(self, key: int, revision: int) -> None:
        """Remove a submap and note for the live indexes that it is gone."""
        gone = {"submap_key": key, "collection_key": self._collection_key, "revision": revision}
        self._connection.execute(insert(DeletionRow).values(gone))
        self._connection.execute(
            delete(SubmapRow).where(SubmapRow.collection_key == self._collection_key, SubmapRow.key == key)
        )


_PLACE = tuple(one.name for one in fields(Place))
_NAMES: Final[dict[type[SubmapMetadata], list[str]]] = {
    kind: [one.name for one in fields(kind) if one.name != "place"]
    for kind in (SubmapMetadata, SubmapContent, SubmapWhole)
}
_SELECTS: Final = {
    kind: select(*(getattr(SubmapRow, name) for name in (*_PLACE, *names))) for kind, names in _NAMES.items()
}
"""What is read of a submap, put together once for each kind of record."""


def _record(kind: type[_K], row: Row[Any]) -> _K:
    place = None if row[0] is None else Place(*row[: len(_PLACE)])
    return kind(**dict(zip(_NAMES[kind], row[len(_PLACE) :], strict=True)), place=place)


def _conditions_of(chosen: SubmapFilter) -> list[ColumnElement[bool]]:
    """A filter as conditions on rows of submaps."""
    conditions: list[ColumnElement[bool]] = []
    if chosen.session is not None:
        conditions.append(SubmapRow.session == chosen.session)
    if chosen.map_frame_id is not None:
        conditions.append(SubmapRow.map_frame_id == chosen.map_frame_id)
    if chosen.bbox is not None:
        min_x, min_y, max_x, max_y = chosen.bbox
        conditions += [
            SubmapRow.map_min_x <= max_x,
            SubmapRow.map_max_x >= min_x,
            SubmapRow.map_min_y <= max_y,
            SubmapRow.map_max_y >= min_y,
        ]
    if chosen.since is not None:
        conditions.append(SubmapRow.stamp >= chosen.since)
    if chosen.until is not None:
        conditions.append(SubmapRow.stamp <= chosen.until)
    return conditions


def _identity(values: list[Any]) -> Identity:
    """The record of a row as the driver has it."""
    values[_COUNTS] = orjson.loads(values[_COUNTS])
    return Identity(*values)
