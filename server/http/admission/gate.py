"""Places for the requests that are worked on at once, and a queue before them that is fair to every caller."""

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
"""Seconds after which one who was not let in may try again."""
_RECENT: Final = 10.0
"""Seconds for which a caller counts as one that others must leave room for, after its last request."""
_REMEMBERED: Final = 60.0
"""Seconds after its last request for which it is remembered how much a caller has used."""
_RESERVE: Final = 4
"""A caller that is alone leaves one place in so many free, so that the next caller finds one."""
_WEIGHT: Final = 0.2
"""Weight of the latest request in the estimate of what a caller's requests take."""


@dataclass(slots=True, eq=False)
class _Caller:
    """What is known of one caller: seconds that its requests took (`used`) and take on average (`mean`)."""

    running: int = 0
    waiting: deque[asyncio.Future[None]] = field(default_factory=deque)
    used: float = 0.0
    mean: float = 0.0
    seen: float = 0.0

    @property
    def active(self) -> bool:
        return self.running > 0 or bool(self.waiting)


class Gate:
    """Places for requests that are worked on, and a queue before them.

    Of those that wait, the caller that has used the fewest seconds of places is next. While several ask, each of them
    holds at most `limits.key_requests` places, by default one fewer than there are cores, so that a core stays free.
    Where the queue is full, the latest request of the caller with the most waiting requests is refused.

    Belongs to one event loop; not thread-safe.
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
        """Requests that can have a place."""
        return self._places

    @property
    def running(self) -> int:
        """Requests that have a place."""
        return self._places - self._free

    @property
    def waiting(self) -> int:
        """Requests in the queue."""
        return sum(len(caller.waiting) for caller in self._callers.values())

    @property
    def is_saturated(self) -> bool:
        """Whether a caller that comes now would have to wait."""
        return not self._free

    async def enter(self, name: str, place: asyncio.Future[None]) -> None:
        """Take a place for the caller `name`, or wait for one in the queue.

        `place` is done when it is given; who sets an exception there ends the wait with it.

        Raises:
            Overloaded: the queue is full, or the wait was too long.
        """
        caller = self._arrive(name)
        caller.waiting.append(place)
        self._fill()
        if not place.done() and self.waiting > self._most_waiting:
            self._refuse_one()
        try:
            async with asyncio.timeout(self._patience):
                await place
        except BaseException as error:
            if place in caller.waiting:
                caller.waiting.remove(place)
            elif place.done() and not place.cancelled() and place.exception() is None:
                self.leave(name, 0.0)  # it was handed over just when the wait was given up
            if isinstance(error, TimeoutError):
                raise Overloaded(
                    f"The service is busy: no place became free within {self._patience:g} s. Try again in a moment.",
                    _RETRY,
                ) from None
            raise

    def leave(self, name: str, seconds: float) -> None:
        """Give back a place that the caller `name` had for so long."""
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
            caller.used = max(caller.used, self._least)  # time in which it asked for nothing is not saved up
        caller.seen = now
        return caller

    def _fill(self) -> None:
        """Give free places to those that wait."""
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
        """Places that a caller may hold now."""
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
