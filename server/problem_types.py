"""Types of problems (RFC 9457): one table from each exception to its status, slug, title and explanation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from server import errors


@dataclass(frozen=True, slots=True)
class ProblemType:
    """A type of problem. `about` is the explanation that GET /problems/<slug> returns."""

    status: int
    slug: str
    title: str
    about: str


VALIDATION = ProblemType(
    422,
    "invalid-request",
    "Invalid request",
    "A member of the body or a parameter is missing, unknown or cannot be used. `errors` names each of them.",
)
INTERNAL = ProblemType(
    500,
    "internal-error",
    "Internal error",
    "The service failed because of a defect. The log has the cause, under the id of the request.",
)
NO_ROUTE = ProblemType(404, "no-such-path", "No such path", "There is nothing under this path. /docs lists the routes.")
METHOD = ProblemType(
    405,
    "method-not-allowed",
    "Method not allowed",
    "This path does not support this method. The header Allow lists those that it supports.",
)

OTHER = ProblemType(400, "http-error", "HTTP error", "The request could not be read as HTTP. `detail` says why.")

# An exception without an entry has the type of its nearest base class.
TABLE: Mapping[type[errors.DomainError], ProblemType] = {
    errors.NotFound: ProblemType(
        404,
        "not-found",
        "Not found",
        "There is no collection, submap, stored query, job or snapshot with this name, or your key may not see it.",
    ),
    errors.Unauthorized: ProblemType(
        401,
        "unauthorized",
        "Unauthorized",
        "The service needs an API key: send Authorization: Bearer urq_... The operator creates keys with urquhart keys "
        "create.",
    ),
    errors.Forbidden: ProblemType(
        403,
        "forbidden",
        "Forbidden",
        "The key is valid, but it lacks the scope for this, or it is bound to some collections.",
    ),
    errors.UnknownHost: ProblemType(
        403,
        "unknown-host",
        "Unknown host or origin",
        "The header Host or Origin names something other than this service: the request may come from a page of "
        "another site. A service without keys refuses such requests. The setting allowed_hosts adds host names.",
    ),
    errors.Gone: ProblemType(410, "gone", "Gone", "What you asked for existed, but is no longer kept."),
    errors.Conflict: ProblemType(
        409, "conflict", "Conflict", "The request contradicts what is stored. Nothing was changed."
    ),
    errors.OptimiserMissing: ProblemType(
        501,
        "optimiser-missing",
        "Optimiser missing",
        "Maps need GTSAM, which is not installed where the service runs. The operator installs it with "
        "`pip install 'urquhart[maps]'`; everything else works without it.",
    ),
    errors.StillRunning: ProblemType(
        409,
        "still-running",
        "Still running",
        "A request with the same Idempotency-Key is still in progress. Send this one again after Retry-After seconds "
        "to get the answer of the first.",
    ),
    errors.KeyReused: ProblemType(
        422,
        "idempotency-key-reused",
        "Idempotency-Key reused",
        "The Idempotency-Key was sent before with another request. Use a new key for each new request.",
    ),
    errors.PreconditionFailed: ProblemType(
        412,
        "precondition-failed",
        "Precondition failed",
        "If-Match or If-None-Match does not hold, because somebody wrote in between. Nothing was changed.",
    ),
    errors.TooLarge: ProblemType(
        413,
        "too-large",
        "Too large",
        "The request exceeds a limit. `limit` is its name in GET /v1/limits. Nothing was stored.",
    ),
    errors.TooCostly: ProblemType(
        422,
        "too-costly",
        "Too costly",
        "A line of an import took more time or memory than one line may, so it was refused. The other lines are "
        "stored.",
    ),
    errors.NotAcceptable: ProblemType(
        406,
        "not-acceptable",
        "Not acceptable",
        "None of the media types in Accept can be produced. `offered` lists those that can.",
    ),
    errors.UnsupportedMediaType: ProblemType(
        415,
        "unsupported-media-type",
        "Unsupported media type",
        "Send the body as JSON, with Content-Type: application/json. Send an import as NDJSON: application/x-ndjson.",
    ),
    errors.MalformedBody: ProblemType(
        400,
        "malformed-json",
        "Malformed JSON",
        "The body is not JSON (RFC 8259) in UTF-8, contains NaN or Infinity, or is nested more than 1,000 deep.",
    ),
    errors.LinesRefused: ProblemType(
        422,
        "lines-refused",
        "Lines refused",
        "An import with mode=all stores all lines or none. Its results say which lines were refused, and why.",
    ),
    errors.InvalidField: VALIDATION,
    errors.InvalidParameter: ProblemType(
        400,
        "invalid-parameter",
        "Invalid parameter",
        "A parameter is unknown, given more than once, or cannot be used. OGC API - Features, the standard of the "
        "paths under /ogc, asks for status 400; other paths answer invalid-request with 422.",
    ),
    errors.InvalidBody: VALIDATION,
    errors.InvalidLandmarks: ProblemType(
        422,
        "invalid-landmarks",
        "Invalid landmarks",
        "A submap needs at least 3 landmarks that are not all on one line. Each must be given once, with finite "
        "coordinates.",
    ),
    errors.InvalidFile: ProblemType(
        422,
        "invalid-file",
        "Invalid file",
        "The file of trees cannot be read or used. `detail` says why, and `errors` names each row at fault. Nothing "
        "was stored.",
    ),
    errors.NotReady: ProblemType(
        503,
        "not-ready",
        "Not ready",
        "The service is starting or stopping, or cannot use its database. `check` says which.",
    ),
    errors.Overloaded: ProblemType(
        503,
        "overloaded",
        "Overloaded",
        "The service is working on as many requests as it can. Nothing was done. Try again after Retry-After seconds.",
    ),
    errors.PosesPending: ProblemType(
        503,
        "poses-pending",
        "Poses pending",
        "All constraints of this session are being searched, for the first time since the service started or since its "
        "submaps changed. The search goes on; ask again after Retry-After seconds.",
    ),
    errors.TooManyRequests: ProblemType(
        429,
        "too-many-requests",
        "Too many requests",
        "Your key, or your address, sends more requests than `rates` in GET /v1/limits allows. Nothing was done. Try "
        "again after Retry-After seconds.",
    ),
    errors.TooManyJobs: ProblemType(
        429,
        "too-many-jobs",
        "Too many unfinished jobs",
        "Your key has as many unfinished jobs as `unfinished_jobs` in GET /v1/limits allows. Nothing was accepted. Try "
        "again after Retry-After seconds, or cancel a job.",
    ),
    errors.TooSlow: ProblemType(
        408,
        "request-timeout",
        "Request timeout",
        "The head or the body did not arrive within the time that GET /v1/limits allows. Nothing was stored, and the "
        "connection is closed. Send the request again.",
    ),
    errors.DeadlineExceeded: ProblemType(
        503,
        "deadline-exceeded",
        "Deadline exceeded",
        "The work takes longer than one request may. `limit` is the name of the limit in GET /v1/limits. Ask for less "
        "at a time.",
    ),
    errors.StorageFull: ProblemType(
        507, "storage-full", "Storage full", "Nothing was stored. What was stored before is intact."
    ),
    errors.StorageReadOnly: ProblemType(
        503,
        "storage-read-only",
        "Storage read-only",
        "Reading works. Writing needs write access to the file and its folder.",
    ),
    errors.StorageBusy: ProblemType(
        503,
        "storage-busy",
        "Storage busy",
        "Another writer holds the database. Nothing was stored. Try again in a moment.",
    ),
    errors.StorageDamaged: ProblemType(
        500,
        "storage-damaged",
        "Storage damaged",
        "The operator must check the database and restore a snapshot.",
    ),
    errors.StorageAltered: ProblemType(
        503,
        "storage-altered",
        "Storage altered",
        "Somebody moved, deleted, replaced or wrote to the file while the service was running. Nothing is read or "
        "stored until the operator repairs that; `detail` says how. A write in progress at that time may or may not be "
        "stored.",
    ),
    errors.StorageError: ProblemType(
        503, "storage-unavailable", "Storage unavailable", "The operator must check the file and its disk."
    ),
}

PROBLEM_TYPES: Mapping[str, ProblemType] = {
    kind.slug: kind for kind in (*TABLE.values(), VALIDATION, INTERNAL, NO_ROUTE, METHOD, OTHER)
}


def problem_type_of(error: errors.DomainError) -> ProblemType:
    """The type of a domain error: that of its class, or of the nearest base class in the table."""
    return next((TABLE[base] for base in type(error).__mro__ if base in TABLE), INTERNAL)


def plain(kind: ProblemType, detail: str) -> dict[str, Any]:
    """The problem document of a type that no domain error has."""
    return {"type": f"/problems/{kind.slug}", "title": kind.title, "status": kind.status, "detail": detail}


def document(error: errors.DomainError) -> dict[str, Any]:
    """The problem document of a domain error, as in an HTTP answer and in the results of a job."""
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
        case errors.DeadlineExceeded():
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
        case errors.InvalidFile():
            members = {"errors": list(error.entries) or None}
        case errors.InvalidLandmarks():
            entry = {"pointer": error.pointer, "code": error.code, "detail": str(error)}
            members = {"errors": [entry | ({"indices": list(error.indices)} if error.indices else {})]}
        case _:
            members = {}
    return {name: value for name, value in members.items() if value is not None}
