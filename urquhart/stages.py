"""What each stage of a look-up found and what it cost."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of a look-up: its name, what it cost (milliseconds) and what it found."""

    name: str
    milliseconds: float
    counts: dict[str, int]


class Stages:
    """Stages in the order they ran."""

    def __init__(self) -> None:
        self._done: list[Stage] = []

    @contextmanager
    def timed(self, name: str) -> Iterator[dict[str, int]]:
        """Time the block as one stage; what it puts into the yielded dictionary are the stage's counts."""
        counts: dict[str, int] = {}
        start = time.perf_counter()
        yield counts
        self._done.append(Stage(name, (time.perf_counter() - start) * 1e3, counts))

    def done(self) -> tuple[Stage, ...]:
        """All stages so far."""
        return tuple(self._done)
