"""Requests and their answers, without any I/O.

Each function takes the caller's arguments and returns a `Request`: what to send, and how to read the answer. The
clients are shells around them: they send it, blocking or asynchronously, and call `exchange.answer`.
"""

import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, TypeVar
from urllib.parse import quote

import httpx

from urquhart_client._protocol.bodies import given, written
from urquhart_client._protocol.exchange import Request, document, model, nothing, page, text
from urquhart_client.errors import ProblemError, UnexpectedAnswer
from urquhart_client.models import (
    Collection,
    Explanation,
    Limits,
    Page,
    QueryResult,
    SessionSummary,
    Submap,
    SubmapReceipt,
    Tessellation,
)

T = TypeVar("T")

JSON: Final = "application/json"
SVG: Final = "image/svg+xml"


# ---------------------------------------------------------------- service


def get_landing() -> Request[dict[str, Any]]:
    """The landing page."""
    return Request("GET", "/", document, headers={"Accept": JSON})


def get_probe(name: str) -> Request[dict[str, Any]]:
    """`livez` or `readyz`."""
    return Request("GET", f"/{name}", document, headers={"Accept": JSON})


def get_metrics() -> Request[str]:
    """Metrics, as text."""
    return Request("GET", "/metrics", text)


def get_limits() -> Request[Limits]:
    """The limits of requests."""
    return Request("GET", "/v1/limits", model(Limits))


# ------------------------------------------------------------ collections


def get_collections(limit: int | None, cursor: str | None) -> Request[Page[Collection]]:
    """A page of collections."""
    return Request(
        "GET", "/v1/collections", page("collections", Collection), params=parameters(limit=limit, cursor=cursor)
    )


def put_collection(
    collection: str,
    title: str | None,
    config: Mapping[str, Any] | None,
    crs: str | None,
    origin: Sequence[float] | None,
    frames: Mapping[str, Mapping[str, Any]] | None,
) -> Request[Collection]:
    """Create a collection, or check that it is the same."""
    body = given(
        title=title,
        config=None if config is None else dict(config),
        crs=crs,
        origin=None if origin is None else [float(value) for value in origin],
        frames=frames,
    )
    return with_body("PUT", collection_path(collection), body, model(Collection), once())


def get_collection(collection: str) -> Request[Collection]:
    """One collection."""
    return Request("GET", collection_path(collection), model(Collection))


def patch_collection(collection: str, changes: Mapping[str, Any]) -> Request[Collection]:
    """Change members of a collection."""
    return with_body("PATCH", collection_path(collection), changes, model(Collection), once())


def delete_collection(collection: str) -> Request[None]:
    """Delete a collection."""
    return Request("DELETE", collection_path(collection), nothing, headers=once())


# ---------------------------------------------------------------- submaps


def put_submap(
    collection: str,
    submap_id: str,
    body: Mapping[str, Any],
    if_match: str | None,
    if_none_match: str | None,
) -> Request[SubmapReceipt]:
    """Store a submap under an id."""
    request = with_body("PUT", _submap(collection, submap_id), body, model(SubmapReceipt), once())
    return conditional(request, if_match, if_none_match)


def post_submap(collection: str, body: Mapping[str, Any], key: str | None) -> Request[SubmapReceipt]:
    """Store a submap under a new id of the service."""
    return with_body("POST", f"{collection_path(collection)}/submaps", body, model(SubmapReceipt), once(key))


def get_sessions(collection: str, limit: int | None, cursor: str | None) -> Request[Page[SessionSummary]]:
    """A page of sessions."""
    return Request(
        "GET",
        f"{collection_path(collection)}/sessions",
        page("sessions", SessionSummary),
        params=parameters(limit=limit, cursor=cursor),
    )


def get_submaps(
    collection: str,
    bbox: Sequence[float] | None,
    interval: str | None,
    session: str | None,
    limit: int | None,
    cursor: str | None,
) -> Request[Page[Submap]]:
    """A page of submaps."""
    box = None if bbox is None else ",".join(repr(float(value)) for value in bbox)
    params = parameters(bbox=box, datetime=interval, session=session, limit=limit, cursor=cursor)
    return Request(
        "GET",
        f"{collection_path(collection)}/submaps",
        page("submaps", Submap),
        params=params,
        headers={"Accept": JSON},
    )


def get_submap(collection: str, submap_id: str) -> Request[Submap]:
    """One submap with its landmarks."""
    return Request("GET", _submap(collection, submap_id), model(Submap), headers={"Accept": JSON})


def patch_submap(collection: str, submap_id: str, changes: Mapping[str, Any], if_match: str | None) -> Request[Submap]:
    """Change members of a submap."""
    request = with_body("PATCH", _submap(collection, submap_id), changes, model(Submap), once())
    return conditional(request, if_match, None)


def delete_submap(collection: str, submap_id: str, if_match: str | None) -> Request[None]:
    """Delete a submap."""
    request = Request("DELETE", _submap(collection, submap_id), nothing, headers=once())
    return conditional(request, if_match, None)


def get_tessellation(collection: str, submap_id: str) -> Request[Tessellation]:
    """A submap's tessellation as data."""
    path = f"{_submap(collection, submap_id)}/tessellation"
    return Request("GET", path, model(Tessellation), headers={"Accept": JSON})


def get_tessellation_svg(collection: str, submap_id: str) -> Request[str]:
    """A submap's tessellation as a drawing."""
    path = f"{_submap(collection, submap_id)}/tessellation"
    return Request("GET", path, text, headers={"Accept": SVG})


# ---------------------------------------------------------------- queries


def post_query(collection: str, body: Mapping[str, Any]) -> Request[QueryResult]:
    """Answer a query."""
    return _asking(with_body("POST", f"{collection_path(collection)}/queries", body, model(QueryResult)), [body])


def post_batch(
    collection: str, queries: Sequence[Mapping[str, Any]], timeout_ms: int | None
) -> Request[tuple[QueryResult | ProblemError, ...]]:
    """Answer several queries."""

    def parse(response: httpx.Response) -> tuple[QueryResult | ProblemError, ...]:
        found = document(response).get("results")
        if not isinstance(found, list) or len(found) != len(queries):
            raise UnexpectedAnswer("there is not one answer for each query", response.status_code, response.text[:500])
        return tuple(
            ProblemError(int(one["problem"]["status"]), one["problem"])
            if "problem" in one
            else QueryResult.model_validate(one)
            for one in found
        )

    body = {"queries": list(queries)} | given(timeout_ms=timeout_ms)
    request = with_body("POST", f"{collection_path(collection)}/queries/batch", body, parse)
    return _asking(request, queries)


def get_query(collection: str, query_id: str) -> Request[QueryResult]:
    """A stored answer."""
    return Request("GET", f"{collection_path(collection)}/queries/{segment(query_id, 'query')}", model(QueryResult))


def get_match_svg(collection: str, query_id: str, rank: int) -> Request[str]:
    """A candidate of a stored answer as a drawing."""
    path = f"{collection_path(collection)}/queries/{segment(query_id, 'query')}/candidates/{rank}/match"
    return Request("GET", path, text, headers={"Accept": SVG})


def get_explanation(collection: str, query_id: str) -> Request[Explanation]:
    """The explanation of a stored answer as data."""
    path = f"{collection_path(collection)}/queries/{segment(query_id, 'query')}/explanation"
    return Request("GET", path, model(Explanation), headers={"Accept": JSON})


def get_explanation_svg(collection: str, query_id: str) -> Request[str]:
    """The explanation of a stored answer as a drawing."""
    path = f"{collection_path(collection)}/queries/{segment(query_id, 'query')}/explanation"
    return Request("GET", path, text, headers={"Accept": SVG})


# ------------------------------------------------------------------- parts


def collection_path(collection: str) -> str:
    """Path of a collection."""
    return f"/v1/collections/{segment(collection, 'collection')}"


def _submap(collection: str, submap_id: str) -> str:
    return f"{collection_path(collection)}/submaps/{segment(submap_id, 'submap')}"


def segment(name: str, kind: str) -> str:
    """A name as part of a path. Raises ValueError if it cannot be one."""
    # "." and ".." are resolved on the way, even if escaped, so the request would reach another resource.
    if name in ("", ".", ".."):
        raise ValueError(f"{name!r} cannot be the id of a {kind}")
    return quote(name, safe="")


def parameters(**fields: str | int | float | None) -> dict[str, str | int | float]:
    """The query parameters that are given."""
    return {name: value for name, value in fields.items() if value is not None}


def once(key: str | None = None) -> dict[str, str]:
    """The header Idempotency-Key, by which a write is carried out once; a new key if none is given."""
    return {"Idempotency-Key": key if key is not None else uuid.uuid4().hex}


def with_body(
    method: str,
    path: str,
    body: Mapping[str, Any],
    parse: Callable[[httpx.Response], T],
    headers: Mapping[str, str] | None = None,
) -> Request[T]:
    """A request with a JSON body. Raises ValueError for numbers that JSON does not have."""
    return Request(
        method, path, parse, headers={"Content-Type": JSON, "Accept": JSON, **(headers or {})}, content=written(body)
    )


def _asking(request: Request[T], queries: Sequence[Mapping[str, Any]]) -> Request[T]:
    """A request with `queries`. With `store` it is a write; otherwise it changes nothing."""
    if any(query.get("store", False) for query in queries):
        return replace(request, headers={**request.headers, **once()})
    return replace(request, harmless=True)


def conditional(request: Request[T], if_match: str | None, if_none_match: str | None) -> Request[T]:
    """A request with the headers If-Match and If-None-Match, if they are given."""
    conditions = {
        name: _entity_tag(tag)
        for name, tag in (("If-Match", if_match), ("If-None-Match", if_none_match))
        if tag is not None
    }
    return replace(request, headers={**request.headers, **conditions})


def _entity_tag(tag: str) -> str:
    return tag if tag == "*" or tag.endswith('"') else f'"{tag}"'
