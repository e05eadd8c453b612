"""What routes ask for: the service's parts, preconditions, JSON bodies; and how they answer."""

import hashlib
import math
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated, Any
from urllib.parse import urlencode

import orjson
from fastapi import Depends, Header, Path, Query, Request, Response
from pydantic import BaseModel, BeforeValidator

from server.access import Caller
from server.http.authorization import get_caller, get_visitor
from server.http.gate import Gate
from server.http.problems import MEDIA_TYPE
from server.http.readiness import Readiness
from server.http.repetitions import Repetitions
from server.http.waits import JobWaits
from server.idempotency import Kept, Once
from server.index.catalog import Catalog
from server.index.upkeep import Upkeep
from server.jobs.folder import JobFolder
from server.jobs.runner import Runner
from server.metrics.exchange import Exchange
from server.metrics.metrics import Metrics
from server.preconditions import Preconditions
from server.rates import Rates
from server.schemas.common import (
    PROBLEM_EXAMPLE,
    Problem,
    ResourceId,
    check_digits,
    to_json,
)
from server.settings import Limits, Settings
from server.snapshots.snapshot_folder import SnapshotFolder
from server.store.database import Database

_ETAG = re.compile(r'\s*(?:W/)?"([^"]*)"\s*')


@dataclass(frozen=True, slots=True)
class JobRoom:
    """Where jobs lie, and who does them."""

    folder: JobFolder
    runner: Runner


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of a running service."""

    settings: Settings
    database: Database
    catalog: Catalog
    metrics: Metrics
    readiness: Readiness
    upkeep: Upkeep
    jobs: JobRoom
    rates: Rates
    exchange: Exchange | None
    gate: Gate
    snapshots: SnapshotFolder
    repetitions: Repetitions
    waits: JobWaits

    def hand_back(self) -> None:
        """Let jobs and the upkeep of the index end soon; what they did not finish is gone on with at the next start."""
        self.catalog.stopping.set()
        self.jobs.runner.hand_back()

    @property
    def limits(self) -> Limits:
        """The limits in force. While the kernels are still being compiled or loaded, queries have no deadline: the
        first ones wait for that.
        """
        if self.readiness.is_open("kernels"):
            return self.settings.limits.model_copy(update={"query_seconds": math.inf, "batch_seconds": math.inf})
        return self.settings.limits


# Not `async` for what they wait for: the framework would send a plain function to a thread and back.
async def get_service(request: Request) -> Service:
    """The service that the app was built with."""
    service: Service = request.app.state.service
    return service


async def get_preconditions(
    if_match: Annotated[str | None, Header(description="Only if the entity tag is this one; * for any.")] = None,
    if_none_match: Annotated[str | None, Header(description="Only if it is not this one; * for nothing there.")] = None,
) -> Preconditions:
    """If-Match and If-None-Match."""
    return Preconditions(_tags(if_match), _tags(if_none_match))


IdempotencyKey = Annotated[
    str | None,
    Header(
        description="The same for every attempt to send this request: what was done is not done again.",
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
    ),
]


def once_of(service: Service, caller: Caller, key: str | None, sent: bytes) -> Once | None:
    """What tells a request, and all that was sent with it, from others; None without a key."""
    if key is None:
        return None
    return Once(caller.id, key, hashlib.sha256(sent).hexdigest(), service.settings.idempotency_hours)


async def get_once(
    request: Request,
    caller: Annotated[Caller, Depends(get_caller)],
    service: Annotated[Service, Depends(get_service)],
    idempotency_key: IdempotencyKey = None,
) -> AsyncIterator[Once | None]:
    """What tells this request from others; None without Idempotency-Key.

    While another attempt to send it is at work in this process, it waits for that one. Raises StillRunning.
    """
    if idempotency_key is None:
        yield None  # most queries have none: their bodies are not copied for it
        return
    conditions = [request.headers.get(name) for name in ("if-match", "if-none-match")]
    about = "".join(f"\n{condition}" for condition in conditions if condition is not None)
    sent = f"{request.url.query}{about}\n".encode() + await request.body()
    async with service.repetitions.turn((caller.id, request.method, request.url.path, idempotency_key)):
        yield once_of(service, caller, idempotency_key, sent)


ServiceDep = Annotated[Service, Depends(get_service)]
CallerDep = Annotated[Caller, Depends(get_caller)]
OnceDep = Annotated[Once | None, Depends(get_once)]
VisitorDep = Annotated[Caller, Depends(get_visitor)]
PreconditionsDep = Annotated[Preconditions, Depends(get_preconditions)]
Accept = Annotated[str | None, Header(description="Media types that the answer may have.")]
IfNoneMatch = Annotated[str | None, Header(description="Entity tag of what the caller has; 304 when it is current.")]
CollectionId = Annotated[
    ResourceId,
    Path(description="1 to 128 letters, digits, '.', '_', '~', '-'.", examples=["plots"], alias="collection"),
]
PageLimit = Annotated[
    int | None, BeforeValidator(check_digits), Query(description="Rows of the page, at most 1000.", examples=[100])
]
PageCursor = Annotated[str | None, Query(description="`next` of the page before.")]
SubmapId = Annotated[
    ResourceId, Path(description="1 to 128 letters, digits, '.', '_', '~', '-'.", examples=["p7"], alias="submap")
]


def json_response(
    content: BaseModel | dict[str, Any] | bytes,
    status: int = 200,
    *,
    media_type: str = "application/json",
    headers: dict[str, str] | None = None,
) -> Response:
    """An answer as JSON, in which NaN and Infinity cannot occur; `next` and `query` are left out when there is none."""
    match content:
        case BaseModel():
            body = to_json(content)
        case dict():
            body = orjson.dumps(content)
        case _:
            body = content
    return Response(body, status, headers=headers, media_type=media_type)


def kept_response(kept: Kept) -> Response:
    """An answer that was kept, or would be if it were asked for."""
    headers = kept.headers | ({"Idempotency-Replayed": "true"} if kept.replayed else {})
    return Response(kept.body, kept.status, headers=headers, media_type="application/json" if kept.body else None)


def etag_header(etag: str) -> dict[str, str]:
    """The header that carries an entity tag."""
    return {"ETag": f'"{etag}"'}


def next_link(path: str, request: Request, cursor: str) -> str:
    """Value of the header Link for the next page of a listing."""
    return f'<{path}?{urlencode({**request.query_params, "cursor": cursor})}>; rel="next"'


def not_modified(if_none_match: str | None, etag: str, *, vary: str | None = None) -> Response | None:
    """304 when the caller has what is current, else None; with the header Vary that the whole answer would have."""
    tags = _tags(if_none_match)
    if tags is not None and (etag in tags or "*" in tags):
        return Response(status_code=304, headers=etag_header(etag) | ({} if vary is None else {"Vary": vary}))
    return None


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Documentation of a route's error responses."""
    described = {
        400: "The body is not JSON.",
        401: "No usable key, where keys are asked for.",
        403: "The key does not allow this.",
        404: "Not found.",
        405: "Method not allowed.",
        406: "Not acceptable.",
        408: "The request did not arrive in time.",
        409: "Conflict with what is stored.",
        410: "No longer kept.",
        412: "A precondition does not hold.",
        413: "A limit is exceeded.",
        415: "The body is not sent as JSON.",
        416: "The file does not reach to where the range begins.",
        422: "The request is not valid.",
        429: "This key, or address, asks too often.",
        500: "Internal error.",
        503: "Not ready, overloaded, or the database is busy or cannot be written.",
        507: "The disk is full.",
    }
    return {
        status: {
            "description": described[status],
            "content": {
                MEDIA_TYPE: {
                    "schema": {"$ref": f"#/components/schemas/{Problem.__name__}"},
                    "example": PROBLEM_EXAMPLE | {"status": status},
                }
            },
        }
        for status in (*statuses, 500)
    }


def _tags(header: str | None) -> tuple[str, ...] | None:
    if header is None:
        return None
    if header.strip() == "*":
        return ("*",)
    return tuple(match.group(1) if (match := _ETAG.fullmatch(part)) else part.strip() for part in header.split(","))
