"""What each stage of a search found and what it cost, and how the search ended."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

StoppedBy = Literal["settled", "beats_chance", "exhausted", "deadline", "not_started"]
Skipped = Literal["quad_hits", "common_quads", "exhaustive", "exhaustive_rest"]


@dataclass(frozen=True, slots=True)
class SearchEnd:
    """Why a search ended, and which of its limits left something out. The words are stable.

    Attributes:
        stopped_by: `settled`: the first candidate is so sure that no further level could change the answer;
            `beats_chance`: chance is ruled out for the first candidate, and more levels would only add weaker poses;
            `exhausted`: every level was tried; `deadline`: the time ran out first, and the reason of the verdict is
            `deadline` too; `not_started`: there was nothing to search for, or nothing to search in.
        skipped: limits that were met, in the order they were met, each once; empty where nothing was left out.
            `quad_hits`: the search for quads found as many as `Config.quad_hits` allows before it had looked for all;
            `common_quads`: quads of the query that are too common in the collection were passed over;
            `exhaustive`: the last level, which tries every rotation and shift, was left out, because it would reach too
            small a part of the collection; `exhaustive_rest`: it tried only the most promising submaps.
    """

    stopped_by: StoppedBy
    skipped: tuple[Skipped, ...] = ()


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of a look-up: its name, what it cost (milliseconds) and what it found."""

    name: str
    milliseconds: float
    counts: dict[str, int]


class Trace:
    """What one look-up did: its stages in the order they ran, and the limits that left something out."""

    def __init__(self) -> None:
        self._done: list[Stage] = []
        self._skipped: dict[Skipped, None] = {}

    @contextmanager
    def timed(self, name: str) -> Iterator[dict[str, int]]:
        """Time the block as one stage; what it puts into the yielded dictionary are the stage's counts."""
        counts: dict[str, int] = {}
        start = time.perf_counter()
        try:
            yield counts
        finally:
            self._done.append(Stage(name, (time.perf_counter() - start) * 1e3, counts))

    def done(self) -> tuple[Stage, ...]:
        """All stages so far."""
        return tuple(self._done)

    def skip(self, what: Skipped) -> None:
        """Remember that a limit left something out; the same limit counts once."""
        self._skipped[what] = None

    def end(self, stopped_by: StoppedBy) -> SearchEnd:
        """How the search ended, with all limits that it met."""
        return SearchEnd(stopped_by, tuple(self._skipped))
