"""What can go wrong, in the words of the domain; `problem_types` alone knows which HTTP status each becomes."""

from collections.abc import Mapping, Sequence
from typing import Any, Self


class DomainError(Exception):
    """Base of all errors that are meant for the caller; `str(error)` is a sentence that says what to do."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without calling `__init__` again, whose arguments are not those of the base: errors of other
        processes arrive as they were.
        """
        return type(self)._again, (self.args,), self.__dict__

    @classmethod
    def _again(cls, args: tuple[Any, ...]) -> Self:
        return cls.__new__(cls, *args)


class NotFound(DomainError):
    """There is no such collection, submap or query."""

    def __init__(self, kind: str, name: str) -> None:
        super().__init__(f"There is no {kind} {name!r} here.")
        self.kind = kind
        self.name = name


class Unauthorized(DomainError):
    """There is no key, or one that cannot be used; `given` tells which."""

    def __init__(self, message: str, *, given: bool = True) -> None:
        super().__init__(message)
        self.given = given


class Forbidden(DomainError):
    """The key does not allow this."""


class UnknownHost(DomainError):
    """The request came under a host name, or from a web page, that is not the service's own. `header` says it."""

    def __init__(self, header: str, value: str) -> None:
        super().__init__(
            f"The header {header} says {value!r}, which is not a name of this service. Use http://127.0.0.1 or "
            "http://localhost, or let the operator add the name to allowed_hosts (URQUHART_ALLOWED_HOSTS)."
        )
        self.header = header


class Gone(DomainError):
    """It existed, and is no longer kept."""


class Conflict(DomainError):
    """The request contradicts what is stored."""


class KeyReused(DomainError):
    """An Idempotency-Key that was sent before came with other content."""


class PreconditionFailed(DomainError):
    """If-Match or If-None-Match does not hold; `etag` is the current one, None when there is nothing."""

    def __init__(self, message: str, etag: str | None) -> None:
        super().__init__(message)
        self.etag = etag


class TooLarge(DomainError):
    """A limit was exceeded. `limit` is its name in `GET /v1/limits`."""

    def __init__(self, limit: str, allowed: int, got: int | None, advice: str) -> None:
        size = "more than that was sent" if got is None else f"{got} were sent"
        super().__init__(f"The limit {limit} is {allowed}, and {size}. {advice}")
        self.limit = limit
        self.allowed = allowed
        self.got = got


class TooCostly(DomainError):
    """Something took more time or memory than it may. `limit` is the name of the time in `GET /v1/limits`."""

    def __init__(self, limit: str, allowed: float, why: str) -> None:
        super().__init__(
            f"Describing it was given up: {why}. The limit {limit} is {allowed:g}; cut it into smaller submaps, of "
            "50 to 500 trees."
        )
        self.limit = limit
        self.allowed = allowed


class NotAcceptable(DomainError):
    """None of the media types in Accept can be produced."""

    def __init__(self, message: str, offered: Sequence[str]) -> None:
        super().__init__(message)
        self.offered = tuple(offered)


class UnsupportedMediaType(DomainError):
    """The body is of a media type that this route does not read."""


class MalformedBody(DomainError):
    """The body is not JSON."""


class InvalidField(DomainError):
    """One field's value cannot be used. `pointer` is a JSON pointer into the body, or `parameter` names a parameter."""

    def __init__(self, message: str, *, code: str, pointer: str | None = None, parameter: str | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.pointer = pointer
        self.parameter = parameter

    def below(self, pointer: str) -> "InvalidField":
        """The same of a field in an object that stands at `pointer` in the body."""
        inner = None if self.pointer is None else f"{pointer}{self.pointer}"
        return InvalidField(str(self), code=self.code, pointer=inner, parameter=self.parameter)


class InvalidBody(DomainError):
    """What was sent does not fit its description. `entries` are what is wrong, each as in a problem's `errors`."""

    def __init__(self, message: str, entries: Sequence[Mapping[str, Any]]) -> None:
        super().__init__(message)
        self.entries = tuple(entries)


class InvalidLandmarks(DomainError):
    """The landmarks cannot be used. `indices` are the offending positions, when known."""

    def __init__(self, pointer: str, code: str, message: str, indices: Sequence[int]) -> None:
        super().__init__(message)
        self.pointer = pointer
        self.code = code
        self.indices = tuple(indices)


class NotReady(DomainError):
    """The service is starting, or cannot use its database; `check` names what is open."""

    def __init__(self, check: str, detail: str) -> None:
        super().__init__(f"The check {check} is not passed: {detail.removesuffix('.')}.")
        self.check = check


class LinesRefused(DomainError):
    """An import that was to store all lines or none met some that cannot be stored."""


class Busy(DomainError):
    """The service has more to do than it can, or the caller asks too often: try again after `retry_after` seconds."""

    def __init__(self, message: str, retry_after: float) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class Overloaded(Busy):
    """As much as the service takes on at once is being worked on, and waits."""


class StillRunning(Busy):
    """The same request, by its Idempotency-Key, is at work: its answer can be had when it is done."""


class TooManyRequests(Busy):
    """This caller asks more often than `limits.requests_per_second` allows."""


class TooManyJobs(Busy):
    """This caller has as many unfinished jobs as `limits.unfinished_jobs` allows."""

    def __init__(self, allowed: int) -> None:
        super().__init__(
            f"The limit unfinished_jobs is {allowed}, and as many jobs of this key are not finished; wait for one to "
            "end, or dismiss one with DELETE /v1/jobs/<id>.",
            retry_after=10.0,
        )
        self.allowed = allowed


class TooSlow(DomainError):
    """The request does not arrive within the time that it has."""


class OutOfTime(DomainError):
    """The work would take longer than a request may. `limit` is the name of that limit in `GET /v1/limits`."""

    def __init__(self, limit: str, seconds: float, advice: str) -> None:
        super().__init__(f"The time was over before this was done: {limit} is {seconds:g} s. {advice}")
        self.limit = limit


class WorkerLost(DomainError):
    """A process that worked for this one ended before it was done."""


class StorageError(DomainError):
    """The database cannot do what was asked; nothing of the request was kept."""


class StorageFull(StorageError):
    """The disk is full."""


class StorageReadOnly(StorageError):
    """The database file or its disk cannot be written."""


class StorageBusy(StorageError):
    """Another writer held the database for longer than the busy timeout."""


class StorageDamaged(StorageError):
    """SQLite finds the file malformed."""


class StorageUnavailable(StorageError):
    """The file cannot be opened or read."""


class StorageAltered(StorageError):
    """The database file was moved, deleted, replaced or written to by others while it was open."""


class NotADatabase(StorageError):
    """The file is something else than a database of this service."""


class DatabaseTooNew(StorageError):
    """The file was written by a newer version of the service."""


class DatabaseNotUpgraded(StorageError):
    """The file is of an older version and cannot be upgraded here, or was not."""
