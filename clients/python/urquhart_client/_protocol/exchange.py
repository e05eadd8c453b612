"""One request, and how its answer is read: the types between the request builders and the clients' shells."""

import gzip
import json
import math
import uuid
import zlib
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import anyio.to_thread
import httpx
from pydantic import BaseModel, ValidationError

from urquhart_client.errors import ConnectionFailed, ProblemError, UnexpectedAnswer
from urquhart_client.models import Page

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)
_PIECE: Final = 1 << 18
_LEAST: Final = 8192
"""Bytes from which a body is compressed."""


@dataclass(frozen=True, slots=True)
class Request(Generic[T]):
    """A request, and `parse`, which reads a successful response."""

    method: str
    path: str
    parse: Callable[[httpx.Response], T]
    params: Mapping[str, str | int | float] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    content: "bytes | Upload | None" = None
    harmless: bool = False

    @property
    def is_keyed(self) -> bool:
        """Whether the service recognises a repetition by its Idempotency-Key."""
        return "Idempotency-Key" in self.headers

    def may_follow(self, outcome: httpx.Response | Exception) -> bool:
        """Whether the request may be sent again after an attempt with this outcome.

        A search that timed out, at the caller or at a proxy, would take as long again, so it is not repeated.
        """
        if self.method in ("GET", "HEAD") or self.is_keyed:
            return True
        late = isinstance(outcome, httpx.ReadTimeout) or (
            isinstance(outcome, httpx.Response) and outcome.status_code == httpx.codes.GATEWAY_TIMEOUT
        )
        return self.harmless and not late

    def packed(self) -> "Request[T]":
        """The same request with a compressed body, if that is worth it."""
        if not isinstance(self.content, bytes) or len(self.content) < _LEAST or "Content-Encoding" in self.headers:
            return self
        body = gzip.compress(self.content, 4, mtime=0)
        return replace(self, content=body, headers={**self.headers, "Content-Encoding": "gzip"})


class Upload:
    """A body that is read from a file while it is sent, from the beginning each time."""

    def __init__(self, source: Path, *, packed: bool, sent: Callable[[int], None]) -> None:
        self._source, self._packed, self._sent = source, packed, sent

    def pieces(self) -> Iterator[bytes]:
        """The bytes to send, from the first one."""
        packer = None if self._packed else zlib.compressobj(4, wbits=31)
        read = 0
        with self._source.open("rb") as file:
            while piece := file.read(_PIECE):
                read += len(piece)
                self._sent(read)
                if out := piece if packer is None else packer.compress(piece):
                    yield out
        if packer is not None:
            yield packer.flush()

    async def awaited_pieces(self) -> AsyncIterator[bytes]:
        """The same, read in a thread."""
        pieces = self.pieces()
        while (piece := await anyio.to_thread.run_sync(next, pieces, None)) is not None:
            yield piece


def blocking_body(content: bytes | Upload | None) -> bytes | Iterator[bytes] | None:
    """A body as a blocking HTTP client takes it."""
    return content.pieces() if isinstance(content, Upload) else content


def awaiting_body(content: bytes | Upload | None) -> bytes | AsyncIterator[bytes] | None:
    """A body as an asynchronous HTTP client takes it."""
    return content.awaited_pieces() if isinstance(content, Upload) else content


def bearer(api_key: str) -> str:
    """The header Authorization for a key. Raises ValueError if no header can carry it, without revealing the key."""
    if not api_key or any(not "!" <= character <= "~" for character in api_key):
        raise ValueError("the API key is empty, or has a space or a character that no key has: was it copied whole?")
    return f"Bearer {api_key}"


def labelled(request: Request[Any]) -> dict[str, str]:
    """The headers of one attempt, with an id that identifies its answer."""
    return {**request.headers, "X-Request-Id": uuid.uuid4().hex}


def foreign(response: httpx.Response, sent: Mapping[str, str]) -> UnexpectedAnswer | None:
    """The error if `response` answers another request than the one whose headers were `sent`."""
    answered = response.headers.get("X-Request-Id")
    if answered is None or answered == sent["X-Request-Id"]:
        return None  # a proxy's own answer has no id
    return UnexpectedAnswer(
        f"the answer is to another request: its X-Request-Id is {answered!r}, and {sent['X-Request-Id']!r} was sent. "
        "Do two processes share this connection?",
        response.status_code,
        "",
    )


def failed(request: Request[Any], error: Exception, service: httpx.URL) -> ConnectionFailed:
    """The message for a connection that failed or broke. It contains no headers, which may have keys."""
    address = str(service.copy_with(userinfo=b"")).rstrip("/")
    return ConnectionFailed(f"{request.method} {address}{request.path}: {error or type(error).__name__}")


def answer(request: Request[T], response: httpx.Response, *, lost: bool = False) -> T:
    """Read `response`, whose body has been received.

    `lost`: the request was sent before with an unknown outcome. If a DELETE then finds nothing, the first attempt
    deleted it.

    Raises:
        ProblemError: the service refused.
        UnexpectedAnswer: the response is not one of the service.
    """
    if response.is_success or (lost and request.method == "DELETE" and response.status_code == 404):
        return request.parse(response)
    document = _json(response) if "json" in response.headers.get("content-type", "") else None
    if not isinstance(document, dict):
        raise unexpected(response, f"{response.status_code} without a problem document")
    raise ProblemError(response.status_code, document, retry_after(response))


def _json(response: httpx.Response) -> Any:
    try:
        return json.loads(response.content)
    except ValueError as error:
        raise unexpected(response, f"{response.status_code} with a body that is not JSON") from error


def document(response: httpx.Response) -> dict[str, Any]:
    """The body, a JSON object."""
    members = _json(response)
    if not isinstance(members, dict):
        raise unexpected(response, "a JSON object was expected")
    return members


def text(response: httpx.Response) -> str:
    """The body as text."""
    return response.text


def nothing(response: httpx.Response) -> None:
    """The answer of a request whose status says everything."""


def model(kind: type[M]) -> Callable[[httpx.Response], M]:
    """A parser of documents of one `kind`."""

    def parse(response: httpx.Response) -> M:
        members = document(response)
        try:
            return kind.model_validate(members)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            raise unexpected(response, f"not a {kind.__name__}: {place} {first['msg']}") from error

    return parse


def page(name: str, item: type[M]) -> Callable[[httpx.Response], Page[M]]:
    """A parser of one page of a list, whose rows are under `name`."""

    def parse(response: httpx.Response) -> Page[M]:
        members = document(response)
        try:
            return Page(items=tuple(item.model_validate(one) for one in members[name]), next=members.get("next"))
        except (KeyError, TypeError, ValidationError) as error:
            raise unexpected(response, f"not a page of {name}") from error

    return parse


def retry_after(response: httpx.Response) -> float | None:
    """Seconds that the answer asks to wait, None if it does not."""
    try:
        seconds = float(response.headers.get("retry-after", ""))
    except ValueError:  # missing, or a date, which this service does not send
        return None
    return seconds if math.isfinite(seconds) and seconds >= 0 else None


def unexpected(response: httpx.Response, what: str) -> UnexpectedAnswer:
    """The error for a response that is not one of the service. `what` says why."""
    return UnexpectedAnswer(f"unexpected answer from {response.url}: {what}", response.status_code, response.text[:500])
