"""Every error as application/problem+json (RFC 9457), from one table: exception -> status, slug, title."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import orjson
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import Scope

from server import errors
from server.schemas.pointers import field_problems

MEDIA_TYPE = "application/problem+json"
_log = logging.getLogger("server")


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem; `about` is what GET /problems/<slug> says."""

    status: int
    slug: str
    title: str
    about: str


VALIDATION = Kind(
    422,
    "invalid-request",
    "The request is not valid",
    "A field or parameter is missing, unknown, or cannot be used. `errors` names each by JSON pointer.",
)
INTERNAL = Kind(
    500,
    "internal-error",
    "Internal error",
    "The service failed in a way that it should not. The log has the cause under the request id.",
)
NO_ROUTE = Kind(404, "no-such-path", "No such path", "Nothing is served under this path; /docs lists the routes.")
METHOD = Kind(
    405,
    "method-not-allowed",
    "Method not allowed",
    "The path exists, the method does not; the header Allow lists those that do.",
)

OTHER = Kind(400, "http-error", "The request failed", "The request could not be read as HTTP; `detail` says more.")

# The most special exception of a request's comes first in its MRO, so bases may stand here too.
TABLE: Mapping[type[errors.DomainError], Kind] = {
    errors.NotFound: Kind(
        404, "not-found", "Not found", "There is no collection, submap or stored query of this name."
    ),
    errors.Unauthorized: Kind(
        401,
        "unauthorized",
        "No usable key",
        "The service asks for a key: send Authorization: Bearer urq_..., which the operator makes with "
        "urquhart keys create.",
    ),
    errors.Forbidden: Kind(
        403, "forbidden", "Not allowed", "The key is good, but lacks the scope for this, or sees only some collections."
    ),
    errors.Gone: Kind(410, "gone", "Gone", "It was here and is no longer kept; asking again will not bring it back."),
    errors.Conflict: Kind(409, "conflict", "Conflict", "The request contradicts what is stored; nothing was changed."),
    errors.KeyReused: Kind(
        422,
        "idempotency-key-reused",
        "Idempotency-Key used twice",
        "The key was sent before with other content. Take a new key for each request that is not a repetition.",
    ),
    errors.PreconditionFailed: Kind(
        412,
        "precondition-failed",
        "Precondition failed",
        "If-Match or If-None-Match does not hold: somebody wrote in between. Nothing was changed.",
    ),
    errors.TooLarge: Kind(
        413, "too-large", "Too large", "A limit is exceeded; `limit` names it as in GET /v1/limits. Nothing was stored."
    ),
    errors.NotAcceptable: Kind(
        406,
        "not-acceptable",
        "Not acceptable",
        "None of the media types in Accept can be produced; `offered` lists those that can.",
    ),
    errors.UnsupportedMediaType: Kind(
        415,
        "unsupported-media-type",
        "Unsupported media type",
        "Send the body as JSON, with Content-Type: application/json.",
    ),
    errors.MalformedBody: Kind(
        400,
        "malformed-json",
        "Malformed JSON",
        "The body is not JSON: RFC 8259, in UTF-8, without NaN and Infinity, nested at most 1,000 deep.",
    ),
    errors.InvalidField: VALIDATION,
    errors.InvalidLandmarks: Kind(
        422,
        "invalid-landmarks",
        "The landmarks cannot be used",
        "A submap needs at least 3 landmarks, not all on one line, each once, with finite coordinates.",
    ),
    errors.NotReady: Kind(
        503, "not-ready", "Not ready", "The service is starting; `check` names what is still open. Try again shortly."
    ),
    errors.StorageFull: Kind(
        507, "storage-full", "The disk is full", "Nothing was stored; what was stored before is intact."
    ),
    errors.StorageReadOnly: Kind(
        503,
        "storage-read-only",
        "The database cannot be written",
        "Reading works; writing needs write access to the file and its folder.",
    ),
    errors.StorageBusy: Kind(
        503, "storage-busy", "The database is busy", "Another writer holds it. Nothing was stored; try again shortly."
    ),
    errors.StorageDamaged: Kind(
        500, "storage-damaged", "The database is damaged", "The operator must check it and restore a backup."
    ),
    errors.StorageError: Kind(
        503, "storage-unavailable", "The database cannot be used", "The operator must look at the file and its disk."
    ),
}

KINDS: Mapping[str, Kind] = {
    kind.slug: kind for kind in (*TABLE.values(), VALIDATION, INTERNAL, NO_ROUTE, METHOD, OTHER)
}
_RETRY = {errors.StorageBusy, errors.NotReady}


def kind_of(error: errors.DomainError) -> Kind:
    """The kind of a domain error: that of its class or the nearest base in the table."""
    return next((TABLE[base] for base in type(error).__mro__ if base in TABLE), INTERNAL)


def problem(
    kind: Kind, detail: str, scope: Scope, *, headers: Mapping[str, str] | None = None, **members: Any
) -> Response:
    """A problem response; members that are None are left out."""
    content = {
        "type": f"/problems/{kind.slug}",
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "request_id": _request_id(scope),
        **members,
    }
    body = orjson.dumps({name: value for name, value in content.items() if value is not None})
    return Response(body, kind.status, headers=dict(headers or {}), media_type=MEDIA_TYPE)


def domain_problem(error: errors.DomainError, scope: Scope) -> Response:
    """The response for a domain error."""
    kind = kind_of(error)
    members: dict[str, Any] = {}
    headers: dict[str, str] = {}
    match error:
        case errors.TooLarge():
            members = {"limit": error.limit, "allowed": error.allowed, "got": error.got}
        case errors.PreconditionFailed():
            members = {"etag": error.etag}
            headers = {"ETag": f'"{error.etag}"'} if error.etag is not None else {}
        case errors.Unauthorized():
            headers = {"WWW-Authenticate": 'Bearer error="invalid_token"' if error.given else "Bearer"}
        case errors.NotAcceptable():
            members = {"offered": list(error.offered)}
        case errors.NotReady():
            members = {"check": error.check}
        case errors.InvalidField():
            entry = {"pointer": error.pointer, "parameter": error.parameter, "code": error.code, "detail": str(error)}
            members = {"errors": [{name: value for name, value in entry.items() if value is not None}]}
        case errors.InvalidLandmarks():
            entry = {"pointer": error.pointer, "code": error.code, "detail": str(error)}
            members = {"errors": [entry | ({"indices": list(error.indices)} if error.indices else {})]}
    if type(error) in _RETRY:
        headers["Retry-After"] = "1"
    if kind.status >= 500 and not isinstance(error, errors.NotReady):
        _log.error(
            "request %s: %s", _request_id(scope), error, exc_info=error.__cause__ if kind.status == 500 else None
        )
    return problem(kind, _detail(error), scope, headers=headers, **members)


def install(app: FastAPI) -> None:
    """Answer every exception of the app with a problem."""

    @app.exception_handler(errors.DomainError)
    async def on_domain_error(request: Request, error: errors.DomainError) -> Response:
        return domain_problem(error, request.scope)

    @app.exception_handler(RequestValidationError)
    async def on_invalid_request(request: Request, error: RequestValidationError) -> Response:
        entries = field_problems(error.errors())
        detail = entries[0]["detail"] if len(entries) == 1 else f"{len(entries)} things are wrong, see errors."
        where = entries[0].get("pointer") or entries[0].get("parameter") if len(entries) == 1 else None
        return problem(VALIDATION, f"{where}: {detail}" if where else detail, request.scope, errors=entries)

    @app.exception_handler(HTTPException)
    async def on_http_exception(request: Request, error: HTTPException) -> Response:
        if error.status_code == 404:
            return problem(NO_ROUTE, f"Nothing is served at {_short(request.url.path)}; see /docs.", request.scope)
        if error.status_code == 405:
            allow = ", ".join(sorted(_methods(app, request.url.path)))
            detail = f"{_short(request.method)} is not possible here; possible: {allow}."
            return problem(METHOD, detail, request.scope, headers={"Allow": allow})
        kind = replace(OTHER, status=error.status_code)
        return problem(kind, _short(str(error.detail)), request.scope, headers=error.headers)


def internal_problem(scope: Scope) -> Response:
    """What the caller is told of an unforeseen exception: nothing but where to look it up."""
    return problem(INTERNAL, "The service failed; its log has the cause under this request id.", scope)


def _request_id(scope: Scope) -> str | None:
    request_id: str | None = scope.get("state", {}).get("request_id")
    return request_id


def _detail(error: errors.DomainError) -> str:
    where = getattr(error, "pointer", None) or getattr(error, "parameter", None)
    return f"{where}: {error}" if where else str(error)


def _methods(app: FastAPI, path: str) -> set[str]:
    routers: Sequence[Any] = getattr(app.state, "routers", ())
    routes = [route for router in routers for route in router.routes] + list(app.routes)
    return {
        method
        for route in routes
        if getattr(route, "path_regex", None) is not None and route.path_regex.match(path)
        for method in route.methods or ()
    }


def _short(text: str) -> str:
    return text if len(text) <= 200 else f"{text[:200]}..."
