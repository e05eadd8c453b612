"""A write that is sent again, because its answer was lost, does nothing again and gets that answer.

The answer is kept in the transaction of what the write does, so there is never one without the other. A route that
takes an Idempotency-Key hands its `Once` on, and where the work is done:

    return do_once(database, once, f"deleteSubmap {collection}/{submap}", lambda session: ...)

or, where more is to be done in that transaction than that, `recall` at its beginning and `keep` at its end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from server.errors import KeyReused
from server.store.repositories.stored_responses import Answers
from server.store.sqlite.database import Database


@dataclass(frozen=True, slots=True)
class Once:
    """What tells one write from another.

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
    """The answer that this write got already, None where there is none. Raises KeyReused."""
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


def do_once(database: Database, once: Once | None, operation: str, do: Callable[[Session], Kept]) -> Kept:
    """What `do` answers in a write transaction, unless that was done before. Raises KeyReused, and what `do` raises."""
    with database.write() as session:
        return recall(session, once, operation) or keep(session, once, operation, do(session))


def done(database: Database, once: Once | None, operation: str) -> Kept | None:
    """The answer that this write got already, looked for before any work is done. Raises KeyReused."""
    if once is None:
        return None
    with database.read() as session:
        return recall(session, once, operation)


NO_CONTENT = Kept(204, {}, b"")
"""What a DELETE answers."""
