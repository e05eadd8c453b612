"""One request on its way through the service: its arrival, its place in the queue, and its deadline."""

import asyncio
import time
from dataclasses import dataclass, field
from typing import Annotated, Final

from fastapi import Depends, Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive, Scope, Send

from server.config.settings import Limits
from server.errors import DomainError, Overloaded, TooManyRequests, TooSlow
from server.http.admission.fair_queue import FairQueue
from server.http.admission.readiness import ReadinessChecks
from server.http.admission.unread_answers import UnreadAnswers
from server.http.body_limit import is_streamed
from server.http.session_cookie import credentials_of
from server.observability.metrics import Metrics
from server.platform.precedence import Precedence, give_way_by
from server.security.principal import Principal
from server.security.rate_limit import RateLimiter
from urquhart import Budget

ALWAYS_ANSWERED: Final = frozenset({"/livez", "/readyz", "/metrics"})
"""Paths that need no place, because monitoring must work above all when the service is overloaded."""
_RETRY: Final = 1.0
ABORT: Final = "abort"
"""Name of the entry in a request's state that resets its connection."""
_PIECE: Final = 1 << 16
"""Bytes of an answer that are sent at once. The next piece is sent when the last one is on its way."""
_REFUSALS: Final = 20.0
"""Refusals (401 and 429) per second of one caller that are answered at once."""
REFUSAL_SECONDS: Final = 1.0
"""Seconds after its arrival before which no other refusal is answered. 40 callers that continue after their key was
revoked make the p99 of others 2.5 times as long without this (`python -m benchmarks.reliability --only exhaustion`)."""
_EMPTY: Final[Message] = {"type": "http.request", "body": b"", "more_body": False}


@dataclass(slots=True)
class AdmissionState:
    """The state that all requests of a process share. `held`: bytes of bodies in memory; `requests`: those in
    progress; `refusals`: counts those of each caller.
    """

    limits: Limits
    fair_queue: FairQueue
    metrics: Metrics
    readiness: ReadinessChecks
    precedence: Precedence
    held: int = 0
    requests: set["Admission"] = field(default_factory=set)
    refusals: RateLimiter = field(default_factory=lambda: RateLimiter(_REFUSALS))
    unsent: UnreadAnswers = field(init=False)

    def __post_init__(self) -> None:
        self.unsent = UnreadAnswers(self.limits.unsent_bytes, lambda: self.count("unsent"))

    def hold(self, size: int) -> None:
        """Count bytes of a body that is kept in memory. Raises Overloaded."""
        if self.held + size > self.limits.buffered_bytes:
            self.count("memory")
            raise Overloaded("The memory for incoming bodies is full. Try again in a moment.", _RETRY)
        self.held += size

    def count(self, reason: str) -> None:
        """Count a request that is refused."""
        self.metrics.rejected.labels(reason).inc()


class Admission:
    """One request on its way in, and its answer on its way out.

    When the whole request has arrived, its budget begins and it waits for a place. From then on, the connection is
    watched: if the caller goes away, the wait ends and the budget is abandoned.
    """

    def __init__(self, shared: AdmissionState, scope: Scope, receive: Receive, send: Send) -> None:
        self._shared, self._limits = shared, shared.limits
        self._inner_receive, self._inner_send = receive, send
        self._began = time.monotonic()
        self._received = self._held = self._sent = 0
        self._waited = 0.0
        self.stalled = self._began
        headers = Headers(scope=scope)
        self._has_body = headers.get("content-length", "0") != "0" or "transfer-encoding" in headers
        self._streamed = is_streamed(scope)
        self._takes_place = scope["path"] not in ALWAYS_ANSWERED
        self._scope, self._address = scope, (scope.get("client") or ("",))[0]
        self._is_whole = self.answered = False
        self._place: asyncio.Future[None] | None = None
        self._name = ""
        self._entered: float | None = None
        self._watch: asyncio.Task[None] | None = None
        self._over = asyncio.Event()
        self.refusal: DomainError | None = None
        self.budget = Budget()
        shared.requests.add(self)

    @property
    def caller(self) -> Principal | None:
        """The caller, once it is known."""
        caller: Principal | None = self._scope["state"].get("caller")
        return caller

    @property
    def authorization(self) -> str | None:
        """The credentials of the request, None if it has none. Raises Unauthorized."""
        return credentials_of(Headers(scope=self._scope), self._scope["method"])

    @property
    def name(self) -> str:
        """Name under which the use of the service is counted: that of the key, or of the address if there is no key."""
        caller = self.caller
        return f"key {caller.id}" if caller is not None and caller.id else f"address {self._address}"

    def step_aside(self) -> None:
        """Give the place back and continue without one."""
        self._leave()

    def check(self) -> None:
        """Raise if the request must end: Abandoned if the caller is gone, or the refusal."""
        if self.refusal is not None:
            raise self.refusal
        self.budget.is_spent()

    def refuse(self, error: DomainError) -> None:
        """End the work. The caller may not have the answer any more, and gets `error` if that is still possible."""
        self.refusal = error
        self._give_up(error)

    async def over(self) -> None:
        """Wait until nobody waits for the answer any more."""
        await self._over.wait()

    def end(self) -> None:
        """Release everything that the request holds."""
        self._leave()
        self._shared.requests.discard(self)
        self._shared.held -= self._held
        self._held = 0
        if self._watch is not None:
            self._watch.cancel()

    async def receive(self) -> Message:
        """The next piece of the body, within the time limit. With the last piece the request waits for a place. Later
        calls return only when the caller has gone.
        """
        if self._is_whole:
            await self._over.wait()
            return {"type": "http.disconnect"}
        if self.answered:
            return await self._inner_receive()
        message = await self._next() if self._has_body else _EMPTY
        if self.refusal is not None:
            raise self.refusal
        if message["type"] != "http.request":
            return message
        size = len(message.get("body", b""))
        self._received += size
        if not self._streamed:
            self._shared.hold(size)
            self._held += size
        if not message.get("more_body", False):
            self._is_whole = True
            await self._arrived()
        return message

    async def send(self, message: Message) -> None:
        """Send a part of the answer. The place is free as soon as the answer begins, however slowly the caller
        reads.
        """
        if message["type"] == "http.response.start":
            self.answered = True
            self._leave()
            if message["status"] in (401, 429):
                await self._slow_down()
            if self._shared.readiness.stopping:
                MutableHeaders(scope=message)["Connection"] = "close"
        body = message.get("body", b"")
        if len(body) <= _PIECE:
            await self._send_piece(message)
            return
        self._shared.unsent.hold(self, len(body))
        try:
            for start in range(0, len(body), _PIECE):
                more = start + _PIECE < len(body) or message.get("more_body", False)
                await self._send_piece({**message, "body": body[start : start + _PIECE], "more_body": more})
        finally:
            self._shared.unsent.release(self)

    async def _slow_down(self) -> None:
        """Delay a refusal if the caller has had many, because callers that do not stop would slow down all others."""
        try:
            self._shared.refusals.take(self.name)
        except TooManyRequests:
            await asyncio.sleep(self._began + REFUSAL_SECONDS - time.monotonic())

    async def _send_piece(self, message: Message) -> None:
        """Send a piece of the answer. The time limit counts only while the caller reads nothing."""
        began = self.stalled = time.monotonic()
        patience = self._limits.body_seconds + self._sent / self._limits.body_rate - self._waited
        try:
            async with asyncio.timeout(patience):
                await self._inner_send(message)
        except TimeoutError:
            self._shared.count("slow_reader")
            self.abort()
            raise ClientDisconnect from None
        self._waited += time.monotonic() - began
        self._sent += len(message.get("body", b""))

    def abort(self) -> None:
        """Cut the caller off: reset its connection and drop the unsent part of the answer."""
        self._give_up(ClientDisconnect())
        abort = self._scope["state"].get(ABORT)
        if abort is not None:
            abort()

    async def _next(self) -> Message:
        deadline = self._began + self._limits.body_seconds + self._received / self._limits.body_rate
        try:
            async with asyncio.timeout(deadline - time.monotonic()):
                return await self._inner_receive()
        except TimeoutError:
            self._shared.count("slow_body")
            raise TooSlow(
                f"Only {self._received} bytes of the body arrived in {time.monotonic() - self._began:.0f} s. The "
                f"limits are body_seconds {self._limits.body_seconds:g} and body_rate {self._limits.body_rate} bytes "
                "per second. Send the request again, faster or in parts."
            ) from None

    async def _arrived(self) -> None:
        pace = self._shared.precedence.pace(self)
        give_way_by(pace)
        self.budget = Budget(give_way=pace)
        self._watch = asyncio.create_task(self._watch_caller())
        if not self._takes_place:
            return
        self._name = self.name
        self._place = asyncio.get_running_loop().create_future()
        try:
            await self._shared.fair_queue.enter(self._name, self._place)
        except Overloaded:
            self._shared.count("overloaded")
            raise
        self._entered = time.monotonic()
        self._shared.precedence.enter(self)

    def _leave(self) -> None:
        if self._entered is not None:
            self._shared.fair_queue.leave(self._name, time.monotonic() - self._entered)
            self._entered = None
            self._shared.precedence.leave(self)
        self._takes_place = False

    async def _watch_caller(self) -> None:
        """Wait for what comes after the body: nothing, until the caller has gone or has the whole answer."""
        while (await self._inner_receive())["type"] != "http.disconnect":
            continue
        self._give_up(ClientDisconnect())

    def _give_up(self, error: Exception) -> None:
        self._over.set()
        self.budget.abandon()
        if self._place is not None and not self._place.done():
            self._place.set_exception(error)


async def get_admission(request: Request) -> Admission:
    """The request's way through the service."""
    admission: Admission = request.state.admission
    return admission


async def get_budget(request: Request) -> Budget:
    """The request's budget, which began when the whole request had arrived."""
    return (await get_admission(request)).budget


AdmissionDep = Annotated[Admission, Depends(get_admission)]
BudgetDep = Annotated[Budget, Depends(get_budget)]
