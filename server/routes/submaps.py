"""Routes that read submaps: pages of them, one submap, its tessellation, sessions."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import GEOJSON, JSON, SVG, choose
from server.http.responses import etag_header, json_response, next_link, not_modified, problems
from server.resources import links
from server.resources.paging import PageRequest
from server.routes.dependencies import (
    Accept,
    CollectionId,
    IfNoneMatch,
    PageCursor,
    PageLimit,
    ServiceDep,
    SubmapId,
    in_time,
)
from server.schemas import examples
from server.schemas.submaps import (
    SessionPage,
    Submap,
    SubmapPage,
    TessellationAnswer,
)
from server.submaps import reader

router = APIRouter(route_class=JsonRoute, tags=["submaps"])
_ALL = "/v1/collections/{collection}/submaps"
_PATH = f"{_ALL}/{{submap}}"
_SUBMAP: dict[str, Any] = {"content": {JSON: {"example": examples.SUBMAP}}}
_SESSIONS = {
    "sessions": [
        {
            "session": "monday",
            "submaps": 12,
            "landmarks": 900,
            "first": "2026-05-04T09:30:00Z",
            "last": "2026-05-04T11:02:10Z",
        }
    ]
}
_GEOJSON = {"schema": {"type": "object"}, "example": {"type": "FeatureCollection", "features": []}}
_SVG = {"schema": {"type": "string"}, "example": "<svg xmlns='http://www.w3.org/2000/svg'></svg>"}


@router.get(
    _ALL,
    operation_id="listSubmaps",
    summary="List the submaps",
    response_model=SubmapPage,
    responses={
        200: {
            "content": {
                JSON: {"example": {"submaps": [examples.SUBMAP_SUMMARY], "next": "WyJzdWJtYXBzIiwxXQ"}},
                GEOJSON: _GEOJSON,
            }
        },
        **problems(404, 406, 422, 503),
    },
)
def list_submaps(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    budget: BudgetDep,
    bbox: Annotated[
        str | None,
        Query(
            description="Only submaps whose footprint overlaps this box: min x,min y,max x,max y, metres, map frame.",
            examples=["0,0,100,100"],
        ),
    ] = None,
    frame_id: Annotated[
        str | None, Query(description="Only submaps whose `map_pose` is in this map frame.", examples=["map"])
    ] = None,
    datetime: Annotated[
        str | None,
        Query(
            description="Only submaps with a stamp in this interval start/end; '..' for an open end. Or an instant.",
            examples=["2026-05-01T00:00:00Z/.."],
        ),
    ] = None,
    session: Annotated[
        str | None, Query(description="Only submaps of this session.", examples=["2026-05-04-robot-2"])
    ] = None,
    limit: PageLimit = None,
    cursor: PageCursor = None,
    accept: Accept = None,
) -> Response:
    """Lists submaps in the order they were stored, without landmarks. The last page has no `next`.

    With `Accept: application/geo+json`, returns footprints in longitude and latitude for submaps whose map frame has a
    CRS.
    """
    media_type = choose(accept, [JSON, GEOJSON])
    chosen = reader.submap_filter(session=session, bbox=bbox, frame_id=frame_id, datetime_range=datetime)
    arguments = (service.database, service.settings.limits, collection, chosen, PageRequest(limit, cursor))
    content: Any
    if media_type == GEOJSON:
        with in_time(service, budget) as own:
            content, following = reader.geojson_page(*arguments, own)
    else:
        content = reader.page(*arguments)
        following = content.next
    headers = {"Vary": "Accept"}
    if following is not None:
        headers["Link"] = next_link(links.submaps(collection), request, following)
    return json_response(content, media_type=media_type, headers=headers)


@router.get(
    _PATH,
    operation_id="getSubmap",
    summary="Read a submap",
    response_model=Submap,
    responses={200: _SUBMAP, 304: {"description": "Not modified."}, **problems(404, 422, 503)},
)
def get_submap(
    collection: CollectionId, submap: SubmapId, service: ServiceDep, if_none_match: IfNoneMatch = None
) -> Response:
    """Returns a submap with its landmarks."""
    found = reader.read(service.database, collection, submap)
    return not_modified(if_none_match, found.etag) or json_response(found, headers=etag_header(found.etag))


@router.get(
    f"{_PATH}/tessellation",
    operation_id="getTessellation",
    summary="Show the tessellation of a submap",
    response_model=TessellationAnswer,
    responses={
        200: {"content": {JSON: {"example": examples.TESSELLATION}, GEOJSON: _GEOJSON, SVG: _SVG}},
        304: {"description": "Not modified."},
        **problems(404, 406, 422, 503),
    },
)
def get_tessellation(
    collection: CollectionId,
    submap: SubmapId,
    service: ServiceDep,
    budget: BudgetDep,
    accept: Accept = None,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Returns triangles, Urquhart polygons and their descriptors, as JSON or GeoJSON, or draws them as SVG.

    The drawing shows the 5,000 landmarks nearest to the middle, and says if there are more. 503 if drawing takes longer
    than `query_seconds`.
    """
    media_type = choose(accept, [JSON, GEOJSON, SVG])
    with in_time(service, budget) as own:
        return _tessellation(reader.Tessellated(service.database, collection, submap, own), media_type, if_none_match)


def _tessellation(seen: reader.Tessellated, media_type: str, if_none_match: str | None) -> Response:
    etag = f"{seen.etag}-{media_type.split('/')[1].split('+')[0]}"
    unmodified = not_modified(if_none_match, etag, vary="Accept")
    if unmodified is not None:
        return unmodified
    headers = etag_header(etag) | {"Vary": "Accept"}
    if media_type == SVG:
        return Response(seen.to_svg(), media_type=SVG, headers=headers)
    if media_type == GEOJSON:
        return json_response(seen.to_geojson(), media_type=GEOJSON, headers=headers)
    return json_response(seen.to_answer(), headers=headers)


@router.get(
    "/v1/collections/{collection}/sessions",
    operation_id="listSessions",
    summary="List the sessions",
    response_model=SessionPage,
    responses={200: {"content": {JSON: {"example": _SESSIONS}}}, **problems(404, 422, 503)},
)
def list_sessions(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists sessions by name, each with its number of submaps and its first and last stamp. Submaps without a session
    are left out.
    """
    page = reader.sessions(service.database, service.settings.limits, collection, limit, cursor)
    headers = {} if page.next is None else {"Link": next_link(links.sessions(collection), request, page.next)}
    return json_response(page, headers=headers)
