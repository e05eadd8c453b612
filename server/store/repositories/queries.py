"""Rows of stored queries, seen through one collection."""

from collections.abc import Collection
from datetime import UTC, datetime

from sqlalchemy import Connection, delete, func, insert, select

from server.store.columns import columns_of, values_of
from server.store.expressions import batches
from server.store.records import QueryRecord
from server.store.tables import QueryRow


class QueryReader:
    """Reads one collection's stored queries in a transaction of the caller."""

    def __init__(self, connection: Connection, collection_key: int) -> None:
        self._connection = connection
        self._collection_key = collection_key

    def get(self, number: int) -> QueryRecord | None:
        """A stored query, or None."""
        query = select(*columns_of(QueryRecord, QueryRow)).where(
            QueryRow.collection_key == self._collection_key, QueryRow.number == number
        )
        row = self._connection.execute(query).one_or_none()
        return None if row is None else QueryRecord(*row)

    def page(self, *, after: int, limit: int) -> list[QueryRecord]:
        """Up to `limit` stored queries in the order of their numbers, beginning after one."""
        mine = (QueryRow.collection_key == self._collection_key, QueryRow.number > after)
        query = select(*columns_of(QueryRecord, QueryRow)).where(*mine).order_by(QueryRow.number).limit(limit)
        return [QueryRecord(*row) for row in self._connection.execute(query)]

    def last_number(self) -> int:
        """The largest number of a query that is still stored, 0 if there is none."""
        last = select(func.max(QueryRow.number)).where(QueryRow.collection_key == self._collection_key)
        return self._connection.scalar(last) or 0

    def first_number(self) -> int:
        """The smallest number of a query that is still stored, 0 if there is none."""
        first = select(func.min(QueryRow.number)).where(QueryRow.collection_key == self._collection_key)
        return self._connection.scalar(first) or 0

    def created(self, numbers: Collection[int]) -> dict[int, datetime]:
        """When stored queries were stored, by number."""
        found: dict[int, datetime] = {}
        for some in batches(numbers):
            mine = (QueryRow.collection_key == self._collection_key, QueryRow.number.in_(some))
            rows = self._connection.execute(select(QueryRow.number, QueryRow.created).where(*mine))
            found.update({row.number: row.created for row in rows})
        return found


class Queries(QueryReader):
    """Reads and writes one collection's stored queries in a transaction that the caller commits."""

    def add(self, record: QueryRecord) -> None:
        """Store a query."""
        values = values_of(record) | {"collection_key": self._collection_key, "created": datetime.now(UTC)}
        self._connection.execute(insert(QueryRow).values(values))

    def drop_through(self, number: int) -> None:
        """Remove the stored queries up to and including a number."""
        statement = delete(QueryRow).where(QueryRow.collection_key == self._collection_key, QueryRow.number <= number)
        self._connection.execute(statement)
