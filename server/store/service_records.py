"""Records of API keys, of responses to idempotent writes, and of jobs."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final, NamedTuple, TypedDict


@dataclass(frozen=True, slots=True)
class ApiKeyRecord:
    """An API key. `digest` is the SHA-256 of its secret, which is stored nowhere; `id` is the part that may be shown.

    `expires` and `revoked` are None for a key that never expires or was not revoked.
    """

    id: str
    name: str
    digest: bytes = field(repr=False)
    scopes: tuple[str, ...]
    patterns: tuple[str, ...]
    created: datetime
    expires: datetime | None
    revoked: datetime | None

    def state(self, now: datetime) -> str:
        """`usable`, `expired` or `revoked`."""
        if self.revoked is not None:
            return "revoked"
        return "expired" if self.expires is not None and self.expires <= now else "usable"


@dataclass(frozen=True, slots=True)
class ResponseRecord:
    """The response to a write with an Idempotency-Key, to be sent again to whoever repeats the write.

    Attributes:
        caller: id of the API key, empty without one.
        operation: what was done to what, such as `deleteSubmap plots/p7`.
        name: the Idempotency-Key.
        digest: hex SHA-256 of everything that was sent.
        status, headers, body: the response.
    """

    caller: str
    operation: str
    name: str
    digest: str
    status: int
    headers: dict[str, str]
    body: bytes


UNFINISHED: Final = ("accepted", "running")


class Queue(NamedTuple):
    """The jobs of one caller on one collection: they are done one after the other, in the order they came."""

    caller: str
    collection_key: int


@dataclass(frozen=True, slots=True)
class JobRecord:
    """Long work, as it is stored. `counts` and `progress` belong to the type of job; do not change them in place.

    Attributes:
        key: in the order in which jobs came.
        kind: the type of job.
        collection_id: the name of its collection, which may be another collection's by now.
        collection_key: the collection itself, which may be gone.
        caller: id of the API key that began it, empty without one.
        state: accepted, running, successful, failed or dismissed.
        total: steps in all, None if that is not known.
        progress: where a restart goes on.
        problem: why it failed or was dismissed, as a problem document.
        dismissed: whether somebody wants it ended.
    """

    key: int
    id: str
    kind: str
    collection_id: str
    collection_key: int
    caller: str
    state: str
    parameters: dict[str, Any]
    total: int | None
    done: int
    counts: dict[str, int]
    progress: dict[str, Any]
    problem: dict[str, Any] | None
    dismissed: bool
    created: datetime
    started: datetime | None
    finished: datetime | None


class JobChanges(TypedDict, total=False):
    """The fields of a `JobRecord` that change while it waits and runs."""

    state: str
    total: int | None
    done: int
    counts: dict[str, int]
    progress: dict[str, Any]
    problem: dict[str, Any] | None
    dismissed: bool
    started: datetime
    finished: datetime
