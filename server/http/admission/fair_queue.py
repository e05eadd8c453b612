"""Places for requests in progress, and a queue before them that is fair to all callers."""

import asyncio
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from server.config.settings import Limits
from server.errors import Overloaded

_RETRY: Final = 1.0
"""Seconds after which a refused caller may try again."""
_RECENT: Final = 10.0
"""Seconds after its last request for which a caller counts as active, so that others must leave room for it."""
_REMEMBERED: Final = 60.0
"""Seconds after its last request for which the use of a caller is remembered."""
_RESERVE: Final = 4
"""A caller that is alone leaves one of this many places free, so that the next caller finds one."""
_WEIGHT: Final = 0.2
"""Weight of the latest request in the average duration of a caller's requests."""


@dataclass(slots=True, eq=False)
class _Caller:
    """The use of one caller: total (`used`) and average (`mean`) seconds of its requests."""

    running: int = 0
    waiting: deque[asyncio.Future[None]] = field(default_factory=deque)
    used: float = 0.0
    mean: float = 0.0
    seen: float = 0.0

    @property
    def active(self) -> bool:
        return self.running > 0 or bool(self.waiting)


class FairQueue:
    """Places for requests in progress, and a queue before them.

    The next place goes to the waiting caller that has used the fewest seconds. While several callers are active, each
    may hold at most `limits.key_requests` places, by default one less than the number of cores, so that a core stays
    free. If the queue is full, the latest request of the caller with the most waiting requests is refused.

    It belongs to one event loop and is not thread-safe.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self._places = self._free = limits.concurrent_requests
        self._most_waiting = limits.queued_requests
        self._patience = limits.queue_seconds
        self._share = min(limits.key_requests or max(len(os.sched_getaffinity(0)) - 1, 1), self._places)
        self._alone = self._places - self._places // _RESERVE
        self._clock = clock
        self._callers: dict[str, _Caller] = {}
        self._least = 0.0

    @property
    def places(self) -> int:
        """Number of places."""
        return self._places

    @property
    def running(self) -> int:
        """Number of requests that have a place."""
        return self._places - self._free

    @property
    def waiting(self) -> int:
        """Number of requests in the queue."""
        return sum(len(caller.waiting) for caller in self._callers.values())

    @property
    def is_saturated(self) -> bool:
        """Whether another caller would have to wait now."""
        return not self._free

    async def enter(self, name: str, place: asyncio.Future[None]) -> None:
        """Take a place for the caller `name`, or wait for one in the queue.

        `place` is done when the place is given. Setting an exception on it ends the wait with that exception.

        Raises:
            Overloaded: the queue is full, or the wait was too long.
        """
        caller = self._arrive(name)
        caller.waiting.append(place)
        self._fill()
        if place.done() and place.exception() is None:
            return
        if not place.done() and self.waiting > self._most_waiting:
            self._refuse_one()
        try:
            async with asyncio.timeout(self._patience):
                await place
        except BaseException as error:
            if place in caller.waiting:
                caller.waiting.remove(place)
            elif place.done() and not place.cancelled() and place.exception() is None:
                self.leave(name, 0.0)  # the place was given just when the wait ended
            if isinstance(error, TimeoutError):
                raise Overloaded(
                    f"The service is busy: no place became free within {self._patience:g} s. Try again in a moment.",
                    _RETRY,
                ) from None
            raise

    def leave(self, name: str, seconds: float) -> None:
        """Return a place that the caller `name` had for `seconds`."""
        caller = self._callers[name]
        caller.running -= 1
        caller.used += seconds
        caller.mean += _WEIGHT * (seconds - caller.mean)
        caller.seen = self._clock()
        self._free += 1
        self._fill()

    def _arrive(self, name: str) -> _Caller:
        now = self._clock()
        for known in [one for one, caller in self._callers.items() if now - caller.seen > _REMEMBERED]:
            if not self._callers[known].active:
                del self._callers[known]
        caller = self._callers.setdefault(name, _Caller())
        if not caller.active:
            caller.used = max(caller.used, self._least)  # idle time is not credited
        caller.seen = now
        return caller

    def _fill(self) -> None:
        """Give free places to waiting requests."""
        while self._free:
            able = [one for one in self._callers.values() if one.waiting and one.running < self._most_for(one)]
            if not able:
                return
            caller = min(able, key=lambda one: one.used + one.running * one.mean)
            self._least = max(self._least, caller.used)
            place = caller.waiting.popleft()
            if not place.done():
                caller.running += 1
                self._free -= 1
                place.set_result(None)

    def _most_for(self, caller: _Caller) -> int:
        """Most places that a caller may hold now."""
        since = self._clock() - _RECENT
        others = any(one is not caller and (one.active or one.seen >= since) for one in self._callers.values())
        return self._share if others else self._alone

    def _refuse_one(self) -> None:
        longest = max(self._callers.values(), key=lambda one: len(one.waiting))
        place = longest.waiting.pop()
        if not place.done():
            place.set_exception(
                Overloaded(
                    f"The service is busy: {self.running} requests are in progress and {self._most_waiting} wait, most "
                    "of them yours. Try again in a moment.",
                    _RETRY,
                )
            )
