"""A connection to one service: requests sent, and sent again where that is harmless."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Self, TypeVar

import httpx
from pydantic import BaseModel

from urquhart_client._exchange import Request, answer, bearer, failed, retry_after
from urquhart_client._retry import Retry
from urquhart_client.models import Page

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)


class Connection:
    """What all calls go through; usable as a context manager, and by several callers at once."""

    def __init__(
        self,
        base_url: str,
        *,
        api_key: str | None = None,
        timeout: float | httpx.Timeout = 30.0,
        retry: Retry | None = None,
        compress: bool = True,
        headers: Mapping[str, str] | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        """Connect to nothing yet.

        Args:
            base_url: where the service is, e.g. `http://127.0.0.1:8420`; a path in front of `/v1` may be part of it.
            api_key: as the operator made it, where the service asks for one.
            timeout: seconds for connecting and for each read and write, or an `httpx.Timeout`.
            retry: how often to try; `Retry(attempts=1)` never sends anything again.
            compress: send large bodies packed.
            headers: sent with every request.
            transport: an httpx transport instead of the network, e.g. `httpx.MockTransport` in tests.

        Raises:
            ValueError: what is given as `api_key` cannot be one.
        """
        sent = dict(headers or {}) | ({} if api_key is None else {"Authorization": bearer(api_key)})
        self._http = httpx.Client(base_url=base_url, timeout=timeout, headers=sent, transport=transport)
        self._retry = retry or Retry()
        self._compress = compress

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections; the client cannot be used afterwards."""
        self._http.close()

    def _send(self, request: Request[T]) -> T:
        if self._compress:
            request = request.packed()
        began, attempt, lost = time.monotonic(), 0, False
        while True:
            attempt += 1
            try:
                response = self._http.request(
                    request.method,
                    request.path,
                    params=dict(request.params),
                    headers=dict(request.headers),
                    content=request.content,
                )
            except (httpx.TransportError, httpx.DecodingError) as error:
                pause = self._retry.pause(attempt, time.monotonic() - began) if request.repeatable else None
                if pause is None:
                    raise failed(request, error, self._http.base_url) from error
                lost = True
            else:
                pause = None
                if not response.is_success and request.repeatable:
                    asked = retry_after(response)
                    pause = self._retry.pause(
                        attempt, time.monotonic() - began, status=response.status_code, asked=asked
                    )
                if pause is None:
                    return answer(request, response, lost=lost)
            time.sleep(pause)

    def _lines(self, request: Request[T]) -> Iterator[str]:
        """The lines of an answer, as they come in."""
        with self._streamed(request) as response:
            for line in response.iter_lines():
                yield line

    def _pieces(self, request: Request[T]) -> Iterator[bytes]:
        """The bytes of an answer, as they come in."""
        with self._streamed(request) as response:
            for piece in response.iter_bytes():
                yield piece

    @contextmanager
    def _streamed(self, request: Request[T]) -> Iterator[httpx.Response]:
        try:
            with self._http.stream(
                request.method, request.path, params=dict(request.params), headers=dict(request.headers)
            ) as response:
                if not response.is_success:
                    response.read()
                    answer(request, response)
                yield response
        except (httpx.TransportError, httpx.DecodingError) as error:
            raise failed(request, error, self._http.base_url) from error

    def _pages(self, request: Callable[[str | None], Request[Page[M]]]) -> Iterator[M]:
        cursor: str | None = None
        while True:
            page = self._send(request(cursor))
            for item in page.items:
                yield item
            if page.next is None:
                return
            cursor = page.next
