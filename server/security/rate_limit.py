"""Rate limits: a token bucket for each caller."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from server.errors import TooManyRequests

_MOST: Final = 10_000
"""Number of callers that are remembered. The one that was not seen for longest is forgotten, and starts with a full
bucket.
"""


class RateLimiter:
    """Requests per second of each caller of this process. A bucket holds the tokens of one second, at least one.

    Thread-safe.
    """

    def __init__(self, per_second: float, clock: Callable[[], float] = time.monotonic) -> None:
        """At most `per_second` requests; 0: no limit. `clock` in seconds."""
        self.per_second = per_second
        self._burst = max(per_second, 1.0)
        self._clock = clock
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()
        self._guard = threading.Lock()

    def take(self, caller: str) -> None:
        """Count one request. If it raises TooManyRequests, the request is not counted."""
        if not self.per_second:
            return
        now = self._clock()
        with self._guard:
            tokens, then = self._buckets.pop(caller, (self._burst, now))
            tokens = min(self._burst, tokens + (now - then) * self.per_second)
            enough = tokens >= 1.0
            self._buckets[caller] = (tokens - 1.0 if enough else tokens, now)
            if len(self._buckets) > _MOST:
                self._buckets.popitem(last=False)
        if not enough:
            wait = (1.0 - tokens) / self.per_second
            raise TooManyRequests(
                f"The limit requests_per_second is {self.per_second:g}. Try again in {wait:.2g} s.",
                wait,
            )
