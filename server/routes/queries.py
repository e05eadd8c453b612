"""Queries: where is this?"""

from typing import Annotated

from fastapi import APIRouter, Path, Response

from server.http.admission.admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import JSON, SVG, choose
from server.http.responses import json_response, problems
from server.queries import lookup, stored
from server.queries.batch import answer_batch
from server.routes.dependencies import Accept, CollectionId, IdempotencyKeyDep, PrincipalDep, ServiceDep, in_time
from server.schemas import examples
from server.schemas.queries import BatchAnswer, BatchInput, ExplanationAnswer, MatchAnswer, QueryAnswer, QueryInput
from server.security.principal import Scope

router = APIRouter(route_class=JsonRoute, tags=["queries"])
_ALL = "/v1/collections/{collection}/queries"
_PATH = f"{_ALL}/{{query}}"
_EXAMPLE = {"content": {JSON: {"example": examples.QUERY_ANSWER}}}
_MATCH = {
    "query": "17",
    "candidate": examples.QUERY_ANSWER["candidates"][0],
    "query_landmarks": [[0.4, 2.9], [5.1, -1.7]],
    "submap_landmarks": [[1.2, 3.4], [4.9, -2.2]],
}

_SVG = {"schema": {"type": "string"}, "example": "<svg xmlns='http://www.w3.org/2000/svg'></svg>"}

QueryId = Annotated[str, Path(description="`id` of the answer.", examples=["17"], alias="query", max_length=128)]


@router.post(
    _ALL,
    operation_id="query",
    summary="Ask where an observation was made",
    response_model=QueryAnswer,
    responses={200: _EXAMPLE, **problems(400, 404, 413, 415, 422, 503, 507)},
)
def query(
    collection: CollectionId,
    body: QueryInput,
    service: ServiceDep,
    caller: PrincipalDep,
    idempotency_key: IdempotencyKeyDep,
    budget: BudgetDep,
) -> Response:
    """Act on `verdict`: `matched`, `ambiguous` or `no_match`, with a `reason`. Too few trees in view is an answer, too.

    Every submap that was acknowledged before the question is searched. To `store` the answer is a write: sent again
    with the same `Idempotency-Key`, it is answered as the first time. Others change nothing, and are answered again.
    """
    headers = {}
    if body.store:
        caller.require(Scope.WRITE)
    key = stored.AnswerKey(idempotency_key)
    answer = stored.kept_answer(service.database, collection, key) if body.store else None
    if answer is not None:
        answer, headers = lookup.shown(answer, body), {"Idempotency-Replayed": "true"}
    else:
        answer = lookup.answer_query(service.queries, collection, body, key=key, budget=budget)
    if answer.links.self:
        headers["Location"] = answer.links.self
    return json_response(answer, headers=headers)


@router.post(
    f"{_ALL}/batch",
    operation_id="queryBatch",
    summary="Ask several questions at once",
    response_model=BatchAnswer,
    responses={
        200: {"content": {JSON: {"example": {"results": [examples.QUERY_ANSWER]}}}},
        **problems(400, 404, 413, 415, 422, 503, 507),
    },
)
def query_batch(
    collection: CollectionId,
    body: BatchInput,
    service: ServiceDep,
    caller: PrincipalDep,
    budget: BudgetDep,
    idempotency_key: IdempotencyKeyDep,
) -> Response:
    """Each is answered as if it had come alone, in their order; one that is wrong has a `problem` in its place.

    Sent again with the same `Idempotency-Key`, those with `store` are answered as the first time, the others again.
    """
    return json_response(answer_batch(service.queries, caller, collection, body, budget, idempotency_key))


@router.get(
    _PATH,
    operation_id="getQuery",
    summary="Read a stored answer",
    response_model=QueryAnswer,
    responses={200: _EXAMPLE, **problems(404, 410, 422, 503)},
)
def get_query(collection: CollectionId, query: QueryId, service: ServiceDep) -> Response:
    """Of a query that was asked with `store`. 410 when it is no longer kept."""
    return json_response(stored.stored_answer(service.database, collection, query))


@router.get(
    f"{_PATH}/candidates/{{rank}}/match",
    operation_id="getMatch",
    summary="See a match",
    response_model=MatchAnswer,
    responses={
        200: {
            "content": {
                JSON: {"example": _MATCH},
                SVG: _SVG,
            }
        },
        **problems(404, 406, 410, 422, 503),
    },
)
def get_match(
    collection: CollectionId,
    query: QueryId,
    rank: Annotated[int, Path(description="`rank` of the candidate.", examples=[1], ge=1)],
    service: ServiceDep,
    budget: BudgetDep,
    accept: Accept = None,
) -> Response:
    """A candidate of a stored query drawn as SVG: both forests overlaid, inlier pairs joined; or the same as JSON.

    Of either side the drawing shows 5,000 landmarks, those of the overlap first, and says so where there are more. 503
    where it takes longer than `query_seconds`. 410 when the submap's landmarks are no longer those that were matched.
    """
    media_type = choose(accept, [SVG, JSON])
    with in_time(service, budget) as own:
        match = stored.stored_match(service.database, collection, query, rank)
        if media_type == SVG:
            return Response(match.to_svg(own), media_type=SVG, headers={"Vary": "Accept"})
    return json_response(match.to_answer(), headers={"Vary": "Accept"})


@router.get(
    f"{_PATH}/explanation",
    operation_id="getExplanation",
    summary="See why the answer is what it is",
    response_model=ExplanationAnswer,
    responses={
        200: {"content": {JSON: {"example": examples.EXPLANATION}, SVG: _SVG}},
        **problems(404, 406, 410, 422, 503),
    },
)
def get_explanation(
    collection: CollectionId, query: QueryId, service: ServiceDep, budget: BudgetDep, accept: Accept = None
) -> Response:
    """What each stage took, and what each level found in each submap, against the gates; drawn as SVG, or as JSON.

    The drawing lays the query over the best candidate, and over its strongest rival. 410 when it is no longer kept.
    """
    media_type = choose(accept, [SVG, JSON])
    with in_time(service, budget) as own:
        explained = stored.stored_explanation(service.database, collection, query)
        if media_type == SVG:
            return Response(explained.to_svg(own), media_type=SVG, headers={"Vary": "Accept"})
    return json_response(explained.to_answer(), headers={"Vary": "Accept"})
