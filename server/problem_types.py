"""Kinds of problems (RFC 9457), from one table: exception -> status, slug, title; and what each tells of itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from server import errors


@dataclass(frozen=True, slots=True)
class ProblemType:
    """A kind of problem; `about` is what GET /problems/<slug> says."""

    status: int
    slug: str
    title: str
    about: str


VALIDATION = ProblemType(
    422,
    "invalid-request",
    "The request is not valid",
    "A field or parameter is missing, unknown, or cannot be used. `errors` names each by JSON pointer.",
)
INTERNAL = ProblemType(
    500,
    "internal-error",
    "Internal error",
    "The service failed in a way that it should not. The log has the cause under the request id.",
)
NO_ROUTE = ProblemType(
    404, "no-such-path", "No such path", "Nothing is served under this path; /docs lists the routes."
)
METHOD = ProblemType(
    405,
    "method-not-allowed",
    "Method not allowed",
    "The path exists, the method does not; the header Allow lists those that do.",
)

OTHER = ProblemType(
    400, "http-error", "The request failed", "The request could not be read as HTTP; `detail` says more."
)

# The most special exception of a request's comes first in its MRO, so bases may stand here too.
TABLE: Mapping[type[errors.DomainError], ProblemType] = {
    errors.NotFound: ProblemType(
        404,
        "not-found",
        "Not found",
        "There is no collection, submap, stored query, job or snapshot of this name.",
    ),
    errors.Unauthorized: ProblemType(
        401,
        "unauthorized",
        "No usable key",
        "The service asks for a key: send Authorization: Bearer urq_..., which the operator makes with "
        "urquhart keys create.",
    ),
    errors.Forbidden: ProblemType(
        403, "forbidden", "Not allowed", "The key is good, but lacks the scope for this, or sees only some collections."
    ),
    errors.UnknownHost: ProblemType(
        403,
        "unknown-host",
        "Unknown host or origin",
        "The request came under a host name that is not the service's, or from a page of another site. A service "
        "without keys refuses both; the setting allowed_hosts names further hosts.",
    ),
    errors.Gone: ProblemType(
        410, "gone", "Gone", "It was here and is no longer kept; asking again will not bring it back."
    ),
    errors.Conflict: ProblemType(
        409, "conflict", "Conflict", "The request contradicts what is stored; nothing was changed."
    ),
    errors.StillRunning: ProblemType(
        409,
        "still-running",
        "Still running",
        "The same request, by its Idempotency-Key, is at work. Nothing was done for this one; send it again after "
        "Retry-After seconds, and it gets the answer of the first.",
    ),
    errors.KeyReused: ProblemType(
        422,
        "idempotency-key-reused",
        "Idempotency-Key used twice",
        "The key was sent before with other content. Take a new key for each request that is not a repetition.",
    ),
    errors.PreconditionFailed: ProblemType(
        412,
        "precondition-failed",
        "Precondition failed",
        "If-Match or If-None-Match does not hold: somebody wrote in between. Nothing was changed.",
    ),
    errors.TooLarge: ProblemType(
        413, "too-large", "Too large", "A limit is exceeded; `limit` names it as in GET /v1/limits. Nothing was stored."
    ),
    errors.TooCostly: ProblemType(
        422,
        "too-costly",
        "Too costly",
        "A line of an import took more time or memory than one may, so it was refused; the other lines are stored.",
    ),
    errors.NotAcceptable: ProblemType(
        406,
        "not-acceptable",
        "Not acceptable",
        "None of the media types in Accept can be produced; `offered` lists those that can.",
    ),
    errors.UnsupportedMediaType: ProblemType(
        415,
        "unsupported-media-type",
        "Unsupported media type",
        "Send the body as JSON, with Content-Type: application/json; an import as NDJSON, application/x-ndjson.",
    ),
    errors.MalformedBody: ProblemType(
        400,
        "malformed-json",
        "Malformed JSON",
        "The body is not JSON: RFC 8259, in UTF-8, without NaN and Infinity, nested at most 1,000 deep.",
    ),
    errors.LinesRefused: ProblemType(
        422,
        "lines-refused",
        "Lines were refused",
        "An import with mode=all stores all lines or none; its results tell which cannot be stored, and why.",
    ),
    errors.InvalidField: VALIDATION,
    errors.InvalidBody: VALIDATION,
    errors.InvalidLandmarks: ProblemType(
        422,
        "invalid-landmarks",
        "The landmarks cannot be used",
        "A submap needs at least 3 landmarks, not all on one line, each once, with finite coordinates.",
    ),
    errors.NotReady: ProblemType(
        503,
        "not-ready",
        "Not ready",
        "The service is starting, about to end, or cannot use its database; `check` names what is open.",
    ),
    errors.Overloaded: ProblemType(
        503,
        "overloaded",
        "Overloaded",
        "The service has as much to do as it takes on at once. Nothing was done; try again after Retry-After seconds.",
    ),
    errors.TooManyRequests: ProblemType(
        429,
        "too-many-requests",
        "Too many requests",
        "One key, or one address, asks more often than `rates` in GET /v1/limits allows. Nothing was done; try again "
        "after Retry-After seconds.",
    ),
    errors.TooManyJobs: ProblemType(
        429,
        "too-many-jobs",
        "Too many unfinished jobs",
        "One key has as many unfinished jobs as `unfinished_jobs` in GET /v1/limits allows. Nothing was taken on; try "
        "again after Retry-After seconds, or dismiss a job.",
    ),
    errors.TooSlow: ProblemType(
        408,
        "request-timeout",
        "The request came too slowly",
        "The head or the body did not arrive in the time that GET /v1/limits gives it. Nothing was stored, and the "
        "connection is closed; send it again.",
    ),
    errors.OutOfTime: ProblemType(
        503,
        "out-of-time",
        "The time was over",
        "The work takes longer than a request may; `limit` names the limit as in GET /v1/limits. Ask for less at a "
        "time.",
    ),
    errors.StorageFull: ProblemType(
        507, "storage-full", "The disk is full", "Nothing was stored; what was stored before is intact."
    ),
    errors.StorageReadOnly: ProblemType(
        503,
        "storage-read-only",
        "The database cannot be written",
        "Reading works; writing needs write access to the file and its folder.",
    ),
    errors.StorageBusy: ProblemType(
        503, "storage-busy", "The database is busy", "Another writer holds it. Nothing was stored; try again shortly."
    ),
    errors.StorageDamaged: ProblemType(
        500, "storage-damaged", "The database is damaged", "The operator must check it and restore a backup."
    ),
    errors.StorageAltered: ProblemType(
        503,
        "storage-altered",
        "The database file is not the one that was opened",
        "Somebody moved, deleted, replaced or wrote to the file under the running service. Nothing is read or stored "
        "until the operator mends that; `detail` says how. A write that was under way then may be stored or not.",
    ),
    errors.StorageError: ProblemType(
        503, "storage-unavailable", "The database cannot be used", "The operator must look at the file and its disk."
    ),
}

PROBLEM_TYPES: Mapping[str, ProblemType] = {
    kind.slug: kind for kind in (*TABLE.values(), VALIDATION, INTERNAL, NO_ROUTE, METHOD, OTHER)
}


def problem_type_of(error: errors.DomainError) -> ProblemType:
    """The kind of a domain error: that of its class or the nearest base in the table."""
    return next((TABLE[base] for base in type(error).__mro__ if base in TABLE), INTERNAL)


def plain(kind: ProblemType, detail: str) -> dict[str, Any]:
    """The problem document of a kind that no domain error stands for."""
    return {"type": f"/problems/{kind.slug}", "title": kind.title, "status": kind.status, "detail": detail}


def document(error: errors.DomainError) -> dict[str, Any]:
    """The problem document of a domain error: what HTTP answers, and what a job notes of a line."""
    kind, where = problem_type_of(error), getattr(error, "pointer", None) or getattr(error, "parameter", None)
    return plain(kind, f"{where}: {error}" if where else str(error)) | _members(error)


def _members(error: errors.DomainError) -> dict[str, Any]:
    entry: dict[str, Any]
    match error:
        case errors.TooLarge():
            members: dict[str, Any] = {"limit": error.limit, "allowed": error.allowed, "got": error.got}
        case errors.TooCostly():
            members = {"limit": error.limit, "allowed": error.allowed}
        case errors.TooManyRequests():
            members = {"limit": "requests_per_second"}
        case errors.OutOfTime():
            members = {"limit": error.limit}
        case errors.TooManyJobs():
            members = {"limit": "unfinished_jobs", "allowed": error.allowed}
        case errors.PreconditionFailed():
            members = {"etag": error.etag}
        case errors.NotAcceptable():
            members = {"offered": list(error.offered)}
        case errors.NotReady():
            members = {"check": error.check}
        case errors.InvalidField():
            entry = {"pointer": error.pointer, "parameter": error.parameter, "code": error.code, "detail": str(error)}
            members = {"errors": [{name: value for name, value in entry.items() if value is not None}]}
        case errors.InvalidBody():
            members = {"errors": list(error.entries)}
        case errors.InvalidLandmarks():
            entry = {"pointer": error.pointer, "code": error.code, "detail": str(error)}
            members = {"errors": [entry | ({"indices": list(error.indices)} if error.indices else {})]}
        case _:
            members = {}
    return {name: value for name, value in members.items() if value is not None}
