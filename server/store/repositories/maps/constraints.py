"""Rows of constraints, all seen through one collection."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, and_, delete, exists, func, insert, or_, select, update
from sqlalchemy.orm import InstrumentedAttribute

from server.store.columns import values_of
from server.store.expressions import batches
from server.store.repositories.maps.constraint_records import ConstraintFilter, ConstraintRecord, StoredConstraint
from server.store.repositories.maps.constraint_tables import ConstraintRow, SearchedRow
from server.store.tables import SubmapRow


class ConstraintReader:
    """Reads one collection's constraints in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def page(self, chosen: ConstraintFilter, *, after_key: int = 0, limit: int | None = None) -> list[StoredConstraint]:
        """Up to `limit` constraints (None: all) in the order they were stored, beginning after a key."""
        query = self._select().where(*self._conditions(chosen), ConstraintRow.key > after_key)
        query = query.order_by(ConstraintRow.key).limit(limit)
        return [StoredConstraint(**row) for row in self._connection.execute(query).mappings()]

    def get(self, key: int) -> StoredConstraint | None:
        """The constraint of that key, or None."""
        row = self._connection.execute(self._select().where(ConstraintRow.key == key)).mappings().one_or_none()
        return None if row is None else StoredConstraint(**row)

    def extent(self, after_key: int = 0) -> tuple[int, int]:
        """The number of constraints after a key, and the largest key, 0 if there is none. As keys are never used again,
        both stay the same as long as no constraint is stored or deleted.
        """
        query = select(func.count(), func.max(ConstraintRow.key)).where(ConstraintRow.key > after_key)
        count, last = self._connection.execute(query.where(ConstraintRow.collection_key == self._collection_key)).one()
        return int(count), int(last or 0)

    def searched(self, search: str) -> dict[int, int]:
        """For each submap that a search looked up, by key, the revision of the landmarks that it had then."""
        query = select(SearchedRow.submap_key, SearchedRow.content_revision).where(
            SearchedRow.collection_key == self._collection_key, SearchedRow.search == search
        )
        return {row.submap_key: row.content_revision for row in self._connection.execute(query)}

    def _select(self) -> Select[Any]:
        names = [one.name for one in fields(StoredConstraint) if one.name != "stale"]
        columns = [getattr(ConstraintRow, name) for name in names]
        return select(*columns, self._is_stale().label("stale")).where(
            ConstraintRow.collection_key == self._collection_key
        )

    def _is_stale(self) -> ColumnElement[bool]:
        return or_(
            ~self._is_there(ConstraintRow.from_id, ConstraintRow.from_revision),
            ~self._is_there(ConstraintRow.to_id, ConstraintRow.to_revision),
        )

    def _is_there(self, of: InstrumentedAttribute[str], at: InstrumentedAttribute[int]) -> ColumnElement[bool]:
        return exists().where(
            SubmapRow.collection_key == self._collection_key, SubmapRow.id == of, SubmapRow.content_revision == at
        )

    def _conditions(self, chosen: ConstraintFilter) -> list[ColumnElement[bool]]:
        made = list[ColumnElement[bool]]()
        if chosen.kind is not None:
            made.append(ConstraintRow.kind == chosen.kind)
        if chosen.submap is not None:
            made.append(or_(ConstraintRow.from_id == chosen.submap, ConstraintRow.to_id == chosen.submap))
        if chosen.search is not None:
            made.append(ConstraintRow.search.in_(["", chosen.search]))
        if chosen.session is not None:
            mine = (SubmapRow.collection_key == self._collection_key, SubmapRow.session == chosen.session)
            members = select(SubmapRow.id).where(*mine).scalar_subquery()
            made += [ConstraintRow.from_id.in_(members), ConstraintRow.to_id.in_(members)]
        if chosen.state is not None:
            stale = self._is_stale()
            refused = and_(~stale, ConstraintRow.refused.is_not(None))
            active = and_(~stale, ConstraintRow.refused.is_(None))
            made.append({"stale": stale, "refused": refused, "active": active}[chosen.state])
        return made


class Constraints(ConstraintReader):
    """Reads and writes one collection's constraints in a transaction that the caller commits."""

    def put(self, records: Sequence[ConstraintRecord]) -> None:
        """Store constraints, each in the place of those of its kind and search between the same two submaps."""
        now = datetime.now(UTC)
        for some in batches(records):
            for one in some:
                ends = (one.from_id, one.to_id)
                self._connection.execute(
                    delete(ConstraintRow).where(
                        ConstraintRow.collection_key == self._collection_key,
                        ConstraintRow.kind == one.kind,
                        ConstraintRow.search == one.search,
                        ConstraintRow.from_id.in_(ends),
                        ConstraintRow.to_id.in_(ends),
                    )
                )
            shared = {"collection_key": self._collection_key, "created": now, "refused": None, "refused_by": None}
            self._connection.execute(insert(ConstraintRow), [values_of(one) | shared for one in some])

    def forget_found(self, search: str, looked_up: Collection[str]) -> None:
        """Delete the matches of a search that are stale, and those between two submaps of which both were looked up."""
        query = select(ConstraintRow.key, ConstraintRow.from_id, ConstraintRow.to_id, self._is_stale().label("stale"))
        mine = (ConstraintRow.collection_key == self._collection_key, ConstraintRow.search == search)
        names = set(looked_up)
        rows = self._connection.execute(query.where(*mine)).all()
        self.delete([row.key for row in rows if row.stale or {row.from_id, row.to_id} <= names])

    def note_searched(self, search: str, revisions: Mapping[int, int]) -> None:
        """Note which landmarks of submaps, by key, a search looked up."""
        for some in batches(sorted(revisions)):
            self._connection.execute(
                delete(SearchedRow).where(SearchedRow.submap_key.in_(some), SearchedRow.search == search)
            )
            there = set(self._connection.scalars(select(SubmapRow.key).where(SubmapRow.key.in_(some))))
            shared = {"collection_key": self._collection_key, "search": search}
            rows = [shared | {"submap_key": key, "content_revision": revisions[key]} for key in some if key in there]
            if rows:
                self._connection.execute(insert(SearchedRow), rows)

    def judge(self, refusals: Mapping[int, str | None], by: str) -> None:
        """Note why a map left constraints out, by key; None for those that it used."""
        reasons = {reason: [key for key, why in refusals.items() if why == reason] for reason in {*refusals.values()}}
        for reason, keys in reasons.items():
            for some in batches(keys):
                of_keys = update(ConstraintRow).where(ConstraintRow.key.in_(some))
                mine = of_keys.where(ConstraintRow.collection_key == self._collection_key)
                self._connection.execute(mine.values(refused=reason, refused_by=by if reason else None))

    def delete(self, keys: Collection[int]) -> int:
        """Delete constraints by key. Returns how many there were."""
        count = 0
        for some in batches(sorted(keys)):
            of_keys = delete(ConstraintRow).where(ConstraintRow.key.in_(some))
            mine = of_keys.where(ConstraintRow.collection_key == self._collection_key)
            count += self._connection.execute(mine).rowcount
        return count
