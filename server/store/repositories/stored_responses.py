"""Answers to writes that carried an Idempotency-Key."""

from datetime import datetime

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from server.store.tables import IdempotencyRow

_AT_ONCE = 100
"""Old answers that a new one removes: more than one, so that they get fewer, and few enough to be quick."""
_MOST = 100_000
"""Answers that are kept, the newest: for minutes of the busiest fleet, where a repetition comes within one."""


class StoredResponses:
    """Repository of kept answers; the session is the caller's, and so is the commit."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def find(self, caller: str, operation: str, name: str, since: datetime) -> IdempotencyRow | None:
        """The answer that the caller got under that name, unless it is older than `since`."""
        return self._session.scalar(
            select(IdempotencyRow).where(
                IdempotencyRow.caller == caller,
                IdempotencyRow.operation == operation,
                IdempotencyRow.name == name,
                IdempotencyRow.created >= since,
            )
        )

    def keep(self, row: IdempotencyRow, since: datetime) -> None:
        """Store a response, in the place of one to the same key that is older than `since`.

        Others of that age go, too, and what is beyond the newest 100,000.
        """
        same_key = (
            (IdempotencyRow.caller == row.caller)
            & (IdempotencyRow.operation == row.operation)
            & (IdempotencyRow.name == row.name)
        )
        old = select(IdempotencyRow.key).where(IdempotencyRow.created < since).limit(_AT_ONCE)
        newest = select(func.max(IdempotencyRow.key)).scalar_subquery()
        surplus = select(IdempotencyRow.key).where(IdempotencyRow.key <= newest - _MOST).limit(_AT_ONCE)
        for stale in (
            IdempotencyRow.key.in_(old),
            IdempotencyRow.key.in_(surplus),
            same_key,
        ):
            self._session.execute(delete(IdempotencyRow).where(stale), execution_options={"synchronize_session": False})
        self._session.add(row)
