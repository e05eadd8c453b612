"""Routes of queries: where was this observation made?"""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from server.coregistration.outputs.match_trees import match_trees
from server.http.admission.request_admission import BudgetDep
from server.http.json_body import JsonRoute
from server.http.negotiation import CSV, GEOJSON, JSON, SVG, choose
from server.http.responses import json_response, next_link, problems
from server.outputs.csv_text import csv_pieces
from server.outputs.geojson_text import geojson_pieces
from server.queries import lookup, stored_queries
from server.queries.batch import answer_batch
from server.queries.listing.newest import newest_queries
from server.queries.query import PlaceQuery
from server.resources import links
from server.resources.paging import PageRequest
from server.routes.dependencies import (
    Accept,
    CollectionId,
    IdempotencyKeyDep,
    PageCursor,
    PageLimit,
    PrincipalDep,
    ServiceDep,
    in_time,
)
from server.schemas import examples
from server.schemas.listings.queries import QUERY_PAGE_EXAMPLE, QueryPage
from server.schemas.queries import BatchAnswer, BatchInput, ExplanationAnswer, MatchAnswer, QueryAnswer, QueryInput
from server.security.principal import Scope
from urquhart import Verdict

router = APIRouter(route_class=JsonRoute, tags=["queries"])
_ALL = "/v1/collections/{collection}/queries"
_PATH = f"{_ALL}/{{query}}"
_EXAMPLE = {"content": {JSON: {"example": examples.QUERY_ANSWER}}}
_MATCH = {
    "query_id": "17",
    "candidate": examples.QUERY_ANSWER["candidates"][0],
    "query_landmarks": [[0.4, 2.9], [5.1, -1.7]],
    "submap_landmarks": [[1.2, 3.4], [4.9, -2.2]],
    "query_ids": ["0", "1"],
    "submap_ids": ["t17", "t3"],
}

_TREES = (
    "seen,tag,partner,x,y,partner_dbh_cm,residual_m,frame_id,crs\nboth,7,t31,448125.0190,5411179.4430,21.1,0.08,als,\n"
)
_SVG = {"schema": {"type": "string"}, "example": "<svg xmlns='http://www.w3.org/2000/svg'></svg>"}

QueryId = Annotated[str, Path(description="`id` of the stored answer.", examples=["17"], alias="query", max_length=128)]


@router.post(
    _ALL,
    operation_id="query",
    summary="Find where an observation was made",
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
    """Decide by `verdict` (`matched`, `ambiguous` or `no_match`), not by the pose. Too few trees give `no_match`, not
    an error; `reason` says why.

    The search covers every submap stored before the request. A query with `store` is a write: repeated with the same
    `Idempotency-Key`, it returns the first answer. Other queries change nothing and are searched again.
    """
    if body.store:
        caller.require(Scope.WRITE)
    asked, headers = PlaceQuery.of(body, service.limits), {}
    if not asked.store:
        answered, _ = lookup.answer_as_json(service.queries, collection, asked, budget=budget)
        return json_response(answered)
    key = stored_queries.AnswerKey(idempotency_key)
    answer = stored_queries.kept_answer(service.database, collection, key)
    if answer is not None:
        answer, headers = lookup.shown(answer, asked), {"Idempotency-Replayed": "true"}
    else:
        answer = lookup.answer_query(service.queries, collection, asked, key=key, budget=budget)
    if answer.links.self:
        headers["Location"] = answer.links.self
    return json_response(answer, headers=headers)


@router.post(
    f"{_ALL}/batch",
    operation_id="queryBatch",
    summary="Send several queries at once",
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
    """Each query is answered as if it were sent alone. `results` keeps the order; an invalid query has a `problem` in
    its place.

    If you repeat the batch with the same `Idempotency-Key`, queries with `store` return their first answer, and the
    others are searched again.
    """
    results = answer_batch(service.queries, caller, collection, body, budget, idempotency_key)
    return json_response(b'{"results":[' + b",".join(results) + b"]}")


@router.get(
    _ALL,
    operation_id="listQueries",
    summary="List stored queries",
    response_model=QueryPage,
    responses={200: {"content": {JSON: {"example": QUERY_PAGE_EXAMPLE}}}, **problems(404, 422, 503)},
)
def list_queries(
    request: Request,
    collection: CollectionId,
    service: ServiceDep,
    verdict: Annotated[Verdict | None, Query(description="Only queries with this verdict.")] = None,
    limit: PageLimit = None,
    cursor: PageCursor = None,
) -> Response:
    """Lists the queries that were sent with `store` and are still kept, newest first. A page may have fewer entries
    than `limit`, and still a `next`, if few queries have the verdict.
    """
    asked = PageRequest(limit, cursor)
    page = newest_queries(service.database, service.settings.limits, collection, asked, verdict)
    path = links.collection(collection) + "/queries"
    headers = {} if page.next is None else {"Link": next_link(path, request, page.next)}
    return json_response(page, headers=headers)


@router.get(
    _PATH,
    operation_id="getQuery",
    summary="Read a stored answer",
    response_model=QueryAnswer,
    responses={200: _EXAMPLE, **problems(404, 410, 422, 503)},
)
def get_query(collection: CollectionId, query: QueryId, service: ServiceDep) -> Response:
    """Returns the answer to a query that was sent with `store`. 410 if it is no longer kept."""
    return json_response(stored_queries.stored_answer(service.database, collection, query))


@router.get(
    f"{_PATH}/candidates/{{rank}}/match",
    operation_id="getMatch",
    summary="Draw a match",
    response_model=MatchAnswer,
    responses={
        200: {
            "content": {
                JSON: {"example": _MATCH},
                SVG: _SVG,
                CSV: {"schema": {"type": "string"}, "example": _TREES},
                GEOJSON: {"schema": {"type": "object"}, "example": {"type": "FeatureCollection", "features": []}},
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
    """Describes a candidate of a stored query as JSON, or draws it with `Accept: image/svg+xml`: both sets of trees
    overlaid, with lines between inliers.

    With `Accept: text/csv` or `application/geo+json` it lists every tree of the query with its partner among all trees
    of the map there (`seen`: `both`), or without (`query`), and the trees of the map amid them that have none (`map`).
    Positions are full coordinates of the map frame, in GeoJSON longitude and latitude.

    The drawing shows at most 5,000 landmarks of each side, those in the overlap first, and says if there are more. 503
    if drawing takes longer than `query_seconds`. 410 if the submap's landmarks have changed since.
    """
    media_type = choose(accept, [JSON, SVG, CSV, GEOJSON])
    with in_time(service, budget) as own:
        match = stored_queries.stored_match(service.database, collection, query, rank)
        if media_type == SVG:
            return Response(match.to_svg(own), media_type=SVG, headers={"Vary": "Accept"})
        if media_type != JSON:
            layer, rows = match_trees(service.database, collection, match)
            pieces = csv_pieces(layer, [rows]) if media_type == CSV else geojson_pieces(layer, [rows])
            return Response(b"".join(pieces), media_type=media_type, headers={"Vary": "Accept"})
    return json_response(match.to_answer(), headers={"Vary": "Accept"})


@router.get(
    f"{_PATH}/explanation",
    operation_id="getExplanation",
    summary="Explain an answer",
    response_model=ExplanationAnswer,
    responses={
        200: {"content": {JSON: {"example": examples.EXPLANATION}, SVG: _SVG}},
        **problems(404, 406, 410, 422, 503),
    },
)
def get_explanation(
    collection: CollectionId, query: QueryId, service: ServiceDep, budget: BudgetDep, accept: Accept = None
) -> Response:
    """Shows the time of each stage, and what each level found in each submap compared with the gates. As JSON, or as
    a drawing with `Accept: image/svg+xml`.

    The drawing overlays the query on the best candidate and on its strongest rival. 410 if the answer is no longer
    kept.
    """
    media_type = choose(accept, [JSON, SVG])
    with in_time(service, budget) as own:
        explained = stored_queries.stored_explanation(service.database, collection, query)
        if media_type == SVG:
            return Response(explained.to_svg(own), media_type=SVG, headers={"Vary": "Accept"})
    return json_response(explained.to_answer(), headers={"Vary": "Accept"})
