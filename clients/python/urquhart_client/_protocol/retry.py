"""When a request that failed is sent again: what is harmless to repeat, a few times, later and later."""

import random
from dataclasses import dataclass

_PASSING = frozenset({408, 429, 502, 503, 504})
"""What a service or a proxy answers when the same may succeed in a while."""
_CONFLICT = 409


@dataclass(frozen=True, slots=True)
class Retry:
    """How often and how long to try. The defaults outlast a service that is started again: eight seconds or so.

    Attributes:
        attempts: requests sent for one call at most; 1 never repeats.
        first: seconds before the second one, at most: it is drawn from 0 to that, and doubles each time.
        most: seconds that this grows to.
        deadline: seconds for all attempts and pauses of a call; none is begun later.
    """

    attempts: int = 7
    first: float = 0.25
    most: float = 10.0
    deadline: float = 60.0

    def pause(
        self, attempt: int, elapsed: float, *, status: int | None = None, asked: float | None = None
    ) -> float | None:
        """Seconds to wait before the next attempt, or None for giving up.

        Args:
            attempt: how many were made.
            elapsed: seconds since the first began.
            status: what the last was answered with; None where the connection failed.
            asked: seconds that the answer asked to wait (Retry-After).
        """
        # 409 comes with Retry-After where the first attempt is still at work, and is final otherwise.
        passing = status is None or status in _PASSING or (status == _CONFLICT and asked is not None)
        if attempt >= self.attempts or not passing:
            return None
        # All robots of a fleet lose a service at once; they must not come back at once.
        drawn = random.uniform(0.0, min(self.first * 2.0 ** (attempt - 1), self.most))
        seconds = drawn if asked is None else asked + drawn
        return seconds if elapsed + seconds < self.deadline else None


NEVER = Retry(attempts=1)
