"""Routes of stands: what stem maps were stored in a collection."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response

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
from server.schemas.collections import STAND_EXAMPLE, Stand, StandPage
from server.schemas.common import ResourceId
from server.stem_maps import stored_stands

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
