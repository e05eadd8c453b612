"""A connection to one service: requests sent, and sent again where that is harmless."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx
from pydantic import BaseModel

from urquhart_client._protocol.exchange import (
    Request,
    answer,
    bearer,
    blocking_body,
    failed,
    foreign,
    labelled,
    retry_after,
)
from urquhart_client._protocol.pools import Pools, this_process
from urquhart_client._protocol.retry import Retry
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
        self._options: dict[str, Any] = {"base_url": base_url, "timeout": timeout, "headers": sent}
        self._transport = transport
        self._retry = retry or Retry()
        self._compress = compress
        self._base_url = httpx.URL(base_url)
        self._open_pools()

    def _open_pools(self) -> None:
        options, transport = self._options, self._transport
        self._pools = Pools(
            lambda: httpx.Client(**options, transport=transport), this_process, shared=transport is not None
        )

    @property
    def base_url(self) -> str:
        """Where the service is, without any password that the URL may hold."""
        return str(self._base_url.copy_with(userinfo=b""))

    def __getstate__(self) -> dict[str, Any]:
        """Pickled, a client is what it was made of, the API key included; its copy opens connections of its own."""
        return {name: value for name, value in self.__dict__.items() if name != "_pools"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._open_pools()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections; the client cannot be used afterwards."""
        http = self._pools.close()
        if http is not None:
            http.close()

    def _send(self, request: Request[T]) -> T:
        if self._compress:
            request = request.packed()
        began, attempt, lost = time.monotonic(), 0, False
        while True:
            attempt += 1
            try:
                response = self._exchange(request)
            except (httpx.TransportError, httpx.DecodingError) as error:
                again = request.may_follow(error)
                pause = self._retry.pause(attempt, time.monotonic() - began) if again else None
                if pause is None:
                    raise failed(request, error, self._base_url) from error
                lost = True
            else:
                pause = None
                if not response.is_success and request.may_follow(response):
                    asked = retry_after(response)
                    pause = self._retry.pause(
                        attempt, time.monotonic() - began, status=response.status_code, asked=asked
                    )
                if pause is None:
                    return answer(request, response, lost=lost)
            time.sleep(pause)

    def _exchange(self, request: Request[Any]) -> httpx.Response:
        """Send once. Raises UnexpectedAnswer for the answer to another request, and closes its connection."""
        http, headers = self._pools.here(), labelled(request)
        content = blocking_body(request.content)
        response = http.request(
            request.method, request.path, params=dict(request.params), headers=headers, content=content
        )
        wrong = foreign(response, headers)
        if wrong is not None:
            self._hang_up(response)
            raise wrong
        return response

    def _hang_up(self, response: httpx.Response) -> None:
        stream = response.extensions.get("network_stream")
        if stream is not None:  # there is none where a test answers in the network's place
            stream.close()

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
        http, headers = self._pools.here(), labelled(request)
        try:
            with http.stream(request.method, request.path, params=dict(request.params), headers=headers) as response:
                wrong = foreign(response, headers)
                if wrong is not None:
                    self._hang_up(response)
                    raise wrong
                if not response.is_success:
                    response.read()
                    answer(request, response)
                yield response
        except (httpx.TransportError, httpx.DecodingError) as error:
            raise failed(request, error, self._base_url) from error

    def _pages(self, request: Callable[[str | None], Request[Page[M]]]) -> Iterator[M]:
        cursor: str | None = None
        while True:
            page = self._send(request(cursor))
            for item in page.items:
                yield item
            if page.next is None:
                return
            cursor = page.next
