"""Routes of the constraints that a collection keeps: list and export them, post odometry, delete one."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Path, Query, Request, Response

from server.constraints import rows
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON, NDJSON
from server.http.responses import json_response, next_link, problems, stored_response
from server.resources import links
from server.resources.paging import PageRequest
from server.routes.dependencies import CollectionId, IdempotencyKeyDep, PageCursor, PageLimit, ServiceDep
from server.schemas.maps.constraint_rows import (
    KEPT_EXAMPLE,
    ConstraintPage,
    KeptKind,
    KeptState,
    OdometryInput,
    OdometryReceipt,
    StoredFormat,
)

router = APIRouter(route_class=JsonRoute, tags=["maps"])
_ALL: Final = "/v1/collections/{collection}/constraints"
_LIST: Final[dict[str, Any]] = {
    JSON: {"example": {"constraints": [KEPT_EXAMPLE], "next": "WyJjb25zdHJhaW50cyIsMTJd"}},
    NDJSON: {"schema": {"type": "string"}, "example": '{"id": "12", "kind": "odometry", "from": "p7", "to": "q3"}\n'},
    "text/plain": {
        "schema": {"type": "string"},
        "example": "VERTEX_SE2 0 0.0 0.0 0.0\nVERTEX_SE2 1 4.1 0.2 0.05\n",
    },
}


@router.get(
    _ALL,
    operation_id="listConstraints",
    summary="List the constraints",
    response_model=ConstraintPage,
    responses={200: {"content": _LIST}, **problems(404, 422, 503)},
)
def list_constraints(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    kind: Annotated[KeptKind | None, Query(description="Only matches, or only odometry.")] = None,
    state: Annotated[KeptState | None, Query(description="Only constraints in this state.")] = None,
    submap: Annotated[
        str | None, Query(description="Only constraints of this submap.", max_length=128, examples=["p7"])
    ] = None,
    written: Annotated[
        StoredFormat | None,
        Query(alias="format", description="All of them at once, in this format. Default: a page of JSON."),
    ] = None,
    frame_id: Annotated[
        str | None,
        Query(
            description="Map frame in which vertices of g2o and poses of TUM and KITTI start. Default: that of most "
            "submaps.",
            max_length=128,
        ),
    ] = None,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists the constraints that the collection keeps, in the order they were stored: matches that jobs found, and
    odometry that was posted. The last page has no `next`.

    With `format`, all of them come at once. g2o, matrices, TUM and KITTI leave stale ones out; TUM and KITTI have the
    pose of each submap, in its map frame or along the constraints.
    """
    chosen = rows.chosen_rows(kind, state, submap)
    if written is not None:
        content = rows.export(service.database, collection, chosen, (written, frame_id))
        return Response(content, media_type={"ndjson": NDJSON, "json": JSON}.get(written, "text/plain"))
    page = rows.page(service.database, service.settings.limits, collection, chosen, PageRequest(limit, cursor))
    headers = {} if page.next is None else {"Link": next_link(links.constraints(collection), request, page.next)}
    return json_response(page, headers=headers)


@router.post(
    "/v1/collections/{collection}/odometry",
    operation_id="postOdometry",
    summary="Store relative poses that a robot measured",
    response_model=OdometryReceipt,
    responses={
        200: {"content": {JSON: {"example": {"stored": 119}}}},
        **problems(400, 404, 409, 413, 415, 422, 503, 507),
    },
)
def post_odometry(
    collection: CollectionId, body: OdometryInput, service: ServiceDep, idempotency_key: IdempotencyKeyDep
) -> Response:
    """Stores relative poses as constraints, all in one transaction or none. Maps of these submaps believe them within
    their covariances, unless several independent matches contradict one.
    """
    return stored_response(rows.post_odometry(service.database, collection, body.edges, idempotency_key))


@router.delete(
    _ALL + "/{constraint}",
    operation_id="deleteConstraint",
    summary="Delete a constraint",
    status_code=204,
    response_class=Response,
    responses=problems(404, 422, 503, 507),
)
def delete_constraint(
    collection: CollectionId,
    constraint: Annotated[
        str, Path(description="`id` of the constraint.", examples=[KEPT_EXAMPLE["id"]], max_length=64)
    ],
    service: ServiceDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Deletes a constraint. A match is found again once one of its submaps is looked up again."""
    return stored_response(rows.delete(service.database, collection, constraint, idempotency_key))
