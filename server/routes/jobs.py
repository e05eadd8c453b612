"""Routes of jobs: start, follow and cancel them, read their results."""

from collections.abc import Iterator
from typing import Annotated, Any

import anyio
import anyio.to_thread
from fastapi import APIRouter, Path, Query, Request, Response
from starlette.responses import StreamingResponse

from server.constraints.extraction import check_ids, chosen_submaps
from server.http.admission.request_admission import AdmissionDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON, NDJSON
from server.http.responses import json_response, lines_of, next_link, problems, stored_response
from server.jobs import queue
from server.resources.paging import PageRequest
from server.routes.dependencies import CollectionId, IdempotencyKeyDep, PageCursor, PageLimit, PrincipalDep, ServiceDep
from server.schemas.constraints import (
    CONSTRAINT_EXAMPLE,
    Constraint,
    ConstraintFormat,
    ConstraintList,
    ConstraintsInput,
)
from server.schemas.files.coregistrations import PlotRow
from server.schemas.jobs import JOB_EXAMPLE, JobAnswer, JobPage, JobState, LineResult

router = APIRouter(route_class=JsonRoute, tags=["jobs"])
_JOB = {"content": {JSON: {"example": JOB_EXAMPLE}}}
ACCEPTED = {"description": "The job is accepted; `Location` is its path.", "model": JobAnswer, **_JOB}
"""Documentation of the answer of a route that starts a job."""
_LINE = '{"line": 1, "id": "p1", "outcome": "created", "revision": 4}\n'
_LINES = {"content": {NDJSON: {"schema": lines_of(LineResult), "example": _LINE}}}
STALE = "X-Stale-Constraints"
"""Header of results: number of constraints between submaps of which one was changed or deleted since."""
_RESULTS: dict[str, Any] = {
    "headers": {STALE: {"description": "How many constraints are stale.", "schema": {"type": "integer"}}},
    "content": {
        NDJSON: {"schema": lines_of(LineResult, Constraint, PlotRow), "example": _LINE},
        JSON: {
            "schema": {"$ref": f"#/components/schemas/{ConstraintList.__name__}"},
            "example": {"constraints": [CONSTRAINT_EXAMPLE]},
        },
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
    """Rebuilds the index from the landmarks. Queries use the old index until the new one is complete. 409 if a rebuild
    is already running.
    """
    job = queue.NewJob("reindex", exclusive=True)
    return stored_response(service.accept_job(collection, caller, job, idempotency_key))


@router.post(
    "/v1/collections/{collection}/constraints",
    operation_id="postConstraints",
    summary="Find constraints between submaps",
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
    """Looks each chosen submap up in all others. Each accepted match becomes a constraint `from_T_to` of a pose graph,
    one for each pair. The job's results are available as NDJSON, JSON, g2o and 4 x 4 matrices.
    """
    chosen_submaps(body)
    check_ids(service.database, collection, body)
    job = queue.NewJob("constraints", body.model_dump(mode="json"))
    return stored_response(service.accept_job(collection, caller, job, idempotency_key))


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
    """Lists jobs of the collections that the key may see, newest first. The last page has no `next`."""
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
        float, Query(ge=0, le=60, description="Seconds to wait for the end of the job before answering.", examples=[25])
    ] = 0.0,
) -> Response:
    """Returns the progress of a job. Until it is finished, `Retry-After` says when to ask again. If too many callers
    wait already (`job_waits`, `key_job_waits` in GET /v1/limits), the answer comes at once.
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
    summary="Cancel or forget a job",
    response_class=Response,
    status_code=204,
    responses={
        202: ACCEPTED | {"description": "The job will end after the work in progress."},
        **problems(404, 422, 503, 507),
    },
)
def delete_job(job: JobId, service: ServiceDep, caller: PrincipalDep, idempotency_key: IdempotencyKeyDep) -> Response:
    """Ends an unfinished job after the work in progress; what it has stored stays (202). Deletes a finished job with
    its results (204). A key may cancel its own jobs with any scope; those of others need `write` or `admin`.
    """
    response = queue.cancel(service.database, service.jobs.folder, caller, job, idempotency_key)
    service.jobs.runner.wake()
    return stored_response(response)


@router.get(
    "/v1/jobs/{job}/results",
    operation_id="getJobResults",
    summary="Read the results of a job",
    response_class=Response,
    responses={200: _RESULTS, **problems(404, 409, 410, 422, 503)},
)
def get_job_results(
    job: JobId,
    service: ServiceDep,
    caller: PrincipalDep,
    wanted: Annotated[
        ConstraintFormat | None,
        Query(alias="format", description="Format of constraints. Default: ndjson."),
    ] = None,
    frame_id: Annotated[
        str | None,
        Query(
            description="With `format=g2o`: the map frame in which vertices start. Default: the frame of most submaps.",
            max_length=128,
        ),
    ] = None,
) -> Response:
    """Imports: one line for each line of the upload, with its number, `outcome`, and the `problem` if it was refused.
    `created`, `replaced` and `unchanged` mean the same as for PUT. `skipped` lines were not stored: the id is taken
    (on_conflict=skip), or another line was refused (mode=all). If very many lines are refused, later ones are
    shortened, and those beyond `import_refusal_bytes` are only counted: one line for each kind of problem, with the
    number of `lines`, the first (`line`) and the `last_line`.

    Constraints: one line for each, with `from`, `to` and the transform from_T_to; or all in another `format`.
    Constraints of submaps that were changed or deleted since are `stale`; g2o and matrices leave them out, and the
    header `X-Stale-Constraints` counts them. `g2o_middle` is for coordinates far from the origin: each vertex lies
    among the trees of its submap, at the coordinates that follow its name in the comments.

    Coregistrations: one line for each plot, as in `plots.csv` of the job's files.
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
    summary="Read the refused lines of a job",
    response_class=Response,
    responses={200: _LINES, **problems(404, 409, 410, 422, 503)},
)
def get_job_errors(job: JobId, service: ServiceDep, caller: PrincipalDep) -> Response:
    """Returns only the results of refused lines."""
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
    """Lines of refused results in large pieces, because sending a piece costs more than many lines."""
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
