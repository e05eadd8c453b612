"""The errors of the service, without HTTP. `problem_types` maps each to its status."""

from collections.abc import Mapping, Sequence
from typing import Any, Self


class DomainError(Exception):
    """Base of all errors that are shown to callers. `str(error)` says what is wrong and what to do."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Unpickle without `__init__`, whose arguments differ from those of the base class, so that errors of other
        processes arrive unchanged.
        """
        return type(self)._again, (self.args,), self.__dict__

    @classmethod
    def _again(cls, args: tuple[Any, ...]) -> Self:
        return cls.__new__(cls, *args)


class NotFound(DomainError):
    """There is no such collection, submap, stand or query."""

    def __init__(self, kind: str, name: str) -> None:
        super().__init__(f"There is no {kind} {name!r} here.")
        self.kind = kind
        self.name = name


class Unauthorized(DomainError):
    """The request has no key (`given` is false), or one that cannot be used."""

    def __init__(self, message: str, *, given: bool = True) -> None:
        super().__init__(message)
        self.given = given


class Forbidden(DomainError):
    """The key does not allow the request."""


class UnknownHost(DomainError):
    """The request names a foreign host, or comes from a foreign web page. `header` is the header that says so."""

    def __init__(self, header: str, value: str) -> None:
        super().__init__(
            f"The header {header} says {value!r}, which is not a name of this service. Use http://127.0.0.1 or "
            "http://localhost, or let the operator add the name to allowed_hosts (URQUHART_ALLOWED_HOSTS)."
        )
        self.header = header


class Gone(DomainError):
    """What was asked for existed, but is no longer kept."""


class Conflict(DomainError):
    """The request contradicts what is stored."""


class OptimiserMissing(DomainError):
    """Maps need a package that is not installed here."""


class KeyReused(DomainError):
    """An Idempotency-Key was sent before with another request."""


class PreconditionFailed(DomainError):
    """If-Match or If-None-Match does not hold. `etag` is the current one, None if nothing is stored."""

    def __init__(self, message: str, etag: str | None) -> None:
        super().__init__(message)
        self.etag = etag


class TooLarge(DomainError):
    """The request exceeds a limit. `limit` is its name in `GET /v1/limits`."""

    def __init__(self, limit: str, allowed: int, got: int | None, advice: str) -> None:
        size = "more than that was sent" if got is None else f"{got} were sent"
        super().__init__(f"The limit {limit} is {allowed}, and {size}. {advice}")
        self.limit = limit
        self.allowed = allowed
        self.got = got


class TooCostly(DomainError):
    """A line of an import took too much time or memory. `limit` is the name of the time in `GET /v1/limits`."""

    def __init__(self, limit: str, allowed: float, why: str) -> None:
        super().__init__(
            f"The submap was not described: {why}. The limit {limit} is {allowed:g}. Cut it into smaller submaps of 50 "
            "to 500 trees."
        )
        self.limit = limit
        self.allowed = allowed


class NotAcceptable(DomainError):
    """None of the media types in Accept can be produced."""

    def __init__(self, message: str, offered: Sequence[str]) -> None:
        super().__init__(message)
        self.offered = tuple(offered)


class UnsupportedMediaType(DomainError):
    """The body has a media type that this route does not read."""


class MalformedBody(DomainError):
    """The body is not JSON."""


class InvalidField(DomainError):
    """One value cannot be used. `pointer` is a JSON pointer into the body, or `parameter` the name of a parameter."""

    def __init__(self, message: str, *, code: str, pointer: str | None = None, parameter: str | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.pointer = pointer
        self.parameter = parameter

    def below(self, pointer: str) -> "InvalidField":
        """The same error for a body in which the object is at `pointer`."""
        inner = None if self.pointer is None else f"{pointer}{self.pointer}"
        return InvalidField(str(self), code=self.code, pointer=inner, parameter=self.parameter)


class InvalidParameter(InvalidField):
    """A parameter cannot be used, on a path whose standard says 400 for that."""


class InvalidBody(DomainError):
    """The body is not valid. `entries` are its faults, each as in `errors` of a problem document."""

    def __init__(self, message: str, entries: Sequence[Mapping[str, Any]]) -> None:
        super().__init__(message)
        self.entries = tuple(entries)


class InvalidLandmarks(DomainError):
    """The landmarks cannot be used. `indices` are the positions of those at fault, if known."""

    def __init__(self, pointer: str, code: str, message: str, indices: Sequence[int]) -> None:
        super().__init__(message)
        self.pointer = pointer
        self.code = code
        self.indices = tuple(indices)


class InvalidFile(DomainError):
    """A file of trees cannot be read. `entries` are its rows at fault, each as in `errors` of a problem document."""

    def __init__(self, message: str, entries: Sequence[Mapping[str, Any]] = ()) -> None:
        super().__init__(message)
        self.entries = tuple(entries)


class NotReady(DomainError):
    """The service is starting or stopping, or cannot use its database. `check` says which."""

    def __init__(self, check: str, detail: str) -> None:
        super().__init__(f"The service is not ready ({check}): {detail.removesuffix('.')}.")
        self.check = check


class LinesRefused(DomainError):
    """An import with `mode=all` has lines that cannot be stored."""


class Busy(DomainError):
    """The service has too much to do, or the caller asks too often. Try again after `retry_after` seconds."""

    def __init__(self, message: str, retry_after: float) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class Overloaded(Busy):
    """The service works on as many requests as it can, and as many as may wait are waiting."""


class StillRunning(Busy):
    """A request with the same Idempotency-Key is still in progress. A repetition gets its answer when it is done."""


class PosesPending(Busy):
    """The poses of a session are being searched for, which takes longer than a query may."""


class TooManyRequests(Busy):
    """This caller asks more often than `limits.requests_per_second` allows."""


class TooManyJobs(Busy):
    """This caller has as many unfinished jobs as `limits.unfinished_jobs` allows."""

    def __init__(self, allowed: int) -> None:
        super().__init__(
            f"This key has as many unfinished jobs as the limit unfinished_jobs allows: {allowed}. Wait for one to "
            "end, or cancel one with DELETE /v1/jobs/<id>.",
            retry_after=10.0,
        )
        self.allowed = allowed


class TooSlow(DomainError):
    """The request did not arrive in time."""


class DeadlineExceeded(DomainError):
    """The work takes longer than one request may. `limit` is the name of that limit in `GET /v1/limits`."""

    def __init__(self, limit: str, seconds: float, advice: str) -> None:
        super().__init__(f"The request took too long: the limit {limit} is {seconds:g} s. {advice}")
        self.limit = limit


class WorkerLost(DomainError):
    """A worker process ended before its work was done."""


class StorageError(DomainError):
    """The database cannot carry out the request. Nothing of it was stored."""


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
    """The file is not a database of this service."""


class DatabaseTooNew(StorageError):
    """The file was written by a newer version of the service."""


class DatabaseNotUpgraded(StorageError):
    """The file has the schema of an older version, and was not or cannot be upgraded here."""


def forget_frames(error: BaseException) -> None:
    """Drop the tracebacks of a handled error and its causes, and with them what the functions held that it passed.

    Some of these hold the error, which holds them: a large body, or thousands of refused lines, would wait for the
    garbage collector, and everybody for 100 ms while it looks through them.
    """
    chain, seen = [error], set[int]()  # an error may be the cause of its own cause
    while chain:
        one = chain.pop()
        if id(one) not in seen:
            seen.add(id(one))
            one.__traceback__ = None
            chain += [other for other in (one.__cause__, one.__context__) if other is not None]
