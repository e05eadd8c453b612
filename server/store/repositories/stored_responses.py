"""Answers to writes that carried an Idempotency-Key."""

from datetime import UTC, datetime

from sqlalchemy import Connection, delete, func, insert, select

from server.store.columns import columns_of, values_of
from server.store.service_records import ResponseRecord
from server.store.service_tables import IdempotencyRow

_AT_ONCE = 100
"""Old answers that a new one removes: more than one, so that they get fewer, and few enough to be quick."""
_MOST = 100_000
"""Answers that are kept, the newest: for minutes of the busiest fleet, where a repetition comes within one."""


class ResponseReader:
    """Reads kept answers in a transaction of the caller."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def find(self, caller: str, operation: str, name: str, since: datetime) -> ResponseRecord | None:
        """The answer that the caller got under that name, unless it is older than `since`."""
        row = self._connection.execute(
            select(*columns_of(ResponseRecord, IdempotencyRow)).where(
                IdempotencyRow.caller == caller,
                IdempotencyRow.operation == operation,
                IdempotencyRow.name == name,
                IdempotencyRow.created >= since,
            )
        ).one_or_none()
        return None if row is None else ResponseRecord(*row)


class StoredResponses(ResponseReader):
    """Reads and writes kept answers in a transaction that the caller commits."""

    def keep(self, record: ResponseRecord, since: datetime) -> None:
        """Store a response, in the place of one to the same key that is older than `since`.

        Others of that age go, too, and what is beyond the newest 100,000.
        """
        same_key = (
            (IdempotencyRow.caller == record.caller)
            & (IdempotencyRow.operation == record.operation)
            & (IdempotencyRow.name == record.name)
        )
        old = select(IdempotencyRow.key).where(IdempotencyRow.created < since).limit(_AT_ONCE)
        newest = select(func.max(IdempotencyRow.key)).scalar_subquery()
        surplus = select(IdempotencyRow.key).where(IdempotencyRow.key <= newest - _MOST).limit(_AT_ONCE)
        for stale in (
            IdempotencyRow.key.in_(old),
            IdempotencyRow.key.in_(surplus),
            same_key,
        ):
            self._connection.execute(delete(IdempotencyRow).where(stale))
        values = values_of(record) | {"created": datetime.now(UTC)}
        self._connection.execute(insert(IdempotencyRow).values(values))
