"""Rows of submaps, all seen through one collection: another collection's submap cannot be reached from here."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar, cast

from sqlalchemy import (
    ColumnElement,
    Integer,
    Select,
    Table,
    bindparam,
    delete,
    func,
    insert,
    literal_column,
    select,
    update,
)
from sqlalchemy.orm import Session, undefer

from server.store.codec import members_of, unpack_attributes
from server.store.submap_filter import SubmapFilter, conditions_of
from server.store.tables import DeletionRow, SubmapRow, beside_key

_T = TypeVar("_T")
_VARIABLES = 500  # ids per statement, well below SQLite's limit on bound values
_STRETCH = 1000  # submaps that are looked at in order before a filter's own index is
_ROUNDING = 1e-9  # relative, and generous


@dataclass(frozen=True, slots=True)
class Place:
    """A submap's pose in a map and its footprint there, metres and radians."""

    map_frame_id: str
    map_x: float
    map_y: float
    map_yaw: float
    map_covariance: list[float] | None
    map_min_x: float
    map_min_y: float
    map_max_x: float
    map_max_y: float


def stored_place(row: SubmapRow) -> Place | None:
    """The place in a row, None when it has none."""
    values = [getattr(row, name) for name in Place.__slots__]
    return None if row.map_frame_id is None else Place(*values)


_NO_PLACE: dict[str, Any] = dict.fromkeys(Place.__slots__)


@dataclass(frozen=True, slots=True)
class SubmapRecord:
    """A submap as it is to be stored; the blobs are little-endian float64 (N, 2), JSON, JSON and packed features.

    `features` is None where landmarks and diameters, and with them the features, are those that are stored already.
    `stand_key` names the stand that stores it, None for a submap that belongs to none.
    """

    id: str
    frame_id: str | None
    session: str | None
    stamp: datetime | None
    landmark_count: int
    polygon_count: int
    counts: dict[str, int]
    place: Place | None
    properties: dict[str, Any] | None
    landmarks_hash: str
    etag: str
    landmarks: bytes
    landmark_ids: bytes | None
    attributes: bytes | None
    features: bytes | None
    stand_key: int | None = None

    def members(self) -> frozenset[str]:
        """The optional members that it has, by their names in the API."""
        return members_of(self.frame_id, self.session, self.stamp, self.place, self.properties, self.landmark_ids) | (
            unpack_attributes(self.attributes).keys()
        )

    def columns(self) -> dict[str, Any]:
        """Values by column name."""
        values = {name: getattr(self, name) for name in self.__slots__ if name != "place"}
        return values | (asdict(self.place) if self.place is not None else _NO_PLACE)


@dataclass(frozen=True, slots=True)
class Identity:
    """What a write has to know about the submap it may replace."""

    key: int
    etag: str
    landmarks_hash: str
    landmark_count: int
    polygon_count: int
    revision: int
    counts: dict[str, int]
    attributes: bytes | None


class Submaps:
    """Repository of one collection's submaps; the session is the caller's, and so is the commit."""

    def __init__(self, session: Session, collection_key: int) -> None:
        self._session = session
        self._collection_key = collection_key

    def get_whole(self, submap_id: str, *, features: bool = False) -> SubmapRow | None:
        """The submap with its landmarks, and with its features if asked; or None."""
        query = self._all().where(SubmapRow.id == submap_id).options(*_LANDMARKS)
        return self._session.scalar(query.options(undefer(SubmapRow.features)) if features else query)

    def identities(self, ids: Collection[str]) -> dict[str, Identity]:
        """Identities of those of the ids that exist."""
        columns = (
            SubmapRow.id,
            SubmapRow.key,
            SubmapRow.etag,
            SubmapRow.landmarks_hash,
            SubmapRow.landmark_count,
            SubmapRow.polygon_count,
            SubmapRow.revision,
            SubmapRow.counts,
            SubmapRow.attributes,
        )
        found: dict[str, Identity] = {}
        for some in _batches(list(ids)):
            query = select(*columns).where(SubmapRow.collection_key == self._collection_key, SubmapRow.id.in_(some))
            found.update({row[0]: Identity(*row[1:]) for row in self._session.execute(query)})
        return found

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
        *members, attributes = self._session.execute(query).one()
        return members_of(*members) | unpack_attributes(attributes).keys()

    def changed_since(self, revision: int, most: int) -> list[int]:
        """Keys of up to `most` submaps whose landmarks changed after a revision, those that changed first."""
        query = self._keys().where(SubmapRow.content_revision > revision).order_by(SubmapRow.content_revision)
        return list(self._session.scalars(query.limit(most)))

    def keys(self, ids: Collection[str]) -> dict[str, int]:
        """Keys of those of the ids that exist."""
        found: dict[str, int] = {}
        for some in _batches(list(ids)):
            query = select(SubmapRow.id, SubmapRow.key).where(
                SubmapRow.collection_key == self._collection_key, SubmapRow.id.in_(some)
            )
            found.update({row.id: row.key for row in self._session.execute(query)})
        return found

    def ids(self, keys: Collection[int]) -> dict[int, str]:
        """Ids of submaps by key."""
        found: dict[int, str] = {}
        for some in _batches(list(keys)):
            query = select(SubmapRow.key, SubmapRow.id).where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            found.update({row.key: row.id for row in self._session.execute(query)})
        return found

    def rows(self, keys: Collection[int]) -> list[SubmapRow]:
        """Rows of submaps by key, without their landmarks, in the order of the keys."""
        found: list[SubmapRow] = []
        for some in _batches(sorted(keys)):
            query = select(SubmapRow).where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            found += self._session.scalars(query.order_by(SubmapRow.key))
        return found

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
            self._session.execute(insert(SubmapRow), [record.columns() | shared for record in records])

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
                self._session.connection().execute(update(table).where(*mine), rows)

    def delete(self, key: int, revision: int) -> None:
        """Remove a submap and note for the live indexes that it is gone."""
        self._session.add(DeletionRow(submap_key=key, collection_key=self._collection_key, revision=revision))
        self._session.execute(
            delete(SubmapRow).where(SubmapRow.collection_key == self._collection_key, SubmapRow.key == key),
            execution_options={"synchronize_session": False},
        )

    def page(self, chosen: SubmapFilter, *, after_key: int = 0, limit: int, landmarks: bool) -> Sequence[SubmapRow]:
        """Up to `limit` submaps in the order they were added, beginning after a key."""
        options = _LANDMARKS if landmarks else ()
        if chosen == SubmapFilter():
            query = self._all().where(SubmapRow.key > after_key).order_by(SubmapRow.key).limit(limit)
            return self._session.scalars(query.options(*options)).all()
        rows: list[SubmapRow] = []
        for some in _batches(self._page_keys(chosen, after_key, limit)):
            of_keys = select(SubmapRow).where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            rows += self._session.scalars(of_keys.order_by(SubmapRow.key).options(*options))
        return rows

    def matching(self, chosen: SubmapFilter, among: Sequence[int] | None = None) -> set[int]:
        """Keys of the submaps that are chosen, of all or `among` a few hundred at most."""
        conditions = self._conditions(chosen)
        if among is not None:
            of_these = select(SubmapRow.key).where(beside_key(self._collection_key), SubmapRow.key.in_(among))
            return set(self._session.scalars(of_these.where(*conditions)))
        return set(self._session.scalars(self._keys().where(*conditions)))

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
            keys = list(self._session.scalars(walk))
            if len(keys) == limit:
                return keys
        # The plus keeps SQLite from walking through all of the collection in order.
        key = literal_column("+submaps.key", Integer)
        return list(self._session.scalars(self._keys().where(*conditions, key > after_key).order_by(key).limit(limit)))

    def _conditions(self, chosen: SubmapFilter) -> list[ColumnElement[bool]]:
        conditions = conditions_of(chosen)
        if chosen.bbox is not None and chosen.map_frame_id is not None:
            of_frame = (SubmapRow.collection_key == self._collection_key, SubmapRow.map_frame_id == chosen.map_frame_id)
            widest = self._session.scalar(select(func.max(SubmapRow.map_width)).where(*of_frame)) or 0.0
            # What the rest implies, with room for what rounding takes away: it ends the search in the index early.
            reach = widest * (1.0 + _ROUNDING) + abs(chosen.bbox[0]) * _ROUNDING
            conditions.append(SubmapRow.map_min_x >= chosen.bbox[0] - reach)
        return conditions

    def _keys(self) -> Select[int]:
        return select(SubmapRow.key).where(SubmapRow.collection_key == self._collection_key)

    def _all(self) -> Select[SubmapRow]:
        return select(SubmapRow).where(SubmapRow.collection_key == self._collection_key)


_LANDMARKS = (undefer(SubmapRow.landmarks), undefer(SubmapRow.landmark_ids), undefer(SubmapRow.attributes))


def _batches(items: list[_T]) -> Iterator[list[_T]]:
    for start in range(0, len(items), _VARIABLES):
        yield items[start : start + _VARIABLES]
