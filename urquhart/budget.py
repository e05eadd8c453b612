"""How long a piece of work may go on: until a deadline, and only while somebody waits for its result."""

import math
import threading
import time
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple, TypeVar

T = TypeVar("T")


class WorkNumbers(NamedTuple):
    """How often work asks whether to go on. Chosen by hand for answers within 100 ms, not fitted."""

    items: int = 1_000
    """Items of work in Python, of a few microseconds each, after which it asks."""
    steps: float = 5_000_000
    """Steps of compiled work that take 10 to 50 ms."""


WORK: Final = WorkNumbers()


class Abandoned(Exception):
    """Nobody waits for the result any more: the caller has gone, or its key was revoked."""


class OutOfTime(Exception):
    """The deadline has passed in the middle of a step; whoever began the step goes on with what was done before."""


class Budget:
    """A deadline and a flag that says that nobody waits any more, asked by long work between its steps.

    One thread works and asks; any other thread may call `abandon`. Work asks often enough to end within 100 ms.
    """

    def __init__(self, seconds: float = math.inf, *, steps: float = WORK.steps) -> None:
        """Begin now and end in `seconds`; by default there is no deadline.

        Args:
            steps: of compiled work, each about a landmark looked at, after which work asks whether to go on.
        """
        self._steps = steps
        self._began = time.monotonic()
        self._deadline = self._began + seconds
        self._abandoned = threading.Event()

    def within(self, seconds: float) -> "Budget":
        """A part of this budget that begins now: it ends in `seconds`, or earlier with the whole.

        Part and whole are abandoned together, whichever of them `abandon` is called on.
        """
        part = Budget(min(seconds, self.remaining), steps=self._steps)
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

    def check(self) -> None:
        """Leave the step that is being done, where the deadline has passed.

        Raises:
            OutOfTime: the deadline has passed.
            Abandoned: nobody waits for the result.
        """
        if self.is_spent():
            raise OutOfTime

    def fits(self, count: int, cost: float) -> bool:
        """Whether `count` items that cost `cost` steps each are so little work that nobody asks within it."""
        return count * cost <= self._steps

    def portions(self, count: int, cost: float) -> Iterator[slice]:
        """Slices of `count` items that cost `cost` steps each, so small that none takes more than about 50 ms.

        Raises:
            OutOfTime: before any slice but the first, where the deadline has passed.
            Abandoned: before any slice, where nobody waits for the result.
        """
        size = max(int(self._steps / max(cost, 1.0)), 1)
        for begin in range(0, count, size):
            if self.is_spent() and begin > 0:
                raise OutOfTime
            yield slice(begin, min(begin + size, count))

    def each(self, items: Iterable[T]) -> Iterator[T]:
        """The same items, each so little work that now and then is often enough to ask.

        Raises:
            OutOfTime: the deadline has passed.
            Abandoned: nobody waits for the result.
        """
        for number, item in enumerate(items):
            if number % WORK.items == 0:
                self.check()
            yield item

    def unless_spent(self, items: Iterable[T]) -> Iterator[T]:
        """The same items, until the deadline has passed.

        Raises:
            Abandoned: nobody waits for the result.
        """
        for item in items:
            yield item
            if self.is_spent():
                return


UNBOUNDED: Final = Budget()
"""For work that is small, or that nobody could want to end early. Never to be abandoned: it is everybody's."""
