"""A query end to end: where each part of a millisecond goes, from the first byte sent to the last one received."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter_ns
from typing import Final, NamedTuple

import orjson

from benchmarks.experiments import Figures
from benchmarks.service.connection import Connection
from benchmarks.service.marks import FILE, Mark
from benchmarks.service.versions import Version
from benchmarks.service.workload import Workload

_WARM: Final = 40
"""Queries that do not count."""
_PROGRAM: Final = ("-m", "benchmarks.service.marks")


class WaterfallStage(NamedTuple):
    """A stretch of a query's way, between two marks."""

    name: str
    begin: str
    end: str
    what: str


STAGES: Final = (
    WaterfallStage("receive", "sent", "layers", "socket, event loop, HTTP parser"),
    WaterfallStage("admit", "layers", "body", "middleware, routing, key, rate; the body is read, and a place is taken"),
    WaterfallStage("parse", "body", "parsed", "JSON, read strictly"),
    WaterfallStage("validate", "parsed", "called", "model, parameters, and the hop to a thread"),
    WaterfallStage("snapshot", "called", "snapshot", "read transaction, and the index at its revision"),
    WaterfallStage("search", "snapshot", "searched", "the library: describe, propose, verify, decide"),
    WaterfallStage("rows", "searched", "answered", "what the answer tells of the submaps that were found"),
    WaterfallStage("serialise", "answered", "serialised", "JSON"),
    WaterfallStage("send", "serialised", "arrived", "the hop back, middleware, HTTP, socket"),
)


def measure(folder: Path, workload: Workload, *, asked: int) -> Figures:
    """The median milliseconds of each stage, of the clock and of the service's processor, and of all together."""
    path = folder / "marks.json"
    with Version.current().service(folder, *_PROGRAM, **{FILE: str(path)}) as server:
        workload.fill(server.url)
        with Connection(server.url) as connection:
            seen = [_ask(connection, workload, number, path) for number in range(_WARM + asked)][_WARM:]
    stages = {
        stage.name: {part: median(_between(marks, stage, part) for marks in seen) for part in ("wall", "cpu")}
        for stage in STAGES
    }
    whole = median((marks[-1].wall - marks[0].wall) / 1e6 for marks in seen)
    return {"stages": stages, "whole": whole, "asked": asked}


def _ask(connection: Connection, workload: Workload, number: int, path: Path) -> list[Mark]:
    path.write_bytes(b"")
    sent = perf_counter_ns()
    connection.send(workload.queries[number % len(workload.queries)])
    arrived = perf_counter_ns()
    while not (line := path.read_bytes()).endswith(b"\n"):
        continue  # the marks are written when the answer is on its way
    marks = [Mark(*values) for values in orjson.loads(line.splitlines()[-1])]
    # What the service does before its first mark and after its last one is the kernel's work and the client's.
    return [Mark("sent", sent, marks[0].cpu), *marks, Mark("arrived", arrived, marks[-1].cpu)]


def _between(marks: Sequence[Mark], stage: WaterfallStage, part: str) -> float:
    """Milliseconds from the first mark where a stage begins to the last one where it ends."""
    begin = next(getattr(mark, part) for mark in marks if mark.name == stage.begin)
    end = next(getattr(mark, part) for mark in reversed(marks) if mark.name == stage.end)
    return float(end - begin) / 1e6


def lines(figures: Figures) -> list[str]:
    """The waterfall as text: a bar for each stage, from where it begins to where it ends."""
    width, begin, drawn = 50, 0.0, []
    whole = sum(stage["wall"] for stage in figures["stages"].values())
    for stage in STAGES:
        spent = figures["stages"][stage.name]
        left = round(width * begin / whole)
        begin += spent["wall"]
        bar = " " * left + "#" * max(round(width * begin / whole) - left, 1)
        drawn.append(f"{stage.name:<10}{spent['wall']:>7.3f} ms {spent['cpu']:>7.3f} cpu  |{bar:<{width}}|")
    return drawn
