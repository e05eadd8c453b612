"""The route of landmarks as binary columns, for maps on a screen."""

import hashlib
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Response

from server.collections import crud
from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.responses import etag_header, not_modified, problems
from server.routes.dependencies import CollectionId, IfNoneMatch, ServiceDep, in_time
from server.submaps.landmark_columns import landmark_columns
from server.submaps.reader import submap_filter

router = APIRouter(route_class=JsonRoute, tags=["exports"])
COLUMNS: Final = "application/vnd.urquhart.landmark-columns"
_LAYOUT: Final = 2
"""Raised whenever the head gets another member, so that nobody keeps columns without it."""
_BINARY: Final[dict[str, Any]] = {"schema": {"type": "string", "format": "binary"}, "example": "URQCOL1"}


@router.get(
    "/v1/collections/{collection}/landmarks",
    operation_id="getLandmarks",
    summary="Read landmarks as binary columns",
    response_class=Response,
    responses={
        200: {"content": {COLUMNS: _BINARY}},
        304: {"description": "Not modified."},
        **problems(404, 422, 503),
    },
)
def get_landmarks(
    collection: CollectionId,
    service: ServiceDep,
    budget: BudgetDep,
    frame_id: Annotated[str, Query(description="The map frame.", examples=["map"])],
    session: Annotated[
        str | None, Query(description="Only submaps of this session.", examples=["2026-05-04-robot-2"])
    ] = None,
    bbox: Annotated[
        str | None,
        Query(
            description="Only submaps whose footprint overlaps this box: min x,min y,max x,max y, metres, map frame.",
            examples=["0,0,100,100"],
        ),
    ] = None,
    limit: Annotated[
        int,
        Query(description="Most positions. If there are more, every second, fourth, ... is sent.", ge=1, le=1_000_000),
    ] = 200_000,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Returns boxes of submaps and positions of their trees in a map frame, to be drawn: far smaller and faster to read
    than JSON. Submaps without a `map_pose` in the frame are left out. For all attributes of every tree, see
    [exports](#getexport).

    Little-endian: the 8 bytes `URQCOL1\\n`; uint32, the length of the head; the head: JSON, padded with spaces to a
    multiple of 4, with `origin` [x, y], `landmarks` (trees in all), `every` (1, or every how-many-th tree is here), ids
    of the `submaps`, their `stamps` (seconds since 1970 UTC, or null), names of the `sessions`, and in `session_of` the
    position of each submap's session, -1 for none.
    Then float32 (S, 4), the box of each submap; uint32 (S), how many positions it has here; float32 (N, 2), the
    positions, submap after submap. Metres, relative to `origin`.
    """
    chosen = submap_filter(session=session, bbox=bbox, frame_id=frame_id, datetime_range=None)
    _, version = crud.read(service.database, collection)
    asked = "\n".join(str(one) for one in (_LAYOUT, version, frame_id, session, bbox, limit))
    etag = hashlib.sha256(asked.encode()).hexdigest()[:32]
    # A browser keeps them, and asks each time whether they are current.
    headers = etag_header(etag) | {"Cache-Control": "private, no-cache"}
    unchanged = not_modified(if_none_match, etag)
    if unchanged is not None:
        unchanged.headers.update(headers)
        return unchanged
    with in_time(service, budget) as own:
        columns = landmark_columns(service.database, collection, chosen, limit, own.check)
    return Response(columns, media_type=COLUMNS, headers=headers)
