"""A record of one search: the cost and the counts of each stage, and how the search ended."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from urquhart.options import FAST_PROMISE, Promise

StoppedBy = Literal[
    "decided", "beats_chance", "evidence_bound", "effort", "exhausted", "window", "deadline", "not_started"
]
Skipped = Literal["quad_hits", "common_quads", "exhaustive", "exhaustive_rest"]


@dataclass(frozen=True, slots=True)
class SearchEnd:
    """Why a search ended, and which of its limits left something out. The words are part of the API.

    Attributes:
        stopped_by: `decided`: the first candidate is so certain that no further level could change the answer;
            `beats_chance`: chance is ruled out for the first candidate, and more levels would only add weaker poses;
            `evidence_bound`: a stored place would have shown more evidence by now, if the query is as good as
            `promised`; `effort`: the effort `fast` ends here, and the query has too few trees for a promise;
            `exhausted`: no step of the method was left to try; `window`: every pose of a given prior's window was
            tried, and none outside of it; `deadline`: time ran out, and the verdict's reason is
            `deadline` too; `not_started`: there was nothing to search for, or nothing to search in.
        promised: with `evidence_bound`, how good the query must be for this to mean that its place is not stored.
        skipped: the limits that were reached, each once, in that order; empty if nothing was left out.
            `quad_hits`: the quad search reached the limit `Config.quad_hits` before it had tried all quads;
            `common_quads`: quads of the query that are too common in the collection were skipped;
            `exhaustive`: the last level, which tries every rotation and shift, was skipped, because it would reach too
            small a part of the collection; `exhaustive_rest`: that level tried only the most promising submaps.
    """

    stopped_by: StoppedBy
    skipped: tuple[Skipped, ...] = ()
    promised: Promise | None = None


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of a search: its name, its duration in milliseconds, and its counts by name."""

    name: str
    milliseconds: float
    counts: dict[str, int]


class Trace:
    """Collects the stages of one search in the order they ran, and the limits that left something out."""

    def __init__(self) -> None:
        self._done: list[Stage] = []
        self._skipped: dict[Skipped, None] = {}

    @contextmanager
    def timed(self, name: str) -> Iterator[dict[str, int]]:
        """Time the block as one stage. The block fills the yielded dictionary with the stage's counts."""
        counts: dict[str, int] = {}
        start = time.perf_counter()
        try:
            yield counts
        finally:
            self._done.append(Stage(name, (time.perf_counter() - start) * 1e3, counts))

    def done(self) -> tuple[Stage, ...]:
        """All finished stages, in order."""
        return tuple(self._done)

    def skip(self, what: Skipped) -> None:
        """Record that a limit left something out; repeated calls for one limit count once."""
        self._skipped[what] = None

    def end(self, stopped_by: StoppedBy) -> SearchEnd:
        """How the search ended, with all limits that were recorded."""
        return SearchEnd(stopped_by, tuple(self._skipped), FAST_PROMISE if stopped_by == "evidence_bound" else None)
