"""Retries: failed requests that are safe to repeat are sent again a few times, with growing pauses."""

import random
from dataclasses import dataclass

_PASSING = frozenset({408, 429, 502, 503, 504})
"""Statuses after which the same request may succeed later."""
_CONFLICT = 409


@dataclass(frozen=True, slots=True)
class Retry:
    """How often and how long to try. The defaults outlast a restart of the service: about eight seconds.

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
        """Seconds to wait before the next attempt, or None to give up.

        Args:
            attempt: how many were made.
            elapsed: seconds since the first began.
            status: what the last was answered with; None where the connection failed.
            asked: seconds that the answer asked to wait (Retry-After).
        """
        # 409 has Retry-After if the first attempt is still in progress. Otherwise it is final.
        passing = status is None or status in _PASSING or (status == _CONFLICT and asked is not None)
        if attempt >= self.attempts or not passing:
            return None
        # All robots of a fleet lose a service at the same moment, but must not come back at the same moment.
        drawn = random.uniform(0.0, min(self.first * 2.0 ** (attempt - 1), self.most))
        seconds = drawn if asked is None else asked + drawn
        return seconds if elapsed + seconds < self.deadline else None


NEVER = Retry(attempts=1)
