"""Short requests go first: long work pauses while a shorter request is in progress."""

import math
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Final

_SHORT: Final = 0.05
"""Seconds of work after which a request is no longer short. A query takes a tenth of that."""
_SHORTER: Final = 0.5
"""Work pauses for requests whose duration is at most this part of its own."""
_LONGEST: Final = 0.02
"""Most seconds of one pause."""
_LOOK: Final = 0.0005
"""Seconds between two looks whether the short requests are done."""

_give_way: ContextVar[Callable[[], None]] = ContextVar("give_way", default=lambda: None)
"""The pauses of the request or job that this thread works for. The threads of a request inherit it."""


def give_way() -> None:
    """Pause if a request in progress is shorter than the work of this thread.

    For work that has no budget, such as reading a large body or the lines of an import.
    """
    _give_way.get()()


def give_way_by(pause: Callable[[], None]) -> None:
    """Set what `give_way` does from now on in this context."""
    _give_way.set(pause)


class Precedence:
    """The requests in progress in this process: when each began, and how long its caller's requests take on average.

    On a few cores, long work would otherwise delay every small request several times: they share the cores, their
    caches and the interpreter. So the shortest request goes first, by the longer of the time that it has taken and the
    time that its caller's requests take: a caller with long requests gives way from the first moment of each. Without
    pauses, p99 of other callers beside a crowd of slow queries is 45 ms instead of 33 ms, and beside constraints jobs
    43 ms instead of 36 ms (`python -m benchmarks.reliability --only exhaustion`).
    """

    def __init__(self) -> None:
        self._requests: dict[int, tuple[float, float]] = {}

    def enter(self, request: object, expected: float = 0.0) -> None:
        """A request begins to work, and will take about `expected` seconds. Called on the event loop, like `leave`."""
        self._requests[id(request)] = time.monotonic(), expected

    def leave(self, request: object) -> None:
        """A request is done, or gives its place back. Does nothing if it never entered."""
        self._requests.pop(id(request), None)

    def pauses(self, request: object | None = None) -> Callable[[], None]:
        """A function that long work calls regularly, on its own thread. It returns after the pause, if there is one.

        No pause is longer than the work since the last one, so all work keeps at least half of its speed.

        Args:
            request: for whom the work is done; None for a job, which gives way to every short request.
        """
        since = time.monotonic()

        def pause() -> None:
            nonlocal since
            now = time.monotonic()
            mine = math.inf if request is None else _duration(self._requests.get(id(request), (now, 0.0)), now)
            until = now + min(now - since, _LONGEST)
            while self._is_shorter_one_in_progress(mine, now) and (now := time.monotonic()) < until:
                time.sleep(_LOOK)
            since = now

        return pause

    def _is_shorter_one_in_progress(self, seconds: float, now: float) -> bool:
        bound = min(_SHORT, _SHORTER * seconds)
        return any(_duration(other, now) < bound for other in list(self._requests.values()))


def _duration(request: tuple[float, float], now: float) -> float:
    """Seconds that a request takes, as far as is known."""
    began, expected = request
    return max(now - began, expected)
