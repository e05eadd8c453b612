"""How much is taken on at once, and how long a request may take to arrive."""

import asyncio
import time
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import Overloaded, TooSlow
from server.http.gate import Gate
from server.http.middleware import is_streamed
from server.http.problems import domain_problem
from server.http.readiness import Readiness
from server.metrics.metrics import Metrics
from server.settings import Limits

ALWAYS_ANSWERED: Final = frozenset({"/livez", "/readyz", "/metrics"})
"""Paths that take no place: who watches the service must see it all the more when it is overloaded."""
_RETRY: Final = 1.0


class Overload:
    """Holds requests to what the service can do.

    A request takes a place once it is there as a whole, and gives it back when its answer begins: slow callers take up
    a connection and what they have sent, but nobody's turn. A body that does not arrive in time is 408, and its
    connection is closed. While the service stops, every answer asks the caller to close the connection.
    """

    def __init__(self, app: ASGIApp, limits: Limits, gate: Gate, metrics: Metrics, readiness: Readiness) -> None:
        self._app, self._limits, self._gate = app, limits, gate
        self._metrics, self._readiness = metrics, readiness
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = _Arrival(self, scope, receive, send)
        try:
            if not request.has_body:
                await request.enter()
            await self._app(scope, request.receive, request.send)
        except (Overloaded, TooSlow) as error:
            if request.answered:
                raise
            await domain_problem(error, scope)(scope, receive, request.send)
        finally:
            request.leave()
            self._held -= request.held

    def hold(self, size: int) -> None:
        """Count bytes of a body that are kept in memory. Raises Overloaded."""
        if self._held + size > self._limits.buffered_bytes:
            self.count("memory")
            raise Overloaded("The bodies that are just being received fill the memory; try again shortly.", _RETRY)
        self._held += size

    def count(self, reason: str) -> None:
        """Count a request that is refused."""
        self._metrics.rejected.labels(reason).inc()

    @property
    def gate(self) -> Gate:
        """The places."""
        return self._gate

    @property
    def limits(self) -> Limits:
        """The limits."""
        return self._limits

    @property
    def stopping(self) -> bool:
        """Whether the service is about to end."""
        return self._readiness.stopping


class _Arrival:
    """One request on its way in and its answer on the way out."""

    def __init__(self, overload: Overload, scope: Scope, receive: Receive, send: Send) -> None:
        self._overload, self._inner_receive, self._inner_send = overload, receive, send
        self._gate, self._limits = overload.gate, overload.limits
        self._began = time.monotonic()
        self._received = self.held = 0
        headers = Headers(scope=scope)
        self.has_body = headers.get("content-length", "0") != "0" or "transfer-encoding" in headers
        self._streamed = is_streamed(scope)
        self._takes_place = scope["path"] not in ALWAYS_ANSWERED and not _waits(scope)
        self._inside = self.answered = False

    async def enter(self) -> None:
        """Take a place, once."""
        if self._takes_place and not self._inside:
            try:
                await self._gate.enter()
            except Overloaded:
                self._overload.count("overloaded")
                raise
            self._inside = True

    def leave(self) -> None:
        """Give it back."""
        if self._inside:
            self._inside = False
            self._gate.leave()
        self._takes_place = False

    async def receive(self) -> Message:
        """The next piece of the body, in time."""
        if not self.has_body or self.answered:
            return await self._inner_receive()
        deadline = self._began + self._limits.body_seconds + self._received / self._limits.body_rate
        try:
            async with asyncio.timeout(deadline - time.monotonic()):
                message = await self._inner_receive()
        except TimeoutError:
            self._overload.count("slow_body")
            raise TooSlow(
                f"Of the body {self._received} bytes came in {time.monotonic() - self._began:.0f} s; the limits are "
                f"body_seconds {self._limits.body_seconds:g} and body_rate {self._limits.body_rate} bytes a second."
            ) from None
        if message["type"] != "http.request":
            return message
        size = len(message.get("body", b""))
        self._received += size
        if not self._streamed:
            self._overload.hold(size)
            self.held += size
        if not message.get("more_body", False):
            self.has_body = False
            await self.enter()
        return message

    async def send(self, message: Message) -> None:
        """The answer; the place is free as soon as it begins, however slowly it is taken."""
        if message["type"] == "http.response.start":
            self.answered = True
            self.leave()
            if self._overload.stopping:
                MutableHeaders(scope=message)["Connection"] = "close"
        await self._inner_send(message)


def _waits(scope: Scope) -> bool:
    """Whether the request only waits for a job."""
    return b"wait=" in scope["query_string"] and scope["path"].startswith("/v1/jobs/")
