"""Writes that are safe to repeat: a request with a known Idempotency-Key gets the stored response and does nothing.

The response is stored in the transaction of the write, so neither exists without the other. A route that takes an
Idempotency-Key passes it on as an `IdempotencyKey`, and the write is:

    return run_once(database, key, f"deleteSubmap {collection}/{submap}", lambda tx: ...)

or, if the transaction does more, `find_response` at its beginning and `store_response` at its end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from server.errors import KeyReused
from server.store.service_records import ResponseRecord
from server.store.storage import ReadTransaction, Storage, WriteTransaction


@dataclass(frozen=True, slots=True)
class IdempotencyKey:
    """The Idempotency-Key of a write, and the request that it is bound to.

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
        """Responses stored before this time have expired."""
        return datetime.now(UTC) - timedelta(hours=self.hours)


@dataclass(frozen=True, slots=True)
class StoredResponse:
    """A response that was sent, or will be; `replayed` if it comes from the database."""

    status: int
    headers: dict[str, str]
    body: bytes
    replayed: bool = False


def find_response(tx: ReadTransaction, idempotency_key: IdempotencyKey | None, operation: str) -> StoredResponse | None:
    """The response that this write has already; None if it was not carried out yet. Raises KeyReused."""
    if idempotency_key is None:
        return None
    row = tx.responses.find(idempotency_key.caller, operation, idempotency_key.name, idempotency_key.since)
    if row is None:
        return None
    if row.digest != idempotency_key.digest:
        raise KeyReused(
            f"The Idempotency-Key {idempotency_key.name!r} was sent before with another request. Use a new key for "
            "each new request."
        )
    return StoredResponse(row.status, row.headers, row.body, replayed=True)


def store_response(
    tx: WriteTransaction, idempotency_key: IdempotencyKey | None, operation: str, answer: StoredResponse
) -> StoredResponse:
    """Store the response that is about to be sent, and return it."""
    if idempotency_key is not None:
        record = ResponseRecord(
            caller=idempotency_key.caller,
            operation=operation,
            name=idempotency_key.name,
            digest=idempotency_key.digest,
            status=answer.status,
            headers=answer.headers,
            body=answer.body,
        )
        tx.responses.keep(record, idempotency_key.since)
    return answer


def run_once(
    database: Storage,
    idempotency_key: IdempotencyKey | None,
    operation: str,
    do: Callable[[WriteTransaction], StoredResponse],
) -> StoredResponse:
    """Run `do` in a write transaction, unless it was done before. Raises KeyReused, and what `do` raises."""
    with database.write() as tx:
        return find_response(tx, idempotency_key, operation) or store_response(tx, idempotency_key, operation, do(tx))


def find_before(database: Storage, idempotency_key: IdempotencyKey | None, operation: str) -> StoredResponse | None:
    """The response that this write has already, read before any work is done. Raises KeyReused."""
    if idempotency_key is None:
        return None
    with database.read() as tx:
        return find_response(tx, idempotency_key, operation)


NO_CONTENT = StoredResponse(204, {}, b"")
"""The answer to a DELETE."""
