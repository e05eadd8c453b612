"""Deadlines and cancellation: how long a piece of work may run, and whether anybody still waits for its result."""

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple, TypeVar

T = TypeVar("T")


class WorkNumbers(NamedTuple):
    """How often work checks its budget. Chosen by hand, so that work ends within 100 ms; not fitted."""

    items: int = 1_000
    """Items of Python work, a few microseconds each, between two checks."""
    steps: float = 5_000_000
    """Steps of compiled work between two checks: 10 to 50 ms."""


WORK: Final = WorkNumbers()


class Abandoned(Exception):
    """Nobody waits for the result any more: the caller disconnected, or its API key was revoked."""


class DeadlinePassed(Exception):
    """The deadline passed in the middle of a step. The caller of the step continues with its earlier results."""


class Budget:
    """A deadline and a cancellation flag, which long work checks between its steps.

    One thread works and checks; any other thread may call `abandon`. Work checks often enough to end within 100 ms.
    """

    def __init__(
        self,
        seconds: float = math.inf,
        *,
        steps: float = WORK.steps,
        give_way: Callable[[], None] | None = None,
    ) -> None:
        """Start now and end in `seconds`; by default there is no deadline.

        Args:
            steps: steps of compiled work between two checks; a step is about the work of reading one landmark.
            give_way: called at every check, on the thread that works; it may pause there to let other work go first.
        """
        self._steps, self._give_way = steps, give_way
        self._began = time.monotonic()
        self._deadline = self._began + seconds
        self._abandoned = threading.Event()

    def within(self, seconds: float) -> "Budget":
        """A part of this budget that starts now. It ends in `seconds`, or when this budget ends if that is earlier.

        Both share one cancellation flag: `abandon` on either of them cancels both.
        """
        part = Budget(min(seconds, self.remaining), steps=self._steps, give_way=self._give_way)
        part._abandoned = self._abandoned
        return part

    def abandon(self) -> None:
        """Cancel the work, because nobody waits for its result. Safe from any thread, at any time, repeatedly."""
        self._abandoned.set()

    @property
    def elapsed(self) -> float:
        """Seconds since the budget was started."""
        return time.monotonic() - self._began

    @property
    def remaining(self) -> float:
        """Seconds until the deadline, never negative; infinite if there is no deadline."""
        return max(self._deadline - time.monotonic(), 0.0)

    def is_spent(self) -> bool:
        """Whether the deadline has passed. If so, the work should end with what it has found.

        Raises:
            Abandoned: nobody waits for the result; the work ends without one.
        """
        if self._give_way is not None:
            self._give_way()
        if self._abandoned.is_set():
            raise Abandoned
        return self._deadline <= time.monotonic()

    def check(self) -> None:
        """Leave the current step, by an exception, if the deadline has passed.

        Raises:
            DeadlinePassed: the deadline has passed.
            Abandoned: nobody waits for the result.
        """
        if self.is_spent():
            raise DeadlinePassed

    def fits(self, count: int, cost: float) -> bool:
        """Whether `count` items of `cost` steps each can be done without a check in between."""
        return count * cost <= self._steps

    def portions(self, count: int, cost: float) -> Iterator[slice]:
        """Slices of `count` items of `cost` steps each, small enough that none takes more than about 50 ms.

        Raises:
            DeadlinePassed: the deadline passed before a slice other than the first.
            Abandoned: nobody waits for the result.
        """
        size = max(int(self._steps / max(cost, 1.0)), 1)
        for begin in range(0, count, size):
            if self.is_spent() and begin > 0:
                raise DeadlinePassed
            yield slice(begin, min(begin + size, count))

    def each(self, items: Iterable[T]) -> Iterator[T]:
        """The same items, with a check before every `WORK.items` of them: for items that are little work each.

        Raises:
            DeadlinePassed: the deadline has passed.
            Abandoned: nobody waits for the result.
        """
        for number, item in enumerate(items):
            if number % WORK.items == 0:
                self.check()
            yield item

    def unless_spent(self, items: Iterable[T]) -> Iterator[T]:
        """The same items, up to the first one after which the deadline has passed.

        Raises:
            Abandoned: nobody waits for the result.
        """
        for item in items:
            yield item
            if self.is_spent():
                return


UNBOUNDED: Final = Budget()
"""For small work, and for work that must not end early. It is shared by all callers: never abandon it."""
