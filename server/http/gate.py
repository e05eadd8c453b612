"""Places for the requests that are worked on at once, and a queue before them."""

import asyncio
from collections import deque
from typing import Final

from server.errors import Overloaded
from server.settings import Limits

_RETRY: Final = 1.0
"""Seconds after which one who was not let in may try again."""


class Gate:
    """Places for requests that are worked on, and a queue before them, first come first served.

    Of one event loop; not thread-safe.
    """

    def __init__(self, limits: Limits) -> None:
        self._free = limits.concurrent_requests
        self._most_waiting = limits.queued_requests
        self._patience = limits.queue_seconds
        self._places = limits.concurrent_requests
        self._waiting: deque[asyncio.Future[None]] = deque()

    @property
    def running(self) -> int:
        """Requests that have a place."""
        return self._places - self._free

    @property
    def waiting(self) -> int:
        """Requests in the queue."""
        return len(self._waiting)

    async def enter(self, place: asyncio.Future[None]) -> None:
        """Take a place, and wait for one in the queue. Raises Overloaded: it is full, or the wait too long.

        `place` is done when it is given; who sets an exception there ends the wait with it.
        """
        if self._free:
            self._free -= 1
            place.set_result(None)
            return
        if len(self._waiting) >= self._most_waiting:
            raise Overloaded(
                f"{self._places} requests are worked on and {self._most_waiting} wait; try again shortly.", _RETRY
            )
        self._waiting.append(place)
        try:
            async with asyncio.timeout(self._patience):
                await place
        except BaseException as error:
            if place in self._waiting:
                self._waiting.remove(place)
            elif place.done() and not place.cancelled() and place.exception() is None:
                self.leave()  # it was handed over just when the wait was given up
            if isinstance(error, TimeoutError):
                raise Overloaded(f"No place was free within {self._patience:g} s; try again shortly.", _RETRY) from None
            raise

    def leave(self) -> None:
        """Give the place to the one who waits longest, if anybody does."""
        while self._waiting:
            place = self._waiting.popleft()
            if not place.done():
                place.set_result(None)
                return
        self._free += 1
