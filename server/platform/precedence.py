"""Short requests go first: long work pauses while a short request is in progress."""

import asyncio
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Final

_SHORT: Final = 0.05
"""Seconds of work after which a request is no longer short. A query takes a tenth of that."""
_LONGEST: Final = 0.02
"""Most seconds of one pause."""
_LOOK: Final = 0.0005
"""Seconds between two looks whether the short requests are done."""

_give_way: ContextVar[Callable[[], None]] = ContextVar("give_way", default=lambda: None)
"""The pauses of the request or job that this thread works for. The threads of a request inherit it."""


def give_way() -> None:
    """Pause if the work of this thread is long and a short request is in progress.

    For work that has no budget, such as reading a large body or the lines of an import.
    """
    _give_way.get()()


def give_way_by(pause: Callable[[], None]) -> None:
    """Set what `give_way` does from now on in this context."""
    _give_way.set(pause)


class Precedence:
    """The requests in progress in this process, by the time when each began to work.

    On a few cores, long work would otherwise delay every small request several times: they share the cores, their
    caches and the interpreter. Without pauses, p99 of other callers beside a crowd of slow queries is 45 ms instead of
    33 ms, and beside constraints jobs 43 ms instead of 36 ms (`python -m benchmarks.reliability --only exhaustion`).
    """

    def __init__(self) -> None:
        self._began: dict[int, float] = {}

    def enter(self, request: object) -> None:
        """A request begins to work. Called on the event loop, like `leave`."""
        self._began[id(request)] = time.monotonic()

    def leave(self, request: object) -> None:
        """A request is done, or gives its place back. Does nothing if it never entered."""
        self._began.pop(id(request), None)

    def pauses(self, request: object | None = None) -> Callable[[], None]:
        """A function that long work calls regularly, on its own thread. It returns after the pause, if there is one.

        No pause is longer than the work since the last one, so long work keeps at least half of its speed.

        Args:
            request: for whom the work is done. Its work is long once the request is no longer short; without a request,
                as in a job, it always is.
        """
        since = time.monotonic()

        def pause() -> None:
            nonlocal since
            now = time.monotonic()
            if request is not None and now - self._began.get(id(request), now) < _SHORT:
                return
            if _on_event_loop():
                return  # a pause here would stop the very request that it is for
            until = now + min(now - since, _LONGEST)
            while self._is_short_one_in_progress(now) and (now := time.monotonic()) < until:
                time.sleep(_LOOK)
            since = now

        return pause

    def _is_short_one_in_progress(self, now: float) -> bool:
        return any(now - began < _SHORT for began in list(self._began.values()))


def _on_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
