"""One request and how its answer is read: the types between the builders in `_requests` and the clients' shells."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from urquhart_client.errors import ProblemError, UnexpectedAnswer
from urquhart_client.models import Page

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Request(Generic[T]):
    """What to send, and `parse` to read a successful response."""

    method: str
    path: str
    parse: Callable[[httpx.Response], T]
    params: Mapping[str, str | int | float] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None


def answer(request: Request[T], response: httpx.Response) -> T:
    """Read `response`, whose body has been received.

    Raises:
        ProblemError: the service refused.
        UnexpectedAnswer: the response is not one of the service.
    """
    if response.is_success:
        return request.parse(response)
    document = _json(response) if "json" in response.headers.get("content-type", "") else None
    if not isinstance(document, dict):
        raise _unexpected(response, f"{response.status_code} without a problem document")
    raise ProblemError(response.status_code, document, _retry_after(response))


def _json(response: httpx.Response) -> Any:
    try:
        return json.loads(response.content)
    except ValueError as error:
        raise _unexpected(response, f"{response.status_code} with a body that is not JSON") from error


def document(response: httpx.Response) -> dict[str, Any]:
    """The body, a JSON object."""
    members = _json(response)
    if not isinstance(members, dict):
        raise _unexpected(response, "a JSON object was expected")
    return members


def text(response: httpx.Response) -> str:
    """The body as text."""
    return response.text


def nothing(response: httpx.Response) -> None:
    """An answer that says all by its status."""


def model(kind: type[M]) -> Callable[[httpx.Response], M]:
    """A parser of documents of one `kind`."""

    def parse(response: httpx.Response) -> M:
        members = document(response)
        try:
            return kind.model_validate(members)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            raise _unexpected(response, f"not a {kind.__name__}: {place} {first['msg']}") from error

    return parse


def page(name: str, item: type[M]) -> Callable[[httpx.Response], Page[M]]:
    """A parser of one page of a listing, whose rows are under `name`."""

    def parse(response: httpx.Response) -> Page[M]:
        members = document(response)
        try:
            return Page(items=tuple(item.model_validate(one) for one in members[name]), next=members.get("next"))
        except (KeyError, TypeError, ValidationError) as error:
            raise _unexpected(response, f"not a page of {name}") from error

    return parse


def _retry_after(response: httpx.Response) -> float | None:
    try:
        seconds = float(response.headers.get("retry-after", ""))
    except ValueError:  # absent, or a date, which this service does not send
        return None
    return seconds if math.isfinite(seconds) and seconds >= 0 else None


def _unexpected(response: httpx.Response, what: str) -> UnexpectedAnswer:
    return UnexpectedAnswer(f"unexpected answer from {response.url}: {what}", response.status_code, response.text[:500])
