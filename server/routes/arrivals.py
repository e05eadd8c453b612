"""Submaps as they come in: stored, and looked up before where that is asked for."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from server import links, reading
from server.access import Caller, Scope
from server.errors import InvalidField
from server.http.dependencies import (
    BudgetDep,
    CallerDep,
    CollectionId,
    JsonRoute,
    OnceDep,
    PreconditionsDep,
    Service,
    ServiceDep,
    SubmapId,
    etag_header,
    kept_response,
    problems,
)
from server.http.negotiation import JSON
from server.idempotency import Kept
from server.identifiers import new_id
from server.intake import ingest
from server.queries import lookup
from server.schemas import examples
from server.schemas.arrivals import ArrivingSubmap, SubmapReceipt
from server.schemas.common import to_json
from server.schemas.queries import QueryAnswer
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
        200: {"description": "It was there: unchanged, or replaced.", **_RECEIPT},
        201: {"description": "It is new.", "model": SubmapReceipt, **_RECEIPT},
        **problems(400, 404, 409, 412, 413, 415, 422, 503, 507),
    },
)
def put_submap(
    collection: CollectionId,
    submap: SubmapId,
    body: ArrivingSubmap,
    service: ServiceDep,
    caller: CallerDep,
    preconditions: PreconditionsDep,
    budget: BudgetDep,
    query: WithQuery = False,
) -> Response:
    """The next query finds it. The same content again changes nothing, so a PUT can be repeated safely."""
    found = _ask_first(service, caller, collection, submap, body, budget, wanted=query)
    receipt = ingest.put(service.database, collection, submap, body, service.settings.limits, preconditions)
    service.metrics.submaps_written.labels(receipt.outcome).inc()
    return kept_response(_answered(collection, submap, receipt, found))


@router.post(
    _ALL,
    operation_id="postSubmap",
    summary="Store a new submap",
    response_model=SubmapReceipt,
    status_code=201,
    responses={
        201: {"description": "It is new; `Location` says where.", **_RECEIPT},
        **problems(400, 404, 409, 413, 415, 422, 503, 507),
    },
)
def post_submap(
    collection: CollectionId,
    body: ArrivingSubmap,
    service: ServiceDep,
    caller: CallerDep,
    once: OnceDep,
    budget: BudgetDep,
    query: WithQuery = False,
) -> Response:
    """Under an id that the service makes, later ones after earlier ones. Sent again with the same `Idempotency-Key`,
    it is not stored again, and is answered as the first time.
    """
    kept = ingest.posted(service.database, collection, once)
    if kept is None:
        submap = new_id()
        found = _ask_first(service, caller, collection, None, body, budget, wanted=query)
        kept = ingest.post(
            service.database,
            collection,
            submap,
            body,
            service.settings.limits,
            once,
            lambda receipt: _answered(collection, submap, receipt, found),
        )
        if not kept.replayed:
            service.metrics.submaps_written.labels("created").inc()
    return kept_response(kept)


def _ask_first(
    service: Service,
    caller: Caller,
    collection: str,
    submap: str | None,
    body: ArrivingSubmap,
    budget: Budget,
    *,
    wanted: bool,
) -> QueryAnswer | None:
    """Where else the submap was seen, by what is stored before it is."""
    if not wanted and body.query is None:
        return None
    caller.require(Scope.READ)
    limits = service.limits
    try:
        return lookup.answer_query(
            service.database,
            service.catalog,
            service.metrics,
            limits,
            collection,
            body.question(),
            own_id=submap,
            budget=budget,
        )
    except InvalidField as error:
        raise error.below("/query") from error


def _answered(collection: str, submap: str, receipt: ingest.Receipt, found: QueryAnswer | None) -> Kept:
    headers = etag_header(receipt.etag)
    if receipt.outcome == "created":
        headers["Location"] = links.submap(collection, submap)
    answer = SubmapReceipt(
        id=submap,
        collection=collection,
        outcome=receipt.outcome,
        counts=receipt.counts,
        etag=receipt.etag,
        revision=receipt.revision,
        links=reading.submap_links(collection, submap),
        query=found,
    )
    return Kept(201 if receipt.outcome == "created" else 200, headers, to_json(answer))
