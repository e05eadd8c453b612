"""What every request gets before routing: an id, a log line, a count and a duration."""

import logging
import re
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.http.problems import internal_problem
from server.http.route_lookup import matched
from server.observability.logs import log_access, quoted, shortened
from server.observability.metrics import Metrics
from server.observability.request_notes import RequestNotes
from server.observability.request_notes import begin as begin_notes

_log = logging.getLogger("server")
_GIVEN_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")


def new_request_id() -> str:
    """An id for a request without a usable one of its own."""
    return secrets.token_hex(8)


@dataclass(slots=True)
class _Seen:
    """What is recorded of a request and its answer: status, sizes of the bodies, and whether the answer has begun."""

    status: int = 500
    bytes_in: int = 0
    bytes_out: int = 0
    begun: bool = False


class RequestLogging:
    """Gives each request an id (the caller's X-Request-Id if it is plain text), counts it, and answers HEAD like GET.

    Each request is one line in the log, without its content. An unhandled exception is logged with the id and answered
    as a problem.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _GIVEN_ID.fullmatch(given) else new_request_id()
        method = scope["method"]
        # A copy of the state, because all requests share that of the lifespan.
        state = {**scope.get("state", {}), "request_id": request_id}
        scope = {**scope, "headers": _folded(scope["headers"]), "state": state}
        if method == "HEAD":
            scope["method"] = "GET"
        seen = _Seen()
        started = time.perf_counter()
        notes = begin_notes()

        async def receive_counting() -> Message:
            message = await receive()
            seen.bytes_in += len(message.get("body", b""))
            return message

        async def send_with_id(message: Message) -> None:
            if message["type"] == "http.response.start":
                seen.begun, seen.status = True, message["status"]
                MutableHeaders(scope=message)["X-Request-Id"] = request_id
            elif message["type"] == "http.response.body":
                if method == "HEAD":
                    message = {**message, "body": b""}
                seen.bytes_out += len(message.get("body", b""))
            await send(message)

        try:
            await self._app(scope, receive_counting, send_with_id)
        except ClientDisconnect:
            seen.status = 499  # logged as usual for a caller that has gone; nobody is left to answer
        except Exception:
            _log.exception("request %s: %s %s failed", request_id, quoted(method), quoted(scope["path"]))
            if seen.begun:
                raise
            await internal_problem(scope)(scope, receive, send_with_id)
        finally:
            self._record(scope, method, seen, time.perf_counter() - started, notes)

    def _record(self, scope: Scope, method: str, seen: _Seen, seconds: float, notes: RequestNotes) -> None:
        """Count the request and write its log line. `method` is that of the request."""
        route, parameters = _route(scope)
        labelled = method if method in _METHODS else "other"
        self._metrics.requests.labels(route, labelled, str(seen.status)).inc()
        self._metrics.request_seconds.labels(route, labelled).observe(seconds)
        caller = scope["state"].get("caller")
        log_access(
            {
                "request_id": scope["state"]["request_id"],
                "method": method if labelled == method else method[:20],
                "route": route,
                "path": shortened(scope["path"]),
                "status": seen.status,
                "ms": round(seconds * 1e3, 2),
                "bytes_in": seen.bytes_in,
                "bytes_out": seen.bytes_out,
                "address": address[0] if (address := scope.get("client")) else "",
                "key": caller.id if caller is not None else "",
                "collection": parameters.get("collection", ""),
                **notes.log_members(),
            }
        )


def _route(scope: Scope) -> tuple[str, Mapping[str, str]]:
    """Template and parameters of the request's path; `unmatched` if no route serves it."""
    template = getattr(scope.get("route"), "path", None)
    if template is not None:
        return template, scope.get("path_params", {})
    return matched(scope["app"], scope["path"]) or ("unmatched", {})


_LISTS = frozenset(
    (b"accept", b"accept-encoding", b"content-encoding", b"idempotency-key", b"if-match", b"if-none-match")
)


def _folded(headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """Join headers that are lists and came in several lines, so that nobody reads only the first line."""
    names = [name for name, _ in headers if name in _LISTS]
    if len(names) == len(set(names)):
        return headers
    values: dict[bytes, list[bytes]] = {}
    for name, value in headers:
        if name in _LISTS:
            values.setdefault(name, []).append(value)
    others = [(name, value) for name, value in headers if name not in _LISTS]
    return others + [(name, b", ".join(lines)) for name, lines in values.items()]


_METHODS = frozenset({"GET", "HEAD", "PUT", "POST", "PATCH", "DELETE", "OPTIONS"})
