"""Uploads of many submaps, which become jobs."""

from typing import Annotated, Literal

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response

from server.errors import TooLarge, UnsupportedMediaType
from server.http.authorization import GuardedRoute
from server.http.body_limit import declared_length
from server.http.compression import Inflater
from server.http.negotiation import NDJSON
from server.http.responses import problems, stored_response
from server.jobs import queue
from server.jobs.quota import check_room
from server.jobs.upload import receive_upload
from server.platform.ids import new_id
from server.routes.dependencies import CollectionId, IdempotencyKeyHeader, PrincipalDep, ServiceDep, idempotency_key_of
from server.routes.jobs import ACCEPTED
from server.schemas.jobs import JobAnswer
from server.submaps.bulk import OnConflict

router = APIRouter(route_class=GuardedRoute, tags=["jobs"])
_INPUT = '{"id": "p7", "xy": [[1.2, 3.4], [4.9, -2.2], [-3.1, 0.7]]}\n'
_MEDIA_TYPES = frozenset({NDJSON, "application/ndjson", "application/jsonl"})


@router.post(
    "/v1/collections/{collection}/imports",
    operation_id="postImport",
    summary="Store many submaps",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(400, 404, 413, 415, 422, 503, 507)},
    openapi_extra={
        "requestBody": {
            "required": True,
            "description": "A line for each submap: the body of a PUT, with its `id`; Content-Encoding: gzip is fine.",
            "content": {NDJSON: {"schema": {"type": "string"}, "example": _INPUT}},
        }
    },
)
async def post_import(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    caller: PrincipalDep,
    on_conflict: Annotated[
        OnConflict, Query(description="Where an id is taken by other content: replace it, skip the line, or refuse it.")
    ] = "replace",
    mode: Annotated[
        Literal["continue", "all"], Query(description="Go on past lines that are refused, or store all or none.")
    ] = "continue",
    idempotency_key: IdempotencyKeyHeader = None,
) -> Response:
    """As NDJSON, which goes to the disk as it comes in; then a job stores it, with a line of result for each line.

    Nothing is taken on unless all of it arrives. An id that comes again in one upload is taken by the line before: with
    `on_conflict=replace` the last line stands, with `skip` and `fail` the first. Blank lines count for `import_lines`.
    """
    _check_media_type(request.headers.get("content-type"))
    inflater = _inflater(request.headers.get("content-encoding"))
    limits = service.settings.limits
    _check_length(declared_length(request.headers), limits.import_bytes)
    collection_key = await anyio.to_thread.run_sync(queue.check, service.database, collection)
    if idempotency_key is None:  # one that is sent again is answered whatever else waits
        await anyio.to_thread.run_sync(check_room, service.database, caller, limits)
    folder, job_id = service.jobs.folder, new_id()
    async with receive_upload(folder, job_id, request.stream(), limits, inflater) as arrived:
        key = idempotency_key_of(service, caller, idempotency_key, request.url.query.encode() + arrived.digest.encode())
        job = queue.NewJob(
            "import",
            {"on_conflict": on_conflict, "mode": mode},
            id=job_id,
            total=arrived.lines,
            collection_key=collection_key,
        )
        response = await anyio.to_thread.run_sync(queue.accept, service.database, collection, caller, job, key, limits)
    if response.replayed:
        folder.remove(job_id)
    service.jobs.runner.wake()
    return stored_response(response)


def _check_length(declared: int | None, limit: int) -> None:
    """Before a byte is read: nobody should send gigabytes to be told that it was for nothing."""
    if declared is not None and declared > limit:
        raise TooLarge("import_bytes", limit, declared, "Send it in parts.")


def _check_media_type(content_type: str | None) -> None:
    name = (content_type or "nothing").split(";")[0].strip().lower()
    if name not in _MEDIA_TYPES:
        raise UnsupportedMediaType(f"Content-Type says {name[:100]}; send NDJSON with Content-Type: {NDJSON}.")


def _inflater(encoding: str | None) -> Inflater | None:
    name = (encoding or "identity").strip().lower()
    if name in ("gzip", "x-gzip"):
        return Inflater()
    if name != "identity":
        raise UnsupportedMediaType(f"Content-Encoding says {name[:50]!r}; send gzip, or the lines as they are.")
    return None
