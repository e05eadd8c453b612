"""Routes of coregistrations: files of plots in, a job that places them in a map, and the files that it writes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final
from urllib.parse import quote

import anyio.to_thread
from fastapi import APIRouter, Path, Request, Response
from starlette.responses import StreamingResponse

from server.coregistration.requests import archive
from server.coregistration.requests.archive import ARCHIVE
from server.coregistration.requests.search import SeasonSearch, map_frame_of
from server.coregistration.season import SUFFIXES
from server.errors import InvalidField
from server.http.authorization import GuardedRoute
from server.http.negotiation import JSON
from server.http.responses import json_response, problems, stored_response
from server.jobs import job_files, queue
from server.jobs.quota import check_room
from server.jobs.types.coregister import CoregistrationParameters
from server.jobs.upload import UploadForm, receive_upload
from server.platform.ids import new_id
from server.routes.dependencies import CollectionId, IdempotencyKeyHeader, PrincipalDep, ServiceDep, idempotency_key_of
from server.routes.imports import check_length, inflater_of
from server.routes.jobs import ACCEPTED, JobId
from server.routes.query_members import reads_files, takes_members
from server.routes.stands import FileNameQuery
from server.schemas.files.coregistrations import JOB_FILES_EXAMPLE, JobFileList, SeasonOptions
from server.schemas.jobs import JobAnswer
from server.stem_maps.reading.options import ReadOptions

router = APIRouter(route_class=GuardedRoute, tags=["coregistrations"])
_PIECE: Final = 1 << 18
_BINARY: Final[dict[str, Any]] = {
    "schema": {"type": "string", "format": "binary"},
    "example": "plot,tag,x,y\nP1,1,2.0,3.0\n",
}


@dataclass(frozen=True, slots=True)
class _Asked:
    """How plots are searched, and the name of the file that says where they ought to be."""

    search: SeasonSearch
    positions: str | None


def _asked(members: dict[str, Any]) -> _Asked:
    positions, frame = members.pop("positions"), members.pop("frame_id")
    return _Asked(SeasonSearch(**members, frame=frame), positions)


reads_search = takes_members(SeasonOptions, "asked", _asked)


@router.post(
    "/v1/collections/{collection}/coregistrations",
    operation_id="postCoregistration",
    summary="Place a season's plots in a map",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(404, 413, 415, 422, 503, 507)},
    openapi_extra={
        "requestBody": {
            "required": True,
            "description": "The bytes of one file of plots, or of a zip archive of several. gzip is accepted.",
            "content": {"application/octet-stream": _BINARY},
        }
    },
)
@reads_files
@reads_search
async def post_coregistration(
    *,
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    caller: PrincipalDep,
    file: FileNameQuery,
    idempotency_key: IdempotencyKeyHeader = None,
    asked: _Asked,
    options: ReadOptions,
) -> Response:
    """Uploads files of plots. A job then places each plot in the map of the collection, as `urquhart coregister` does.

    A plot that cannot be read or found is a row, and the others are placed. The job's results have a line for each
    plot, and `/v1/jobs/{job}/files` its tables, GeoPackages, transforms, pictures and `report.html`. Several files are
    sent as a zip archive, in which a `columns.toml` may say what columns mean.
    """
    search = asked.search
    _check(search, file, asked.positions)
    inflater = inflater_of(request.headers.get("content-encoding"))
    limits = service.settings.limits
    check_length(request.headers, limits.import_bytes)
    collection_key = await anyio.to_thread.run_sync(queue.check, service.database, collection)
    if search.at_sigma is not None:
        frame = await anyio.to_thread.run_sync(map_frame_of, service.database, collection, search.frame)
        search = replace(search, frame=frame)
    if idempotency_key is None:  # a repetition gets its answer however many jobs wait
        await anyio.to_thread.run_sync(check_room, service.database, caller, limits)
    folder, job_id = service.jobs.folder, new_id()
    parameters = CoregistrationParameters(file=file, positions=asked.positions, options=options, search=search)
    form = UploadForm(inflater, has_lines=False)
    async with receive_upload(folder, job_id, request.stream(), limits, form) as arrived:
        await anyio.to_thread.run_sync(archive.check, folder.input(job_id), file, limits.import_bytes)
        key = idempotency_key_of(service, caller, idempotency_key, request.url.query.encode() + arrived.digest.encode())
        job = queue.NewJob(
            "coregistration", parameters.model_dump(mode="json"), id=job_id, collection_key=collection_key
        )
        response = await anyio.to_thread.run_sync(service.accept_job, collection, caller, job, key)
    if response.replayed:
        folder.remove(job_id)
    return stored_response(response)


def _check(search: SeasonSearch, file: str, positions: str | None) -> None:
    """Refuse what cannot be searched before the upload is read. Raises InvalidField."""
    fault = search.fault(has_positions=positions is not None, named=lambda name: f"`{name}`")
    if fault is not None:
        raise InvalidField(fault[1], code="search", parameter=fault[0])
    if positions is not None and not file.lower().endswith(ARCHIVE):
        raise InvalidField(
            "names a file in a zip archive, and `file` is none: pack both into one",
            code="archive",
            parameter="positions",
        )
    if file.lower().endswith(".shp"):
        raise InvalidField(
            "is one of the files of a Shapefile: pack them all into a zip archive", code="archive", parameter="file"
        )
    known = sorted(SUFFIXES - {".shp"})
    if not file.lower().endswith((*known, ARCHIVE)):
        raise InvalidField(
            f"ends in no suffix of a format of trees, which are {', '.join(known)}, and {ARCHIVE} for several files",
            code="format",
            parameter="file",
        )


@router.get(
    "/v1/jobs/{job}/files",
    operation_id="listJobFiles",
    summary="List the files that a job wrote",
    response_model=JobFileList,
    responses={200: {"content": {JSON: {"example": JOB_FILES_EXAMPLE}}}, **problems(404, 409, 410, 422, 503)},
)
def list_job_files(job: JobId, service: ServiceDep, caller: PrincipalDep) -> Response:
    """Lists the files of a coregistration that has ended: the tables, GeoPackages, transforms, pictures and the report
    that docs/files.md explains. They are kept as long as the job's results.
    """
    return json_response(job_files.listed(service.database, service.jobs.folder, caller, job))


@router.get(
    "/v1/jobs/{job}/files/{file:path}",
    operation_id="getJobFile",
    summary="Download a file that a job wrote",
    response_class=Response,
    responses={
        200: {
            "content": {
                "application/octet-stream": {
                    "schema": {"type": "string", "format": "binary"},
                    "example": "plot,verdict\nP1,matched\n",
                }
            }
        },
        **problems(404, 409, 410, 422, 503),
    },
)
def get_job_file(
    job: JobId,
    name: Annotated[
        str,
        Path(alias="file", description="`name` of the file in the list.", examples=["plots.csv"], max_length=500),
    ],
    service: ServiceDep,
    caller: PrincipalDep,
) -> Response:
    """Returns one of the files that the list names, as an attachment of its media type."""
    found = job_files.opened(service.database, service.jobs.folder, caller, job, name)
    shown = quote(name.rpartition("/")[2], safe="")
    headers = {
        "Content-Disposition": f"attachment; filename*=UTF-8''{shown}",
        "Content-Length": str(found.size),
    }
    return StreamingResponse(_pieces(found), media_type=found.media_type, headers=headers)


def _pieces(found: job_files.OpenFile) -> Iterator[bytes]:
    with found.file as file:
        while piece := file.read(_PIECE):
            yield piece
