"""Routes that store, change and delete submaps, and on request search for their place first."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response

from server.errors import InvalidField
from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON
from server.http.responses import problems, stored_response
from server.platform.ids import new_id
from server.queries.loop_closing import LoopClosingQuery
from server.queries.query import PlaceQuery
from server.routes.dependencies import (
    CollectionId,
    IdempotencyKeyDep,
    PreconditionsDep,
    PrincipalDep,
    ServiceDep,
    SubmapId,
)
from server.routes.submaps import _SUBMAP
from server.schemas import examples
from server.schemas.common import Label
from server.schemas.submaps import ArrivingSubmap, Submap, SubmapPatch, SubmapReceipt
from server.security.principal import Principal, Scope
from server.service_parts import Service
from server.submaps import sessions, writes
from urquhart import Budget

router = APIRouter(route_class=JsonRoute, tags=["submaps"])
_ALL = "/v1/collections/{collection}/submaps"
_RECEIPT: dict[str, Any] = {"content": {JSON: {"example": examples.RECEIPT}}}
WithQuery = Annotated[
    bool,
    Query(
        description="Also search for this place among the submaps stored before; the same as `query: {}` in the body."
    ),
]


@router.put(
    f"{_ALL}/{{submap}}",
    operation_id="putSubmap",
    summary="Store a submap",
    response_model=SubmapReceipt,
    responses={
        200: {
            "description": "The submap existed: `unchanged` or `replaced`. Or it was looked up and `not_stored`.",
            **_RECEIPT,
        },
        201: {"description": "The submap is new.", "model": SubmapReceipt, **_RECEIPT},
        **problems(400, 404, 409, 412, 413, 415, 422, 503, 507),
    },
)
def put_submap(
    collection: CollectionId,
    submap: SubmapId,
    body: ArrivingSubmap,
    service: ServiceDep,
    caller: PrincipalDep,
    preconditions: PreconditionsDep,
    budget: BudgetDep,
    idempotency_key: IdempotencyKeyDep,
    query: WithQuery = False,
) -> Response:
    """Creates the submap or replaces it as a whole: members that you leave out are removed, and `cleared` names them.
    Use PATCH to keep them. Sending the same content again changes nothing. The next query finds the submap.

    With `query`, the service first searches for this place among all other submaps stored before.
    """
    loop = _loop_closing(service, caller, collection, submap, body, budget) if query or body.query is not None else None
    terms = writes.WriteTerms(preconditions, idempotency_key, loop)
    return _answered(service, writes.put(service.database, collection, submap, body, service.settings.limits, terms))


@router.post(
    _ALL,
    operation_id="postSubmap",
    summary="Store a new submap",
    response_model=SubmapReceipt,
    status_code=201,
    responses={
        200: {
            "description": "The submap was looked up and `not_stored`; `reason` says why.",
            "model": SubmapReceipt,
            **_RECEIPT,
        },
        201: {"description": "The submap is stored; `Location` is its path.", **_RECEIPT},
        **problems(400, 404, 409, 413, 415, 422, 503, 507),
    },
)
def post_submap(
    collection: CollectionId,
    body: ArrivingSubmap,
    service: ServiceDep,
    caller: PrincipalDep,
    idempotency_key: IdempotencyKeyDep,
    budget: BudgetDep,
    query: WithQuery = False,
) -> Response:
    """Stores a submap under an id that the service generates; later ids sort after earlier ones. If you repeat the
    request with the same `Idempotency-Key`, nothing is stored again and you get the first answer.
    """
    loop = _loop_closing(service, caller, collection, None, body, budget) if query or body.query is not None else None
    terms = writes.WriteTerms(idempotency_key=idempotency_key, loop_closing=loop, is_named=False)
    return _answered(service, writes.put(service.database, collection, new_id(), body, service.settings.limits, terms))


def _loop_closing(
    service: Service, caller: Principal, collection: str, submap: str | None, body: ArrivingSubmap, budget: Budget
) -> LoopClosingQuery:
    """The query before the submap is stored. Raises Forbidden."""
    caller.require(Scope.READ)
    try:
        query = PlaceQuery.of(body.question(), service.limits)
    except InvalidField as error:
        raise error.below("/query") from error
    return LoopClosingQuery(service.queries, collection, query, submap, budget)


def _answered(service: Service, stored: writes.Stored) -> Response:
    if stored.outcome is not None:
        service.metrics.submaps_written.labels(stored.outcome).inc()
    return stored_response(stored.response)


@router.patch(
    f"{_ALL}/{{submap}}",
    operation_id="patchSubmap",
    summary="Change a submap",
    response_model=Submap,
    responses={200: _SUBMAP, **problems(400, 404, 412, 413, 415, 422, 503, 507)},
)
def patch_submap(
    collection: CollectionId,
    submap: SubmapId,
    body: SubmapPatch,
    service: ServiceDep,
    caller: PrincipalDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Replaces the members that you send; null removes a member; members that you leave out stay. `xy` or `landmarks`
    replace all landmarks, and only then is the submap indexed again.

    The answer contains the landmarks, so the key also needs the scope `read`.
    """
    caller.require(Scope.READ)
    limits = service.settings.limits
    return stored_response(
        writes.patch(
            service.database, collection, submap, body, limits, writes.WriteTerms(preconditions, idempotency_key)
        )
    )


@router.delete(
    f"{_ALL}/{{submap}}",
    operation_id="deleteSubmap",
    summary="Delete a submap",
    status_code=204,
    response_class=Response,
    responses=problems(404, 412, 422, 503, 507),
)
def delete_submap(
    collection: CollectionId,
    submap: SubmapId,
    service: ServiceDep,
    preconditions: PreconditionsDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Deletes a submap. The next query no longer finds it."""
    return stored_response(
        writes.delete(service.database, collection, submap, preconditions, idempotency_key=idempotency_key)
    )


@router.delete(
    "/v1/collections/{collection}/sessions/{session:path}",
    operation_id="deleteSession",
    summary="Delete a session",
    status_code=204,
    response_class=Response,
    responses=problems(404, 422, 503, 507),
)
def delete_session(
    collection: CollectionId,
    session: Annotated[Label, Path(description="Name of the session.", examples=["monday"])],
    service: ServiceDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Deletes all submaps of a session, in one transaction. The next query no longer finds them. Constraints between
    them and other submaps become stale.
    """
    return stored_response(sessions.delete_session(service.database, collection, session, idempotency_key))
