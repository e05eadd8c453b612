"""One request on its way through the service: how it arrives, its turn, and for how long it is worked on."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final

from fastapi import Depends, Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive, Scope, Send

from server.config.settings import Limits
from server.errors import DomainError, Overloaded, TooSlow
from server.http.admission.gate import Gate
from server.http.admission.readiness import ReadinessChecks
from server.http.body_limit import is_streamed
from server.observability.metrics import Metrics
from server.security.principal import Principal
from urquhart import Budget

ALWAYS_ANSWERED: Final = frozenset({"/livez", "/readyz", "/metrics"})
"""Paths that take no place: who watches the service must see it all the more when it is overloaded."""
_RETRY: Final = 1.0
ABORT: Final = "abort"
"""Name in a request's state of what resets its connection."""
_PIECE: Final = 1 << 16
"""Bytes of an answer that are handed over at once: the next ones when these are on their way."""
_EMPTY: Final[Message] = {"type": "http.request", "body": b"", "more_body": False}


@dataclass(slots=True)
class AdmissionState:
    """What the requests of a process share. `held`: bytes of bodies in memory; `requests`: those in progress."""

    limits: Limits
    gate: Gate
    metrics: Metrics
    readiness: ReadinessChecks
    held: int = 0
    requests: set["Admission"] = field(default_factory=set)
    unsent: "UnreadAnswers" = field(init=False)

    def __post_init__(self) -> None:
        self.unsent = UnreadAnswers(self.limits.unsent_bytes, lambda: self.count("unsent"))

    def hold(self, size: int) -> None:
        """Count bytes of a body that are kept in memory. Raises Overloaded."""
        if self.held + size > self.limits.buffered_bytes:
            self.count("memory")
            raise Overloaded("The memory for incoming bodies is full. Try again in a moment.", _RETRY)
        self.held += size

    def count(self, reason: str) -> None:
        """Count a request that is refused."""
        self.metrics.rejected.labels(reason).inc()


class UnreadAnswers:
    """Answers that are held until their callers have read them; those that read nothing for longest are cut off."""

    def __init__(self, most: int, count: Callable[[], None]) -> None:
        self._most, self._count = most, count
        self._sizes: dict[Admission, int] = {}

    @property
    def held(self) -> int:
        """Bytes of the answers that are held."""
        return sum(self._sizes.values())

    def hold(self, request: "Admission", size: int) -> None:
        """Keep an answer of so many bytes, and make room for it where that is needed."""
        held = self.held + size
        for other in sorted(self._sizes, key=lambda one: one.stalled):
            if held <= self._most:
                break
            held -= self._sizes.pop(other)
            self._count()
            other.abort()
        self._sizes[request] = size

    def release(self, request: "Admission") -> None:
        """It is sent, or dropped."""
        self._sizes.pop(request, None)


class Admission:
    """One request on its way in and its answer on the way out.

    When the request is there as a whole, its budget begins, it waits for a place, and from then on somebody watches
    whether the caller is still there: if not, the wait ends, and the budget is abandoned.
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
        """Who asks, when that is known."""
        caller: Principal | None = self._scope["state"].get("caller")
        return caller

    @property
    def authorization(self) -> str | None:
        """What the caller was let in for."""
        return Headers(scope=self._scope).get("authorization")

    @property
    def name(self) -> str:
        """Whose share of the service it takes: that of a key, or of an address where there is none."""
        caller = self.caller
        return f"key {caller.id}" if caller is not None and caller.id else f"address {self._address}"

    def step_aside(self) -> None:
        """Give the place back and go on without one."""
        self._leave()

    def check(self) -> None:
        """Raise what ends the request, if anything does: Abandoned where nobody waits, or the refusal."""
        if self.refusal is not None:
            raise self.refusal
        self.budget.is_spent()

    def refuse(self, error: DomainError) -> None:
        """End the work: the caller may not have the answer any more, and is told `error` where that is possible."""
        self.refusal = error
        self._give_up(error)

    async def over(self) -> None:
        """Wait until nobody waits for the answer any more."""
        await self._over.wait()

    def end(self) -> None:
        """Give back what is taken."""
        self._leave()
        self._shared.requests.discard(self)
        self._shared.held -= self._held
        self._held = 0
        if self._watch is not None:
            self._watch.cancel()

    async def receive(self) -> Message:
        """The next piece of the body, in time. With the last one a place is taken, or waited for; after it comes only
        that the caller is gone, when it is.
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
        """The answer; the place is free as soon as it begins, however slowly it is taken."""
        if message["type"] == "http.response.start":
            self.answered = True
            self._leave()
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

    async def _send_piece(self, message: Message) -> None:
        """A piece of the answer, in time; the time counts in which the caller takes nothing."""
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
        """Cut the caller off: its connection is reset, and what was not sent of the answer is dropped."""
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
        self.budget = Budget()
        self._watch = asyncio.create_task(self._watch_caller())
        if not self._takes_place:
            return
        self._name = self.name
        self._place = asyncio.get_running_loop().create_future()
        try:
            await self._shared.gate.enter(self._name, self._place)
        except Overloaded:
            self._shared.count("overloaded")
            raise
        self._entered = time.monotonic()

    def _leave(self) -> None:
        if self._entered is not None:
            self._shared.gate.leave(self._name, time.monotonic() - self._entered)
            self._entered = None
        self._takes_place = False

    async def _watch_caller(self) -> None:
        """What comes after the body: nothing, until the caller is gone or has the whole answer."""
        while (await self._inner_receive())["type"] != "http.disconnect":
            continue
        self._give_up(ClientDisconnect())

    def _give_up(self, error: Exception) -> None:
        self._over.set()
        self.budget.abandon()
        if self._place is not None and not self._place.done():
            self._place.set_exception(error)


async def get_admission(request: Request) -> Admission:
    """The request on its way through the service."""
    admission: Admission = request.state.admission
    return admission


async def get_budget(request: Request) -> Budget:
    """Until when, and for whom, the request is worked on; it began when the request was there as a whole."""
    return (await get_admission(request)).budget


AdmissionDep = Annotated[Admission, Depends(get_admission)]
BudgetDep = Annotated[Budget, Depends(get_budget)]
