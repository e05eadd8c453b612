"""What the service records about a request for its log line."""

from collections import Counter
from collections.abc import Iterable
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class RequestNotes:
    """Verdicts of a request's queries, and the total milliseconds of their stages."""

    verdicts: Counter[str] = field(default_factory=Counter)
    stages: dict[str, float] = field(default_factory=dict)

    def log_members(self) -> dict[str, Any]:
        """The members of the log line: `verdict` of one query, `verdicts` of several, `stages`."""
        if not self.verdicts:
            return {}
        only = len(self.verdicts) == 1 and self.verdicts.total() == 1
        verdict = {"verdict": next(iter(self.verdicts))} if only else {"verdicts": dict(self.verdicts)}
        return {**verdict, "stages": {name: round(spent, 3) for name, spent in self.stages.items()}}


_notes: ContextVar[RequestNotes | None] = ContextVar("notes", default=None)


def begin() -> RequestNotes:
    """Begin the record of the request that this task, and the threads it waits for, work on."""
    notes = RequestNotes()
    _notes.set(notes)
    return notes


def note_query(verdict: str, stages: Iterable[tuple[str, float]]) -> None:
    """Record a query; `stages` are names and milliseconds. Does nothing if no request is in progress."""
    notes = _notes.get()
    if notes is None:
        return
    notes.verdicts[verdict] += 1
    for name, spent in stages:
        notes.stages[name] = notes.stages.get(name, 0.0) + spent
