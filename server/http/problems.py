"""Every error becomes application/problem+json (RFC 9457)."""

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import orjson
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import Scope

from server import errors
from server.http.route_lookup import allowed_methods
from server.parsing.field_errors import describe, field_problems
from server.problem_types import (
    INTERNAL,
    METHOD,
    NO_ROUTE,
    OTHER,
    VALIDATION,
    ProblemType,
    document,
    plain,
    problem_type_of,
)

MEDIA_TYPE = "application/problem+json"
_log = logging.getLogger("server")


_RETRY = {errors.StorageBusy, errors.NotReady}


def problem(
    kind: ProblemType, detail: str, scope: Scope, *, headers: Mapping[str, str] | None = None, **members: Any
) -> Response:
    """A problem response. Members that are None are left out."""
    return _response(plain(kind, detail) | members, scope, headers or {})


def domain_problem(error: errors.DomainError, scope: Scope) -> Response:
    """The response for a domain error."""
    kind = problem_type_of(error)
    headers: dict[str, str] = {}
    match error:
        case errors.PreconditionFailed() if error.etag is not None:
            headers = {"ETag": f'"{error.etag}"'}
        case errors.Unauthorized():
            headers = {"WWW-Authenticate": 'Bearer error="invalid_token"' if error.given else "Bearer"}
        case errors.Busy():
            headers = {"Retry-After": str(max(1, math.ceil(error.retry_after)))}
        case errors.TooSlow():
            headers = {"Connection": "close"}
    if type(error) in _RETRY:
        headers["Retry-After"] = "1"
    # Overload and rate limits are only counted, because a log line for each would make them worse.
    if kind.status >= 500 and not isinstance(error, errors.NotReady | errors.Busy | errors.DeadlineExceeded):
        _log.error(
            "request %s: %s", _request_id(scope), error, exc_info=error.__cause__ if kind.status == 500 else None
        )
    errors.forget_frames(error)
    return _response(document(error), scope, headers)


def install(app: FastAPI) -> None:
    """Answer every exception of the app with a problem document."""

    @app.exception_handler(errors.DomainError)
    async def on_domain_error(request: Request, error: errors.DomainError) -> Response:
        return domain_problem(error, request.scope)

    @app.exception_handler(RequestValidationError)
    async def on_invalid_request(request: Request, error: RequestValidationError) -> Response:
        entries = field_problems(error.errors())
        errors.forget_frames(error)
        return problem(VALIDATION, describe(entries), request.scope, errors=entries)

    @app.exception_handler(HTTPException)
    async def on_http_exception(request: Request, error: HTTPException) -> Response:
        if error.status_code == 404:
            return problem(NO_ROUTE, f"Nothing is served at {_short(request.url.path)}; see /docs.", request.scope)
        if error.status_code == 405:
            allow = ", ".join(sorted(allowed_methods(app, request.url.path)))
            if request.method == "OPTIONS":
                return Response(status_code=204, headers={"Allow": allow})
            detail = f"{_short(request.method)} is not possible here; possible: {allow}."
            return problem(METHOD, detail, request.scope, headers={"Allow": allow})
        kind = replace(OTHER, status=error.status_code)
        return problem(kind, _short(str(error.detail)), request.scope, headers=error.headers)


def internal_problem(scope: Scope) -> Response:
    """The answer to an unexpected exception. It says only where to find the cause."""
    return problem(INTERNAL, "The service failed; its log has the cause under this request id.", scope)


def _request_id(scope: Scope) -> str | None:
    request_id: str | None = scope.get("state", {}).get("request_id")
    return request_id


def _response(content: Mapping[str, Any], scope: Scope, headers: Mapping[str, str]) -> Response:
    told = {name: value for name, value in content.items() if value is not None} | {"request_id": _request_id(scope)}
    return Response(orjson.dumps(told), content["status"], headers=dict(headers), media_type=MEDIA_TYPE)


def _short(text: str) -> str:
    return text if len(text) <= 200 else f"{text[:200]}..."
