"""Routes of stands, what stem maps were stored in a collection, and of the files of trees that are stored so."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Request, Response

from server.http.json_body import JsonRoute
from server.http.negotiation import JSON
from server.http.responses import etag_header, json_response, next_link, not_modified, problems, stored_response
from server.resources import links
from server.routes.dependencies import (
    CollectionId,
    IdempotencyKeyDep,
    IfNoneMatch,
    PageCursor,
    PageLimit,
    PreconditionsDep,
    ServiceDep,
)
from server.routes.query_members import reads_files
from server.schemas.collections import STAND_EXAMPLE, STAND_RECEIPT_EXAMPLE, Stand, StandMove, StandPage, StandReceipt
from server.schemas.common import ResourceId
from server.schemas.landmarks import FileName, StemMapAnswer
from server.stem_maps import stored_stands
from server.stem_maps.moved_stands import move_stand
from server.stem_maps.reading.options import ReadOptions
from server.stem_maps.sent_stands import Cutting, StandTerms, cutting_of, named, put_stand, stem_map_json
from server.stem_maps.uploads import UploadedFile

router = APIRouter(route_class=JsonRoute, tags=["stands"])
_ALL = "/v1/collections/{collection}/stands"
_PATH = f"{_ALL}/{{stand}}"
_EXAMPLE: dict[str, Any] = {"content": {JSON: {"example": STAND_EXAMPLE}}}
StandName = Annotated[
    ResourceId, Path(description="`name` of the stand.", examples=[STAND_EXAMPLE["name"]], alias="stand")
]


@router.get(
    _ALL,
    operation_id="listStands",
    summary="List the stands",
    response_model=StandPage,
    responses={
        200: {"content": {JSON: {"example": {"stands": [STAND_EXAMPLE], "next": "WyJzdGFuZHMiLDFd"}}}},
        **problems(404, 422, 503),
    },
)
def list_stands(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists what stem maps were stored, in the order they were first stored. The last page has no `next`.

    `urquhart index` stores stem maps on the host.
    """
    page = stored_stands.page(service.database, service.settings.limits, collection, limit, cursor)
    headers = {} if page.next is None else {"Link": next_link(links.stands(collection), request, page.next)}
    return json_response(page, headers=headers)


@router.get(
    _PATH,
    operation_id="getStand",
    summary="Read a stand",
    response_model=Stand,
    responses={200: _EXAMPLE, 304: {"description": "Not modified."}, **problems(404, 422, 503)},
)
def get_stand(
    collection: CollectionId, stand: StandName, service: ServiceDep, if_none_match: IfNoneMatch = None
) -> Response:
    """Returns what is known of a stand: its file's digest, its dates, its map frame, and how much it contains."""
    found = stored_stands.read(service.database, collection, stand)
    return not_modified(if_none_match, found.etag) or json_response(found, headers=etag_header(found.etag))


@router.delete(
    _PATH,
    operation_id="deleteStand",
    summary="Delete a stand",
    status_code=204,
    response_class=Response,
    responses=problems(404, 412, 422, 503, 507),
)
def delete_stand(
    collection: CollectionId,
    stand: StandName,
    service: ServiceDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Deletes a stand with all its submaps, in one transaction. The next query no longer finds them.

    A submap that a PUT took out of the stand stays.
    """
    return stored_response(
        stored_stands.delete(service.database, collection, stand, preconditions, idempotency_key=idempotency_key)
    )


@router.patch(
    _PATH,
    operation_id="patchStand",
    summary="Move a stand",
    response_model=Stand,
    responses={200: _EXAMPLE, **problems(400, 404, 409, 412, 413, 415, 422, 503, 507)},
)
def patch_stand(
    collection: CollectionId,
    stand: StandName,
    body: StandMove,
    service: ServiceDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Moves all submaps of a stand together in their map frame, in one transaction. Landmarks and the index stay as
    they are. Storing the stand's file again puts it where the file says.

    409 if its submaps are in several map frames, or in none. To say where the map frame itself is on Earth, PATCH the
    collection's `crs`, `origin` or `frames`.
    """
    return stored_response(move_stand(service.database, collection, stand, body, preconditions, idempotency_key))


_TYPE = "application/octet-stream"
_FILE: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The bytes of the file. gzip is accepted.",
        "content": {_TYPE: {"schema": {"type": "string", "format": "binary"}, "example": "tag,x,y\n1,2.0,3.0\n"}},
    }
}
_ANSWER = {
    "name": "plot",
    "understood": "read tree_id from 'tag', x_m from 'x', y_m from 'y'",
    "assumed": [],
    "rows": {"read": 1, "skipped": 0, "further_stems": 0, "merged": 0},
    "crs": None,
    "own_frames": False,
    "plots": [{"name": None, "landmarks": [{"id": "1", "x": 2.0, "y": 3.0}]}],
}
FileNameQuery = Annotated[
    FileName,
    Query(alias="file", description="Name of the file. Its suffix says the format.", examples=["plots.csv"]),
]


async def get_body(request: Request) -> bytes:
    """The bytes that were sent."""
    return await request.body()


BodyDep = Annotated[bytes, Depends(get_body)]


@router.post(
    "/v1/stem-maps",
    operation_id="readStemMap",
    summary="Read a file of trees",
    response_model=StemMapAnswer,
    responses={200: {"content": {JSON: {"example": _ANSWER}}}, **problems(413, 415, 422, 503)},
    openapi_extra=_FILE,
)
@reads_files
def read_stem_map(
    *,
    service: ServiceDep,
    body: BodyDep,
    file: FileNameQuery,
    idempotency_key: IdempotencyKeyDep,
    options: ReadOptions,
) -> Response:
    """Reads a file as `urquhart index` does, and returns its trees. Nothing is stored, so a repeated request with the
    same `Idempotency-Key` reads the file again.

    CSV, xlsx, GeoPackage, FlatGeobuf, GeoJSON, KML, GPX, LAS and LAZ. `understood` says what was read as what. A file
    that cannot be used is refused, with each row at fault in `errors`.
    """
    return json_response(stem_map_json(service.uploads.read(UploadedFile(file, body, options))))


@router.put(
    "/v1/collections/{collection}/stands/{stand}",
    operation_id="putStand",
    summary="Store a file of trees as a stand",
    response_model=StandReceipt,
    responses={
        200: {"content": {JSON: {"example": STAND_RECEIPT_EXAMPLE}}},
        201: {
            "description": "The stand is new.",
            "model": StandReceipt,
            "content": {JSON: {"example": STAND_RECEIPT_EXAMPLE}},
        },
        **problems(404, 412, 413, 415, 422, 503, 507),
    },
    openapi_extra=_FILE,
)
@reads_files
def store_stem_map(
    *,
    collection: CollectionId,
    stand: StandName,
    service: ServiceDep,
    body: BodyDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
    file: FileNameQuery,
    radius: Annotated[float | None, Query(gt=0, le=1e6, description="Radius of a submap, in metres.")] = None,
    spacing: Annotated[
        float | None, Query(gt=0, le=1e6, description="Distance between neighbouring submaps, in metres.")
    ] = None,
    one_submap: Annotated[bool, Query(description="Whether each file, or each of its plots, is one submap.")] = False,
    options: ReadOptions,
) -> Response:
    """Reads a file, cuts it into overlapping submaps, and stores them as the stand of this name, in one transaction.

    `understood` and `rows` say how the file was read, and what was left out. Everything that the stand had before is
    replaced. Queries find the stand as it was or as it is, and nothing between. A stand that exists is cut as it was,
    if neither `radius` and `spacing` nor `one_submap` is given.
    """
    cutting = cutting_of(service.database, collection, stand, Cutting(radius, spacing, one_submap))
    stem_map = named(service.uploads.read(UploadedFile(file, body, options)), stand)
    terms = StandTerms(preconditions, idempotency_key)
    return stored_response(put_stand(service.database, service.limits, collection, stem_map, cutting, terms))
