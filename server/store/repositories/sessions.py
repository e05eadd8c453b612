"""Sessions of a collection: the drives, flights and seasons that its submaps belong to."""

from collections.abc import Collection

from sqlalchemy import Connection, func, select

from server.store.expressions import beside_key
from server.store.records import SessionMember, SessionRecord
from server.store.tables import SubmapRow


class Sessions:
    """Reads one collection's sessions in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def page(self, after: str, limit: int) -> list[SessionRecord]:
        """Up to `limit` sessions by name, after one; from an index alone."""
        count, trees = func.count(), func.sum(SubmapRow.landmark_count)
        query = (
            select(SubmapRow.session, count, trees, func.min(SubmapRow.stamp), func.max(SubmapRow.stamp))
            .where(SubmapRow.collection_key == self._collection_key, SubmapRow.session > after)
            .group_by(SubmapRow.session)
            .order_by(SubmapRow.session)
            .limit(limit)
        )
        return [SessionRecord(row[0] or "", *row[1:]) for row in self._connection.execute(query)]

    def members(self, session: str) -> list[SessionMember]:
        """The submaps of a session, in the order they were stored."""
        query = select(SubmapRow.key, SubmapRow.id, SubmapRow.content_revision)
        mine = (SubmapRow.collection_key == self._collection_key, SubmapRow.session == session)
        rows = self._connection.execute(query.where(*mine).order_by(SubmapRow.key))
        return [SessionMember(*row) for row in rows]

    def last_key(self) -> int:
        """The largest key of the collection's submaps, 0 if it has none. Later submaps get larger ones."""
        query = select(func.max(SubmapRow.key)).where(SubmapRow.collection_key == self._collection_key)
        return int(self._connection.scalar(query) or 0)

    def names(self, keys: Collection[int]) -> dict[int, str | None]:
        """The sessions of a few submaps, by key."""
        query = select(SubmapRow.key, SubmapRow.session).where(
            beside_key(self._collection_key), SubmapRow.key.in_(keys)
        )
        return {row.key: row.session for row in self._connection.execute(query)}

    def beside(self, key: int) -> set[int]:
        """Keys of all submaps of a submap's session, or of all without one where it has none."""
        session = self._connection.scalar(select(SubmapRow.session).where(SubmapRow.key == key))
        same = SubmapRow.session.is_(None) if session is None else SubmapRow.session == session
        query = select(SubmapRow.key).where(SubmapRow.collection_key == self._collection_key, same)
        return set(self._connection.scalars(query))
