"""One query at a time: the library in a process of its own and the service over one connection, in turn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import Final

import orjson

from benchmarks.experiments import Figures
from benchmarks.server_process import BenchmarkServer
from benchmarks.service.connection import Connection, request_bytes
from benchmarks.service.versions import Library, cpu_seconds
from benchmarks.service.workload import Workload, query_request

_TURN: Final = 20
"""Queries. After so many the next one has its turn, so that all see the same machine."""
_EMPTY: Final = request_bytes("GET", "/livez")


@dataclass(frozen=True, slots=True)
class Subject:
    """A version at work: its service, and its library."""

    server: BenchmarkServer
    library: Library


@dataclass(slots=True)
class _Times:
    """Milliseconds of requests: of the clock one by one, and of the service's processor in all."""

    wall: list[float] = field(default_factory=list)
    cpu: float = 0.0

    def figures(self) -> Figures:
        return {"p50": median(self.wall), "cpu": self.cpu / len(self.wall)}


def measure(subjects: Mapping[str, Subject], workload: Workload, *, asked: int) -> dict[str, Figures]:
    """Milliseconds by version: `library`, `http`, `without_pairs` and `empty`, each p50 and processor time.

    The first turn does not count. `added` is what HTTP adds to the library; `agreed` queries of `asked` had an answer.
    """
    shorter = [query_request(view, pairs=False) for view in workload.views]
    kinds = {
        name: ("library", "http", *(("without_pairs",) if _takes(subject.server, shorter[0]) else ()), "empty")
        for name, subject in subjects.items()
    }
    times = {name: {kind: _Times() for kind in kinds[name]} for name in subjects}
    agreed = dict.fromkeys(subjects, 0)
    for first in range(-_TURN, asked, _TURN):
        for name, subject in subjects.items():
            spent = times[name] if first >= 0 else {kind: _Times() for kind in times[name]}
            for one in subject.library.ask(max(first, 0), _TURN):
                spent["library"].wall.append(one["wall"])
                spent["library"].cpu += one["cpu"]
            turn = range(max(first, 0), max(first, 0) + _TURN)
            answers = _ask(subject.server, [workload.queries[n % len(workload.queries)] for n in turn], spent["http"])
            agreed[name] += sum(orjson.loads(body)["verdict"] == "matched" for body in answers) if first >= 0 else 0
            if "without_pairs" in spent:
                _ask(subject.server, [shorter[n % len(shorter)] for n in turn], spent["without_pairs"])
            _ask(subject.server, [_EMPTY] * _TURN, spent["empty"])
    return {name: _figures(kinds) | {"matched": agreed[name], "asked": asked} for name, kinds in times.items()}


def _takes(server: BenchmarkServer, request: bytes) -> bool:
    """Whether a version knows what a request asks for."""
    with Connection(server.url) as connection:
        return connection.send(request).status == 200


def _figures(kinds: Mapping[str, _Times]) -> Figures:
    found: Figures = {kind: times.figures() for kind, times in kinds.items()}
    found["added"] = {part: found["http"][part] - found["library"][part] for part in ("p50", "cpu")}
    return found


def _ask(server: BenchmarkServer, requests: Sequence[bytes], spent: _Times) -> list[bytes]:
    answers = []
    with Connection(server.url) as connection:
        connection.send(_EMPTY)
        cpu = cpu_seconds(server.process.pid)
        for request in requests:
            began = perf_counter()
            answer = connection.send(request)
            spent.wall.append(1e3 * (perf_counter() - began))
            if answer.status != 200:
                raise RuntimeError(f"the service answered {answer.status}: {answer.body[:200]!r}")
            answers.append(answer.body)
        spent.cpu += 1e3 * (cpu_seconds(server.process.pid) - cpu)
    return answers
