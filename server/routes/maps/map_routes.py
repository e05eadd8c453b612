"""Routes of maps: start one, read its poses and constraints, read its trees."""

from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Response

from server.constraints.extraction import check_ids, chosen_submaps
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON
from server.http.responses import json_response, problems, stored_response
from server.jobs import built_maps, queue
from server.maps.building import check_optimiser
from server.maps.merging import check_frames
from server.maps.moving import move_submaps
from server.outputs.files import FORMATS, FormatName
from server.routes.dependencies import CollectionId, IdempotencyKeyDep, PrincipalDep, ServiceDep
from server.routes.jobs import ACCEPTED
from server.schemas.jobs import JobAnswer
from server.schemas.maps.answers import MAP_EXAMPLE, MapAnswer, PartTrees, PosesAnswer
from server.schemas.maps.merges import MERGE_EXAMPLE, MergeAnswer, MergeInput
from server.schemas.maps.request import MapInput, PosesInput

router = APIRouter(route_class=JsonRoute, tags=["maps"])
MapId = Annotated[
    str,
    Path(description="`id` of the job that built the map.", examples=[MAP_EXAMPLE["id"]], alias="map", max_length=64),
]
_BINARY: Final[dict[str, Any]] = {"schema": {"type": "string", "format": "binary"}, "example": "SQLite format 3"}
_TREES: Final[dict[str, Any]] = {
    JSON: {"example": {"part": 1, "frame_id": "map", "trees": []}},
    "text/csv": {
        "schema": {"type": "string"},
        "example": "id,x,y,sigma_m,dbh_cm,height_m,observed,missed,first_seen,last_seen,crs\n1,3.1,4.2,0.03,,,5,0,,,\n",
    },
    "application/geo+json": {
        "schema": {"type": "object"},
        "example": {"type": "FeatureCollection", "name": "trees", "features": []},
    },
    "application/geopackage+sqlite3": _BINARY,
    "application/vnd.apache.parquet": _BINARY | {"example": "PAR1"},
}


@router.post(
    "/v1/collections/{collection}/maps",
    operation_id="postMap",
    summary="Build a map",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(400, 404, 413, 415, 422, 501, 503, 507)},
)
def post_map(
    collection: CollectionId,
    body: MapInput,
    service: ServiceDep,
    caller: PrincipalDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Matches the chosen submaps with each other, optimises their poses together, and merges their trees.

    Matches that contradict the largest consistent set of them are left out. Parts that no constraint connects get map
    frames of their own. With `apply`, all poses are written in one transaction, under one new revision of the
    collection; if a submap got other landmarks meanwhile, none is. The results are lines of NDJSON; the map is also at
    `/v1/collections/{collection}/maps/{id}`.
    """
    check_optimiser()
    chosen_submaps(body)
    check_ids(service.database, collection, body)
    job = queue.NewJob("map", body.model_dump(mode="json", by_alias=True))
    return stored_response(service.accept_job(collection, caller, job, idempotency_key))


@router.get(
    "/v1/collections/{collection}/maps/{map}",
    operation_id="getMap",
    summary="Read a map",
    response_model=MapAnswer,
    responses={200: {"content": {JSON: {"example": MAP_EXAMPLE}}}, **problems(404, 409, 410, 422, 503)},
)
def get_map(collection: CollectionId, map_id: MapId, service: ServiceDep, caller: PrincipalDep) -> Response:
    """Returns a map in numbers, the pose of each submap, and what became of each constraint. A map is kept as long as
    the job that built it.
    """
    return json_response(built_maps.map_answer(service.database, service.jobs.folder, caller, collection, map_id))


@router.get(
    "/v1/collections/{collection}/maps/{map}/landmarks",
    operation_id="getMapLandmarks",
    summary="Read the trees of a map",
    response_model=PartTrees,
    responses={200: {"content": _TREES}, **problems(404, 406, 409, 410, 422, 503, 507)},
)
def get_map_landmarks(
    collection: CollectionId,
    map_id: MapId,
    service: ServiceDep,
    caller: PrincipalDep,
    part: Annotated[
        int, Query(ge=1, le=1_000_000, description="Number of the part of the map; 1 is the largest one.")
    ] = 1,
    written: Annotated[
        FormatName | None, Query(alias="format", description="Format of a file. Default: JSON.", examples=["gpkg"])
    ] = None,
) -> Response:
    """Returns one entry for each tree of a part of a map: its position with its covariance, diameter and height, and in
    how many submaps it was observed and missed.
    """
    told = built_maps.trees_answer(service.database, service.jobs.folder, caller, (collection, map_id), part)
    if written is None:
        return json_response(told)
    form = next(one for one in FORMATS if one.name == written)
    name = quote(f"{collection}-trees-{part}{form.suffix}", safe="")
    return Response(
        built_maps.tree_file(service.database, collection, told, form),
        media_type=form.media_type,
        headers={"Content-Disposition": f"attachment; filename*=UTF-8''{name}"},
    )


@router.post(
    "/v1/collections/{collection}/merges",
    operation_id="postMerge",
    summary="Lay one map frame onto another",
    response_model=JobAnswer,
    status_code=202,
    responses={202: ACCEPTED, **problems(400, 404, 409, 413, 415, 422, 503, 507)},
)
def post_merge(
    collection: CollectionId,
    body: MergeInput,
    service: ServiceDep,
    caller: PrincipalDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Matches the submaps of the map frame `from` with those of the map frame `to`. The pose that most matches agree on
    joins the frames, if at least 4 of them have no submap in common, and half as many at most agree on another pose.
    The other matches are named with reasons. With `apply`, all submaps of `from` get poses in `to`, in one transaction,
    under one new revision of the collection. The merge is at `/v1/collections/{collection}/merges/{id}`.
    """
    with service.database.read() as tx:
        check_frames(tx, collection, body)
    response = queue.accept(
        service.database,
        collection,
        caller,
        queue.NewJob("merge", body.model_dump(mode="json", by_alias=True)),
        idempotency_key,
        service.settings.limits,
    )
    service.jobs.runner.wake()
    return stored_response(response)


@router.get(
    "/v1/collections/{collection}/merges/{merge}",
    operation_id="getMerge",
    summary="Read a merge",
    response_model=MergeAnswer,
    responses={200: {"content": {JSON: {"example": MERGE_EXAMPLE}}}, **problems(404, 409, 410, 422, 503)},
)
def get_merge(
    collection: CollectionId,
    merge: Annotated[
        str, Path(description="`id` of the merge: that of its job.", examples=[MERGE_EXAMPLE["id"]], max_length=64)
    ],
    service: ServiceDep,
    caller: PrincipalDep,
) -> Response:
    """Returns how two map frames lie to each other, and what became of each match between them. A merge is kept as long
    as its job.
    """
    place = (collection, merge)
    return json_response(built_maps.merge_answer(service.database, service.jobs.folder, caller, place))


@router.post(
    "/v1/collections/{collection}/poses",
    operation_id="postPoses",
    summary="Write the poses of many submaps",
    response_model=PosesAnswer,
    responses={
        200: {"content": {JSON: {"example": {"map_version": 812, "changed": 120}}}},
        **problems(400, 404, 409, 412, 413, 415, 422, 503, 507),
    },
)
def post_poses(
    collection: CollectionId,
    body: PosesInput,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Writes map poses that you have optimised yourself, all in one transaction under one new revision of the
    collection, or none. A query sees the poses of before or those of after. Landmarks and the index stay as they are.
    """
    return stored_response(move_submaps(service.database, collection, body.poses, idempotency_key))
