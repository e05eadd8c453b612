"""Submaps stored, changed and deleted; looked up before, where that is asked for."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from server.http.admission.admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON
from server.http.responses import problems, stored_response
from server.platform.ids import new_id
from server.queries.loop_closing import LoopQuestion
from server.routes.dependencies import (
    CollectionId,
    IdempotencyKeyDep,
    PreconditionsDep,
    PrincipalDep,
    ServiceDep,
    SubmapId,
)
from server.routes.submaps import _SUBMAP
from server.runtime import Service
from server.schemas import examples
from server.schemas.submaps import ArrivingSubmap, Submap, SubmapPatch, SubmapReceipt
from server.security.principal import Principal, Scope
from server.submaps import ingest
from urquhart import Budget

router = APIRouter(route_class=JsonRoute, tags=["submaps"])
_ALL = "/v1/collections/{collection}/submaps"
_RECEIPT: dict[str, Any] = {"content": {JSON: {"example": examples.RECEIPT}}}
WithQuery = Annotated[
    bool, Query(description="Ask first where else it was seen, by what is stored before; as `query: {}` in the body.")
]


@router.put(
    f"{_ALL}/{{submap}}",
    operation_id="putSubmap",
    summary="Store a submap",
    response_model=SubmapReceipt,
    responses={
        200: {
            "description": "It was there: unchanged, or replaced. Or it was asked about, and not stored.",
            **_RECEIPT,
        },
        201: {"description": "It is new.", "model": SubmapReceipt, **_RECEIPT},
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
    """Replaces the whole submap: what is left out is cleared, and `cleared` in the answer names it; PATCH changes the
    landmarks and keeps the rest. The next query finds the submap. The same content again changes nothing.

    With `query`, the answer tells of every other submap at this place that was stored before this one.
    """
    question = _question(service, caller, collection, submap, body, budget) if query or body.query is not None else None
    terms = ingest.WriteTerms(preconditions, idempotency_key, question)
    return _answered(service, ingest.put(service.database, collection, submap, body, service.settings.limits, terms))


@router.post(
    _ALL,
    operation_id="postSubmap",
    summary="Store a new submap",
    response_model=SubmapReceipt,
    status_code=201,
    responses={
        200: {"description": "It was asked about, and not stored: `reason` says why.", **_RECEIPT},
        201: {"description": "It is new; `Location` says where.", **_RECEIPT},
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
    """Under an id that the service makes, later ones after earlier ones. Sent again with the same `Idempotency-Key`,
    it is not stored again, and is answered as the first time.
    """
    question = _question(service, caller, collection, None, body, budget) if query or body.query is not None else None
    terms = ingest.WriteTerms(idempotency_key=idempotency_key, question=question, is_named=False)
    return _answered(service, ingest.put(service.database, collection, new_id(), body, service.settings.limits, terms))


def _question(
    service: Service, caller: Principal, collection: str, submap: str | None, body: ArrivingSubmap, budget: Budget
) -> LoopQuestion:
    """What is asked before the submap is stored. Raises Forbidden."""
    caller.require(Scope.READ)
    return LoopQuestion(service.queries, collection, body.question(), submap, budget)


def _answered(service: Service, stored: ingest.Stored) -> Response:
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
    """What is given replaces what was there, null clears it, what is left out stays. Landmarks, given as `xy` or as
    `landmarks`, are replaced as a whole and indexed again; nothing else is.

    The answer has the landmarks, so the key needs the scope `read`, too.
    """
    caller.require(Scope.READ)
    limits = service.settings.limits
    return stored_response(
        ingest.patch(
            service.database, collection, submap, body, limits, ingest.WriteTerms(preconditions, idempotency_key)
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
    """The next query does not find it."""
    return stored_response(
        ingest.delete(service.database, collection, submap, preconditions, idempotency_key=idempotency_key)
    )
