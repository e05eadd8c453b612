"""Results of refused lines: a limited number of bytes, however many lines are refused.

A refused line may have three bytes, and its problem a hundred times as many. So the first refusals are reported in
full, later ones are shortened, and the rest are counted by type. Each is reported or counted.
"""

from collections.abc import Mapping
from typing import Any, Final

import orjson

from server.problem_types import document
from server.submaps.bulk_ingest import LineOutcome

_IN_FULL: Final = 0.5
"""Share of the bytes for full reports; the rest is for shortened ones."""
_KINDS: Final = 200
"""Types that are counted separately; there are about fifty."""
_OTHER: Final = "/problems/invalid-request"


class Refusals:
    """The results of refused lines, and the state that a job keeps between two batches.

    Args:
        most: bytes of lines for them, about; the one that reaches the limit is still reported.
        state: what `state()` said when the job was left, or None.
    """

    def __init__(self, most: int, state: Mapping[str, Any] | None = None) -> None:
        self._most = most
        self._written = int(state["bytes"]) if state else 0
        self._counted: dict[str, list[int]] = {kind: list(known) for kind, known in state["counted"]} if state else {}

    def state(self) -> dict[str, Any]:
        """The number of bytes reported and the counts, ready for JSON."""
        return {"bytes": self._written, "counted": [[kind, known] for kind, known in self._counted.items()]}

    def describe(self, line: LineOutcome) -> bytes | None:
        """The result of a refused line, None if it is only counted."""
        assert line.error is not None
        problem = document(line.error)
        if self._written >= self._most:
            self._count(f"{problem['type']} {problem['status']} {_code(problem)}", line.position + 1)
            return None
        if self._written >= _IN_FULL * self._most:
            problem = {"type": problem["type"], "status": problem["status"], "code": _code(problem)}
        named = {} if line.id is None else {"id": line.id}
        text = orjson.dumps({"line": line.position + 1, **named, "outcome": "refused", "problem": problem}) + b"\n"
        self._written += len(text)
        return text

    def _count(self, kind: str, number: int) -> None:
        if kind not in self._counted and len(self._counted) >= _KINDS:
            kind = f"{_OTHER} 422 other"
        known = self._counted.setdefault(kind, [0, number, number])
        known[0] += 1
        known[2] = number


def summary(state: Mapping[str, Any] | None) -> bytes:
    """Results of refusals that were only counted: the number of `lines` of each type, from `line` to `last_line`."""
    told = []
    for kind, (count, first, last) in state["counted"] if state else ():
        slug, status, code = kind.split(" ", 2)
        problem = {"type": slug, "status": int(status), "code": code}
        entry = {"line": first, "last_line": last, "lines": count, "outcome": "refused", "problem": problem}
        told.append(orjson.dumps(entry) + b"\n")
    return b"".join(told)


def _code(problem: Mapping[str, Any]) -> str:
    """The most specific word of a problem: the code of its first error, else the end of its type."""
    errors = problem.get("errors")
    return str(errors[0]["code"]) if errors else str(problem["type"]).rsplit("/", 1)[-1]
