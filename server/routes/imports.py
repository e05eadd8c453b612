"""The route that uploads many submaps, which a job then stores."""

from typing import Annotated, Literal

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response
from starlette.datastructures import Headers

from server.errors import TooLarge, UnsupportedMediaType
from server.http.authorization import GuardedRoute
from server.http.body_limit import declared_length
from server.http.compression import Inflater
from server.http.negotiation import NDJSON
from server.http.responses import lines_of, problems, stored_response
from server.jobs import queue
from server.jobs.quota import check_room
from server.jobs.upload import UploadForm, receive_upload
from server.platform.ids import new_id
from server.routes.dependencies import CollectionId, IdempotencyKeyHeader, PrincipalDep, ServiceDep, idempotency_key_of
from server.routes.jobs import ACCEPTED
from server.schemas.jobs import JobAnswer
from server.schemas.submaps import NamedSubmap
from server.submaps.bulk_ingest import OnConflict

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
            "description": "One submap on each line: the body of a PUT plus its `id`. gzip is accepted.",
            "content": {NDJSON: {"schema": lines_of(NamedSubmap), "example": _INPUT}},
        }
    },
)
async def post_import(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    caller: PrincipalDep,
    on_conflict: Annotated[
        OnConflict,
        Query(description="If an id has other content: replace it, skip the line, or refuse the line (`fail`)."),
    ] = "replace",
    mode: Annotated[
        Literal["continue", "all"], Query(description="`continue` past refused lines, or store `all` lines or none.")
    ] = "continue",
    idempotency_key: IdempotencyKeyHeader = None,
) -> Response:
    """Uploads submaps as NDJSON. A job then stores them, with one result for each line.

    An upload counts only when complete. If an id comes twice in one upload, the last line counts with
    `on_conflict=replace`, the first with `skip` and `fail`. Blank lines count towards `import_lines`.
    """
    _check_media_type(request.headers.get("content-type"))
    inflater = inflater_of(request.headers.get("content-encoding"))
    limits = service.settings.limits
    check_length(request.headers, limits.import_bytes)
    collection_key = await anyio.to_thread.run_sync(queue.check, service.database, collection)
    if idempotency_key is None:  # a repetition gets its answer however many jobs wait
        await anyio.to_thread.run_sync(check_room, service.database, caller, limits)
    folder, job_id = service.jobs.folder, new_id()
    async with receive_upload(folder, job_id, request.stream(), limits, UploadForm(inflater)) as arrived:
        key = idempotency_key_of(service, caller, idempotency_key, request.url.query.encode() + arrived.digest.encode())
        job = queue.NewJob(
            "import",
            {"on_conflict": on_conflict, "mode": mode},
            id=job_id,
            total=arrived.lines,
            collection_key=collection_key,
        )
        response = await anyio.to_thread.run_sync(service.accept_job, collection, caller, job, key)
    if response.replayed:
        folder.remove(job_id)
    return stored_response(response)


def check_length(headers: Headers, limit: int) -> None:
    """Refuse an upload that says it is too large before reading it. Raises TooLarge."""
    declared = declared_length(headers)
    if declared is not None and declared > limit:
        raise TooLarge("import_bytes", limit, declared, "Split the upload into parts.")


def _check_media_type(content_type: str | None) -> None:
    name = (content_type or "nothing").split(";")[0].strip().lower()
    if name not in _MEDIA_TYPES:
        raise UnsupportedMediaType(f"Content-Type is {name[:100]}. Send NDJSON with Content-Type: {NDJSON}.")


def inflater_of(encoding: str | None) -> Inflater | None:
    """What unpacks an upload with this Content-Encoding; None if nothing need. Raises UnsupportedMediaType."""
    name = (encoding or "identity").strip().lower()
    if name in ("gzip", "x-gzip"):
        return Inflater()
    if name != "identity":
        raise UnsupportedMediaType(f"Content-Encoding is {name[:50]!r}. Send gzip, or the bytes without an encoding.")
    return None
