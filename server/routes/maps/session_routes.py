"""Routes of what a session is on the map: its poses while its robot drives."""

import hashlib
from typing import Annotated, Final

from fastapi import APIRouter, Path, Response

from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON
from server.http.responses import etag_header, json_response, not_modified, problems
from server.routes.dependencies import CollectionId, IfNoneMatch, ServiceDep
from server.schemas.maps.session_poses import POSES_EXAMPLE, SessionPosesAnswer

router = APIRouter(route_class=JsonRoute, tags=["maps"])
_PATH: Final = "/v1/collections/{collection}/sessions/{session}/poses"
SessionName = Annotated[
    str, Path(description="Name of the session.", examples=[POSES_EXAMPLE["session"]], min_length=1, max_length=128)
]


@router.get(
    _PATH,
    operation_id="getSessionPoses",
    summary="Read the poses of a session now",
    response_model=SessionPosesAnswer,
    responses={
        200: {"content": {JSON: {"example": POSES_EXAMPLE}}},
        304: {"description": "Not modified."},
        **problems(404, 409, 422, 501, 503),
    },
)
def get_session_poses(
    collection: CollectionId,
    session: SessionName,
    service: ServiceDep,
    budget: BudgetDep,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Returns where each submap of a session is, by all matches and odometry that the collection keeps of it now. The
    frame is that of the session's first submap; parts that nothing connects have frames of their own.

    Odometry and matches that came since the last answer are taken in at once, in about 50 ms for 1,000 submaps. What
    only a search of all constraints can judge is `pending` until that has run in the background; false loops are kept
    out as they are from maps. The first answer after the service started, or after a submap was deleted or replaced,
    needs such a search; if it takes longer than `query_seconds`, this is 503 with `Retry-After`, and the search goes
    on. No stored pose is changed.
    """
    seconds = max(service.limits.query_seconds - budget.elapsed, 0.0)
    body = service.session_poses.answer(collection, session, seconds)
    etag = hashlib.sha256(body).hexdigest()[:32]
    return not_modified(if_none_match, etag) or json_response(body, headers=etag_header(etag))
