"""Answers of routes: JSON and its headers, stored answers, 304, and the documentation of errors."""

import re
from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import Request, Response
from pydantic import BaseModel

from server.http.problems import MEDIA_TYPE
from server.resources.idempotency import StoredResponse
from server.schemas.common import (
    PROBLEM_EXAMPLE,
    Problem,
    to_json,
)

_ETAG = re.compile(r'\s*(?:W/)?"([^"]*)"\s*')


def json_response(
    content: BaseModel | dict[str, Any] | bytes,
    status: int = 200,
    *,
    media_type: str = "application/json",
    headers: dict[str, str] | None = None,
) -> Response:
    """A JSON answer, without NaN and Infinity. The members `next` and `query` are left out if they are None."""
    match content:
        case BaseModel():
            body = to_json(content)
        case dict():
            body = orjson.dumps(content)
        case _:
            body = content
    return Response(body, status, headers=headers, media_type=media_type)


def stored_response(response: StoredResponse) -> Response:
    """The answer to a write, which was stored if the request has an Idempotency-Key."""
    headers = response.headers | ({"Idempotency-Replayed": "true"} if response.replayed else {})
    return Response(
        response.body, response.status, headers=headers, media_type="application/json" if response.body else None
    )


def etag_header(etag: str) -> dict[str, str]:
    """The header with an entity tag."""
    return {"ETag": f'"{etag}"'}


def next_link(path: str, request: Request, cursor: str) -> str:
    """Value of the header Link for the next page."""
    return f'<{path}?{urlencode({**request.query_params, "cursor": cursor})}>; rel="next"'


def not_modified(if_none_match: str | None, etag: str, *, vary: str | None = None) -> Response | None:
    """304 if the caller has the current version, else None. `vary`: the header Vary of the full answer."""
    tags = entity_tags(if_none_match)
    if tags is not None and (etag in tags or "*" in tags):
        return Response(status_code=304, headers=etag_header(etag) | ({} if vary is None else {"Vary": vary}))
    return None


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Documentation of the errors of a route."""
    described = {
        400: "The body is not JSON.",
        401: "No usable key, where keys are asked for.",
        403: "The key does not allow this.",
        404: "Not found.",
        405: "Method not allowed.",
        406: "Not acceptable.",
        408: "The request did not arrive in time.",
        409: "Conflict with what is stored.",
        410: "No longer kept.",
        412: "A precondition does not hold.",
        413: "A limit is exceeded.",
        415: "The body is not sent as JSON.",
        416: "The file does not reach to where the range begins.",
        422: "The request is not valid.",
        429: "This key, or address, asks too often.",
        500: "Internal error.",
        501: "A package that this needs is not installed where the service runs.",
        503: "Not ready, overloaded, or the database is busy or cannot be written.",
        507: "The disk is full.",
    }
    return {
        status: {
            "description": described[status],
            "content": {
                MEDIA_TYPE: {
                    "schema": {"$ref": f"#/components/schemas/{Problem.__name__}"},
                    "example": PROBLEM_EXAMPLE | {"status": status},
                }
            },
        }
        for status in (*statuses, 500)
    }


def lines_of(*models: type[BaseModel]) -> dict[str, Any]:
    """The schema of NDJSON with a line of one of these models.

    OpenAPI 3.1 has no keyword for the schema of a line, so our own member `x-line` names it.
    """
    return {"type": "string", "x-line": [{"$ref": f"#/components/schemas/{model.__name__}"} for model in models]}


def entity_tags(header: str | None) -> tuple[str, ...] | None:
    """The tags of If-Match or If-None-Match, without quotes and W/. None if the header is missing."""
    if header is None:
        return None
    if header.strip() == "*":
        return ("*",)
    return tuple(match.group(1) if (match := _ETAG.fullmatch(part)) else part.strip() for part in header.split(","))
