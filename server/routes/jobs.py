"""Long work: accepted, followed, dismissed, and its results."""

from collections.abc import Iterator
from typing import Annotated, Any

import anyio
import anyio.to_thread
from fastapi import APIRouter, Path, Query, Request, Response
from starlette.responses import StreamingResponse

from server.constraints.extraction import check_ids, chosen_submaps
from server.http.admission.admission import AdmissionDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON, NDJSON
from server.http.responses import json_response, next_link, problems, stored_response
from server.jobs import queue
from server.resources.paging import PageRequest
from server.routes.dependencies import CollectionId, IdempotencyKeyDep, PageCursor, PageLimit, PrincipalDep, ServiceDep
from server.schemas.constraints import CONSTRAINT_EXAMPLE, ConstraintFormat, ConstraintsInput
from server.schemas.jobs import JOB_EXAMPLE, JobAnswer, JobPage, JobState

router = APIRouter(route_class=JsonRoute, tags=["jobs"])
_JOB = {"content": {JSON: {"example": JOB_EXAMPLE}}}
ACCEPTED = {"description": "Taken on; `Location` is the job.", "model": JobAnswer, **_JOB}
"""How the answer of a route that takes a job on is described."""
_LINE = '{"line": 1, "id": "p1", "outcome": "created", "revision": 4}\n'
_LINES = {"content": {NDJSON: {"schema": {"type": "string"}, "example": _LINE}}}
STALE = "X-Stale-Constraints"
"""Header of results: how many constraints are of submaps that changed or went since."""
_RESULTS: dict[str, Any] = {
    "headers": {STALE: {"description": "How many constraints are stale.", "schema": {"type": "integer"}}},
    "content": {
        **_LINES["content"],
        JSON: {"schema": {"type": "object"}, "example": {"constraints": [CONSTRAINT_EXAMPLE]}},
        "text/plain": {
            "schema": {"type": "string"},
            "example": "EDGE_SE2 0 1 1.2 -0.4 0.31 900 0 0 900 0 4e5\n# 0 p7\n# 1 q3\n",
        },
    },
}
_PIECE = 1 << 18
"""Bytes of results that are read and sent at once."""
JobId = Annotated[str, Path(description="`id` of the job.", examples=[JOB_EXAMPLE["id"]], alias="job", max_length=64)]


@router.post(
    "/v1/collections/{collection}/reindex",
    operation_id="postReindex",
    summary="Rewrite the index",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(404, 409, 422, 429, 503, 507)},
)
def post_reindex(
    collection: CollectionId, service: ServiceDep, caller: PrincipalDep, idempotency_key: IdempotencyKeyDep
) -> Response:
    """From the landmarks; the old index serves until the new one takes its place. 409 while one is at work."""
    response = queue.accept(
        service.database,
        collection,
        caller,
        queue.NewJob("reindex", exclusive=True),
        idempotency_key,
        service.settings.limits,
    )
    service.jobs.runner.wake()
    return stored_response(response)


@router.post(
    "/v1/collections/{collection}/constraints",
    operation_id="postConstraints",
    summary="Find how submaps lie to each other",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(400, 404, 413, 415, 422, 503, 507)},
)
def post_constraints(
    collection: CollectionId,
    body: ConstraintsInput,
    service: ServiceDep,
    caller: PrincipalDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Each chosen submap is looked up in all others; what is accepted becomes a constraint `from_T_to` of a pose graph,
    one for each pair. The job's results come as NDJSON, JSON, g2o or 4 x 4 matrices.
    """
    chosen_submaps(body)
    check_ids(service.database, collection, body)
    response = queue.accept(
        service.database,
        collection,
        caller,
        queue.NewJob("constraints", body.model_dump(mode="json")),
        idempotency_key,
        service.settings.limits,
    )
    service.jobs.runner.wake()
    return stored_response(response)


@router.get(
    "/v1/jobs",
    operation_id="listJobs",
    summary="List the jobs",
    response_model=JobPage,
    responses={200: {"content": {JSON: {"example": {"jobs": [JOB_EXAMPLE]}}}}, **problems(422, 503)},
)
def list_jobs(
    request: Request,
    service: ServiceDep,
    caller: PrincipalDep,
    state: Annotated[JobState | None, Query(description="Only jobs in this state.")] = None,
    collection: Annotated[str | None, Query(description="Only jobs on this collection.", max_length=128)] = None,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """The newest first, of the collections that the key sees; `next` is not there on the last page."""
    page = queue.page(
        service.database,
        service.settings.limits,
        caller,
        PageRequest(limit, cursor),
        state=state,
        collection_id=collection,
    )
    headers = {} if page.next is None else {"Link": next_link("/v1/jobs", request, page.next)}
    return json_response(page, headers=headers)


@router.get(
    "/v1/jobs/{job}",
    operation_id="getJob",
    summary="Follow a job",
    response_model=JobAnswer,
    responses={200: _JOB, **problems(404, 422, 503)},
)
async def get_job(
    job: JobId,
    service: ServiceDep,
    caller: PrincipalDep,
    request: AdmissionDep,
    wait: Annotated[
        float, Query(ge=0, le=60, description="Seconds to wait for its end before answering.", examples=[25])
    ] = 0.0,
) -> Response:
    """How far it is. `Retry-After` says when to ask again, as long as it is not finished. Where too many callers wait
    already (`waits`, `key_waits` in GET /v1/limits), the answer comes at once.
    """
    found = await anyio.to_thread.run_sync(queue.read, service.database, caller, job)
    if wait and found.finished is None and not service.readiness.stopping:
        request.step_aside()
        await service.waits.until_finished(job, wait, request)
        request.check()
        async with service.waits.readers:
            found = await anyio.to_thread.run_sync(queue.read, service.database, caller, job)
    return json_response(found, headers={} if found.finished is not None else {"Retry-After": "1"})


@router.delete(
    "/v1/jobs/{job}",
    operation_id="deleteJob",
    summary="Dismiss or forget a job",
    response_class=Response,
    status_code=204,
    responses={202: ACCEPTED | {"description": "It ends after what is in progress."}, **problems(404, 422, 503, 507)},
)
def delete_job(job: JobId, service: ServiceDep, caller: PrincipalDep, idempotency_key: IdempotencyKeyDep) -> Response:
    """An unfinished job ends after the work in progress, and keeps what it did (202); a finished one is forgotten with
    its results (204). A key may dismiss its own jobs whatever its scope; those of others need `write` or `admin`.
    """
    response = queue.dismiss(service.database, service.jobs.folder, caller, job, idempotency_key)
    service.jobs.runner.wake()
    return stored_response(response)


@router.get(
    "/v1/jobs/{job}/results",
    operation_id="getJobResults",
    summary="What came of a job",
    response_class=Response,
    responses={200: _RESULTS, **problems(404, 409, 410, 422, 503)},
)
def get_job_results(
    job: JobId,
    service: ServiceDep,
    caller: PrincipalDep,
    wanted: Annotated[
        ConstraintFormat | None,
        Query(alias="format", description="Format of constraints; ndjson by default."),
    ] = None,
    frame_id: Annotated[
        str | None,
        Query(
            description="With `format=g2o`: the map's frame that vertices begin in; by default that of most of "
            "its submaps.",
            max_length=128,
        ),
    ] = None,
) -> Response:
    """Of an import: for each line of input a line with its number, `outcome`, and `problem` where it was refused.
    `created`, `replaced`, `unchanged` are as of a PUT. `skipped` is left out: for what is there, with on_conflict=skip;
    or, with mode=all, because other lines were refused. Of very many refused lines later ones are shortened, and
    those beyond `import_refusal_bytes` are counted: one line for each kind of problem, with `lines`, the first (`line`)
    and the `last_line`.

    Of constraints: a line for each, `from`, `to` and the transform from_T_to; or all of them in another `format`. Those
    whose submaps changed or went since say `stale`. g2o and matrices leave these out, and the header
    `X-Stale-Constraints` counts them. In `g2o_middle` each vertex lies among the trees of its submap instead of at the
    origin of its frame, at the coordinates that are written behind its name: for coordinates far from the origin.
    """
    left = queue.results(service.database, service.jobs.folder, caller, job)
    if wanted is None and left.kind != "constraints":
        return StreamingResponse(_pieces(left), media_type=NDJSON)
    written = wanted or "ndjson"
    content, stale = queue.constraints(service.database, left, written, frame_id)
    media_type = {"ndjson": NDJSON, "json": JSON}.get(written, "text/plain")
    return Response(content, media_type=media_type, headers={STALE: str(stale)})


@router.get(
    "/v1/jobs/{job}/errors",
    operation_id="getJobErrors",
    summary="What a job refused",
    response_class=Response,
    responses={200: _LINES, **problems(404, 409, 410, 422, 503)},
)
def get_job_errors(job: JobId, service: ServiceDep, caller: PrincipalDep) -> Response:
    """The lines of the results that tell of something refused."""
    found = queue.results(service.database, service.jobs.folder, caller, job)
    return StreamingResponse(_refused(found), media_type=NDJSON)


def _pieces(found: queue.Results) -> Iterator[bytes]:
    left = found.size
    with found.file as file:
        while piece := file.read(min(_PIECE, left)):
            left -= len(piece)
            yield piece
    yield found.rest


def _refused(found: queue.Results) -> Iterator[bytes]:
    """In large pieces: each one that is handed over costs more than many lines."""
    left, piece = found.size, bytearray()
    with found.file as file:
        while left > 0 and (line := file.readline()):
            left -= len(line)
            if b'"outcome":"refused"' in line:
                piece += line
            if len(piece) >= _PIECE:
                yield bytes(piece)
                piece.clear()
    yield bytes(piece) + found.rest
