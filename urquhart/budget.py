"""How long a piece of work may go on: until a deadline, and only while somebody waits for its result."""

import math
import threading
import time


class Abandoned(Exception):
    """Nobody waits for the result any more: the caller has gone, or its key was revoked."""


class Budget:
    """A deadline and a flag that says that nobody waits any more, asked by long work between its steps.

    One thread works and asks; any other thread may call `abandon`. Work asks often enough to end within 100 ms.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        """Begin now and end in `seconds`; by default there is no deadline."""
        self._began = time.monotonic()
        self._deadline = self._began + seconds
        self._abandoned = threading.Event()

    def within(self, seconds: float) -> "Budget":
        """A part of this budget that begins now: it ends in `seconds`, or earlier with the whole.

        Part and whole are abandoned together, whichever of them `abandon` is called on.
        """
        part = Budget(min(seconds, self.remaining))
        part._abandoned = self._abandoned
        return part

    def abandon(self) -> None:
        """Tell the work that nobody waits for its result. Safe from any thread, at any time, and more than once."""
        self._abandoned.set()

    @property
    def elapsed(self) -> float:
        """Seconds since it began."""
        return time.monotonic() - self._began

    @property
    def remaining(self) -> float:
        """Seconds until the deadline, 0 or more; infinite where there is none."""
        return max(self._deadline - time.monotonic(), 0.0)

    def is_spent(self) -> bool:
        """Whether the deadline has passed, so that the work ends with what it has found.

        Raises:
            Abandoned: nobody waits for the result; the work ends without one.
        """
        if self._abandoned.is_set():
            raise Abandoned
        return self._deadline <= time.monotonic()
