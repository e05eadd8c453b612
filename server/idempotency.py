"""A POST that is sent again, because its answer was lost, does nothing again and gets that answer.

The answer is kept in the transaction of what the POST does, so there is never one without the other. A route that
takes an Idempotency-Key hands its `Once` on, and where the work is done:

    with database.write() as session:
        kept = recall(session, once, f"postSubmap {collection.key}")
        if kept is not None:
            return kept
        ...
        return keep(session, once, f"postSubmap {collection.key}", Kept(201, headers, body))
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from server.errors import KeyReused
from server.store.idempotency import Answers


@dataclass(frozen=True, slots=True)
class Once:
    """What tells one POST from another.

    Attributes:
        caller: id of the API key, empty without one.
        name: the Idempotency-Key.
        digest: of everything that was sent.
        hours: for how long the answer is kept.
    """

    caller: str
    name: str
    digest: str
    hours: float

    @property
    def since(self) -> datetime:
        """Answers from before are forgotten."""
        return datetime.now(UTC) - timedelta(hours=self.hours)


@dataclass(frozen=True, slots=True)
class Kept:
    """An answer as it was, or will be, sent; `replayed` where nothing was done for it."""

    status: int
    headers: dict[str, str]
    body: bytes
    replayed: bool = False


def recall(session: Session, once: Once | None, operation: str) -> Kept | None:
    """The answer that this POST got already, None where there is none. Raises KeyReused."""
    if once is None:
        return None
    row = Answers(session).find(once.caller, operation, once.name, once.since)
    if row is None:
        return None
    if row.digest != once.digest:
        raise KeyReused(
            f"The Idempotency-Key {once.name!r} was sent before with other content; take a new one for a new request."
        )
    return Kept(row.status, row.headers, row.body, replayed=True)


def keep(session: Session, once: Once | None, operation: str, answer: Kept) -> Kept:
    """Note what is going to be answered; the answer."""
    if once is not None:
        Answers(session).keep(
            once.caller,
            operation,
            once.name,
            digest=once.digest,
            status=answer.status,
            headers=answer.headers,
            body=answer.body,
            since=once.since,
        )
    return answer
