"""Rows of stands, and the submaps that each of them stored, all seen through one collection."""

import re
from collections.abc import Collection
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Select, delete, func, insert, literal, select, update

from server.store.columns import columns_of, values_of
from server.store.expressions import batches, beside_key
from server.store.records import CountedStand, StandRecord, StoredStand
from server.store.repositories.collections import Collections
from server.store.tables import DeletionRow, StandRow, SubmapRow


class StandReader:
    """Reads one collection's stands in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def get(self, name: str) -> StoredStand | None:
        """The stand of that name, or None."""
        named = (StandRow.collection_key == self._collection_key, StandRow.name == name)
        row = self._connection.execute(select(*columns_of(StoredStand, StandRow)).where(*named)).one_or_none()
        return None if row is None else StoredStand(*row)

    def counted(self, name: str) -> CountedStand | None:
        """The stand of that name with the number of its submaps, or None."""
        row = self._connection.execute(self._counted().where(StandRow.name == name)).one_or_none()
        return None if row is None else CountedStand(*row)

    def page(self, *, after_key: int = 0, limit: int | None = None) -> list[CountedStand]:
        """Up to `limit` stands (None: all) in the order they were first stored, beginning after a key."""
        query = self._counted().where(StandRow.key > after_key).order_by(StandRow.key).limit(limit)
        return [CountedStand(*row) for row in self._connection.execute(query)]

    def _counted(self) -> Select[Any]:
        mine = (SubmapRow.collection_key == StandRow.collection_key, SubmapRow.stand_key == StandRow.key)
        submap_count = select(func.count()).where(*mine).scalar_subquery()
        columns = (*columns_of(StoredStand, StandRow), submap_count)
        return select(*columns).where(StandRow.collection_key == self._collection_key)

    def with_trees(self, trees_hash: str) -> list[str]:
        """Names of the stands whose trees stand at exactly these positions, in the order they were stored."""
        same = select(StandRow.name).where(
            StandRow.collection_key == self._collection_key, StandRow.trees_hash == trees_hash
        )
        return list(self._connection.scalars(same.order_by(StandRow.key)))

    def members(self, stand_key: int) -> dict[str, int]:
        """Keys of the submaps that the stand stored, by id."""
        query = select(SubmapRow.id, SubmapRow.key).where(
            SubmapRow.collection_key == self._collection_key, SubmapRow.stand_key == stand_key
        )
        return {row.id: row.key for row in self._connection.execute(query)}

    def strays(self, name: str, frame_id: str) -> dict[str, int]:
        """Keys, by id, of submaps that look exactly like discs of the stand and belong to no stand.

        Versions that knew no stands stored discs like these, and so does a caller who sends discs over HTTP.
        """
        query = select(SubmapRow.id, SubmapRow.key).where(
            SubmapRow.collection_key == self._collection_key,
            SubmapRow.map_frame_id == frame_id,
            SubmapRow.map_yaw == 0.0,
            SubmapRow.frame_id == SubmapRow.id,
            SubmapRow.stand_key.is_(None),
        )
        disc = re.compile(re.escape(name) + r"-[0-9]+-[0-9]+")
        return {row.id: row.key for row in self._connection.execute(query) if disc.fullmatch(row.id)}


class Stands(StandReader):
    """Reads and writes one collection's stands in a transaction that the caller commits."""

    def put(self, record: StandRecord) -> int:
        """Write the stand's row, new or in the place of the one of its name; its key, which stays."""
        there = self.get(record.name)
        values = values_of(record) | {"updated": (now := datetime.now(UTC))}
        if there is not None:
            self._connection.execute(update(StandRow).where(StandRow.key == there.key).values(values))
            return there.key
        values |= {"collection_key": self._collection_key, "created": now}
        return self._connection.scalars(insert(StandRow).values(values).returning(StandRow.key)).one()

    def touch(self, stand_key: int) -> None:
        """Note that the stand was changed now."""
        mine = (StandRow.collection_key == self._collection_key, StandRow.key == stand_key)
        self._connection.execute(update(StandRow).where(*mine).values(updated=datetime.now(UTC)))

    def adopt(self, stand_key: int, keys: Collection[int]) -> None:
        """Note that submaps belong to the stand; nothing else of them changes."""
        for some in batches(sorted(keys)):
            of_keys = update(SubmapRow).where(beside_key(self._collection_key), SubmapRow.key.in_(some))
            self._connection.execute(of_keys.values(stand_key=stand_key))

    def remove(self, keys: Collection[int]) -> None:
        """Delete submaps, note for the live indexes that they are gone, and take them off the collection's counts."""
        for some in batches(sorted(keys)):
            these = (beside_key(self._collection_key), SubmapRow.key.in_(some))
            count, landmarks, polygons = self._connection.execute(
                select(func.count(), func.sum(SubmapRow.landmark_count), func.sum(SubmapRow.polygon_count)).where(
                    *these
                )
            ).one()
            if not count:
                continue
            revision = Collections(self._connection).advance(
                self._collection_key, submaps=-count, landmarks=-landmarks, polygons=-polygons
            )
            gone = select(SubmapRow.key, literal(self._collection_key), literal(revision)).where(*these)
            columns = ["submap_key", "collection_key", "revision"]
            self._connection.execute(insert(DeletionRow).from_select(columns, gone))
            self._connection.execute(delete(SubmapRow).where(*these))

    def delete(self, stand_key: int) -> int:
        """Delete a stand with its submaps, as `remove` does; the number of submaps."""
        keys = self.members(stand_key).values()
        self.remove(keys)
        of_key = (StandRow.collection_key == self._collection_key, StandRow.key == stand_key)
        self._connection.execute(delete(StandRow).where(*of_key))
        return len(keys)
