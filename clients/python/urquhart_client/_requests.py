"""Requests built and answers read, without any input or output: what every client of this package is a shell around.

A function here takes the caller's arguments and returns a `Request`: what to send, and how to read what comes back. The
shell sends it in its own way (blocking or awaiting) and hands the response to `_exchange.answer`.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, Final, TypeVar
from urllib.parse import quote

import httpx

from urquhart_client._bodies import given, rfc3339
from urquhart_client._exchange import Request, document, model, nothing, page, text
from urquhart_client.models import (
    Collection,
    Explanation,
    Limits,
    Method,
    Page,
    QueryResult,
    Submap,
    SubmapReceipt,
    Tessellation,
)

T = TypeVar("T")

JSON: Final = "application/json"
SVG: Final = "image/svg+xml"


# ---------------------------------------------------------------- service


def get_landing() -> Request[dict[str, Any]]:
    """What the service is."""
    return Request("GET", "/", document, headers={"Accept": JSON})


def get_probe(name: str) -> Request[dict[str, Any]]:
    """`livez` or `readyz`."""
    return Request("GET", f"/{name}", document, headers={"Accept": JSON})


def get_metrics() -> Request[str]:
    """Metrics, as text."""
    return Request("GET", "/metrics", text)


def get_limits() -> Request[Limits]:
    """What requests are held to."""
    return Request("GET", "/v1/limits", model(Limits))


# ------------------------------------------------------------ collections


def get_collections(limit: int | None, cursor: str | None) -> Request[Page[Collection]]:
    """A page of collections."""
    return Request(
        "GET", "/v1/collections", page("collections", Collection), params=_params(limit=limit, cursor=cursor)
    )


def put_collection(
    collection: str,
    title: str | None,
    config: Mapping[str, Any] | None,
    crs: str | None,
    origin: Sequence[float] | None,
) -> Request[Collection]:
    """Make a collection, or find it the same."""
    body = given(
        title=title,
        config=None if config is None else dict(config),
        crs=crs,
        origin=None if origin is None else [float(value) for value in origin],
    )
    return _with_body("PUT", _collection(collection), body, model(Collection))


def get_collection(collection: str) -> Request[Collection]:
    """One collection."""
    return Request("GET", _collection(collection), model(Collection))


def patch_collection(collection: str, changes: Mapping[str, Any]) -> Request[Collection]:
    """Change fields of a collection."""
    return _with_body("PATCH", _collection(collection), changes, model(Collection))


def delete_collection(collection: str) -> Request[None]:
    """Drop a collection."""
    return Request("DELETE", _collection(collection), nothing)


# ---------------------------------------------------------------- submaps


def put_submap(
    collection: str,
    submap_id: str,
    body: Mapping[str, Any],
    if_match: str | None,
    if_none_match: str | None,
) -> Request[SubmapReceipt]:
    """Store a submap under an id."""
    request = _with_body("PUT", _submap(collection, submap_id), body, model(SubmapReceipt))
    return _conditional(request, if_match, if_none_match)


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
    params = _params(bbox=box, datetime=interval, session=session, limit=limit, cursor=cursor)
    return Request(
        "GET",
        f"{_collection(collection)}/submaps",
        page("submaps", Submap),
        params=params,
        headers={"Accept": JSON},
    )


def get_submap(collection: str, submap_id: str) -> Request[Submap]:
    """One submap with its landmarks."""
    return Request("GET", _submap(collection, submap_id), model(Submap), headers={"Accept": JSON})


def patch_submap(collection: str, submap_id: str, changes: Mapping[str, Any], if_match: str | None) -> Request[Submap]:
    """Change fields of a submap."""
    request = _with_body("PATCH", _submap(collection, submap_id), changes, model(Submap))
    return _conditional(request, if_match, None)


def delete_submap(collection: str, submap_id: str, if_match: str | None) -> Request[None]:
    """Remove a submap."""
    return _conditional(Request("DELETE", _submap(collection, submap_id), nothing), if_match, None)


def get_tessellation(collection: str, submap_id: str) -> Request[Tessellation]:
    """A submap's tessellation, as data."""
    path = f"{_submap(collection, submap_id)}/tessellation"
    return Request("GET", path, model(Tessellation), headers={"Accept": JSON})


def get_tessellation_svg(collection: str, submap_id: str) -> Request[str]:
    """A submap's tessellation, drawn."""
    path = f"{_submap(collection, submap_id)}/tessellation"
    return Request("GET", path, text, headers={"Accept": SVG})


# ---------------------------------------------------------------- queries


def post_query(
    collection: str,
    observation: Mapping[str, Any],
    limit: int,
    method: Method | None,
    seed: int | None,
    store: bool,
    explain: bool,
    frame_id: str | None,
    stamp: datetime | str | None,
    near: Mapping[str, Any] | None,
    exclude: Mapping[str, Any] | None,
) -> Request[QueryResult]:
    """Ask where an observation was made."""
    body = dict(observation) | given(
        limit=limit,
        method=method,
        seed=seed,
        store=store or None,
        explain=explain or None,
        frame_id=frame_id,
        stamp=rfc3339(stamp),
        near=None if near is None else dict(near),
        exclude=None if exclude is None else dict(exclude),
    )
    return _with_body("POST", f"{_collection(collection)}/queries", body, model(QueryResult))


def get_query(collection: str, query_id: str) -> Request[QueryResult]:
    """A stored answer."""
    return Request("GET", f"{_collection(collection)}/queries/{_segment(query_id, 'query')}", model(QueryResult))


def get_match_svg(collection: str, query_id: str, rank: int) -> Request[str]:
    """A stored answer's candidate, drawn."""
    path = f"{_collection(collection)}/queries/{_segment(query_id, 'query')}/candidates/{rank}/match"
    return Request("GET", path, text, headers={"Accept": SVG})


def get_explanation(collection: str, query_id: str) -> Request[Explanation]:
    """Why a stored answer is what it is, as data."""
    path = f"{_collection(collection)}/queries/{_segment(query_id, 'query')}/explanation"
    return Request("GET", path, model(Explanation), headers={"Accept": JSON})


def get_explanation_svg(collection: str, query_id: str) -> Request[str]:
    """Why a stored answer is what it is, drawn."""
    path = f"{_collection(collection)}/queries/{_segment(query_id, 'query')}/explanation"
    return Request("GET", path, text, headers={"Accept": SVG})


# ------------------------------------------------------------------- parts


def _collection(collection: str) -> str:
    return f"/v1/collections/{_segment(collection, 'collection')}"


def _submap(collection: str, submap_id: str) -> str:
    return f"{_collection(collection)}/submaps/{_segment(submap_id, 'submap')}"


def _segment(name: str, kind: str) -> str:
    # "." and ".." are resolved as paths on the way, whatever their escape: the request would reach another resource.
    if name in ("", ".", ".."):
        raise ValueError(f"{name!r} is not the id of a {kind}")
    return quote(name, safe="")


def _params(**fields: str | int | float | None) -> dict[str, str | int | float]:
    return {name: value for name, value in fields.items() if value is not None}


def _with_body(method: str, path: str, body: Mapping[str, Any], parse: Callable[[httpx.Response], T]) -> Request[T]:
    try:
        content = json.dumps(body, allow_nan=False, separators=(",", ":")).encode()
    except ValueError as error:
        raise ValueError("the request holds a number that is not finite") from error
    return Request(method, path, parse, headers={"Content-Type": JSON, "Accept": JSON}, content=content)


def _conditional(request: Request[T], if_match: str | None, if_none_match: str | None) -> Request[T]:
    conditions = {
        name: _entity_tag(tag)
        for name, tag in (("If-Match", if_match), ("If-None-Match", if_none_match))
        if tag is not None
    }
    return replace(request, headers={**request.headers, **conditions})


def _entity_tag(tag: str) -> str:
    return tag if tag == "*" or tag.endswith('"') else f'"{tag}"'
