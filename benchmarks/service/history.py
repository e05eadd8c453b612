"""docs/performance-history.md: what operations of each release cost, relative to a calibration loop.

A slowdown is judged by processor time, and relative to the loop on the same machine in the same minute: so it depends
neither on how fast a machine is nor on what else it does. What is left of noise is a few per cent, and a slowdown that
is noise is not there again when it is measured again. Processors of another kind have another ratio of memory to
arithmetic, so they are not compared.
"""

import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Final, NamedTuple

import numpy as np

from benchmarks.experiments import Figures
from benchmarks.machine import ROOT, machine
from benchmarks.markdown import page, prose, table
from benchmarks.service.calibration import CalibrationLoop
from benchmarks.service.connection import Connection, request_bytes
from benchmarks.service.parts import PARTS
from benchmarks.service.versions import Version, cpu_seconds
from benchmarks.service.waterfall import lines
from benchmarks.service.workload import Workload, put_request, query_request

PAGE: Final = "docs/performance-history.md"
LIMIT: Final = 1.3
"""Times as much work as in the release before, beyond which an operation is slower."""
_TRIES: Final = 3
"""Measurements that must all say so."""
_TURNS: Final = 15
_TURN: Final = 10
"""Requests of a kind in a turn."""
_SUBMAPS: Final = 200
_GOOD: Final = (200, 201)
_PROCESSOR: Final = "processor"
_KINDS: Final = {
    "library": "a query in the library",
    "query": "a query over HTTP",
    "without pairs": "the same with `pairs: false`",
    "PUT": "a submap stored",
    "empty": "GET /livez",
}


class Release(NamedTuple):
    """A line of the page: what operations of each kind cost, and the kind of processor that says so."""

    processor: str
    costs: dict[str, float]


def costs(version: Version) -> dict[str, float]:
    """Processor time of an operation of each kind, in passes of the calibration loop, of the service's process.

    Kinds that the version does not know are left out.
    """
    workload, calibration = Workload.make(_SUBMAPS, 0), CalibrationLoop()
    views, queries = workload.views, workload.queries
    requests: dict[str, Callable[[int], bytes]] = {
        "query": lambda number: queries[number % len(queries)],
        "without pairs": lambda number: query_request(views[number % len(views)], pairs=False),
        "PUT": lambda number: put_request(f"p{number}", (views[number % len(views)] + 0.001 * number).round(3)),
        "empty": lambda _: request_bytes("GET", "/livez"),
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with version.service(folder) as server, version.library(workload.save(folder / "submaps.npz")) as library:
            workload.fill(server.url)
            with Connection(server.url) as connection:
                over_http = partial(_over_http, server.process.pid, connection)
                kinds: dict[str, Callable[[int], float]] = {
                    "library": lambda turn: float(np.mean([one["cpu"] for one in library.ask(turn * _TURN, _TURN)]))
                }
                for kind, make in requests.items():
                    if connection.send(make(0)).status in _GOOD:
                        kinds[kind] = partial(over_http, make)
                return _relative(calibration, kinds)


def _over_http(pid: int, connection: Connection, make: Callable[[int], bytes], turn: int) -> float:
    """Milliseconds of processor time of a request, over a turn."""
    began = cpu_seconds(pid)
    for number in range(turn * _TURN, (turn + 1) * _TURN):
        answer = connection.send(make(number + 1))
        if answer.status not in _GOOD:
            raise RuntimeError(f"the service answered {answer.status}: {answer.body[:200]!r}")
    return 1e3 * (cpu_seconds(pid) - began) / _TURN


def _relative(calibration: CalibrationLoop, kinds: Mapping[str, Callable[[int], float]]) -> dict[str, float]:
    """The median over turns of an operation's time divided by that of the loop just before and after it."""
    ratios: dict[str, list[float]] = {kind: [] for kind in kinds}
    for turn in range(-1, _TURNS):
        before = calibration.cpu_milliseconds()
        for kind, asked in kinds.items():
            spent = asked(turn + 1)
            after = calibration.cpu_milliseconds()
            if turn >= 0:  # the first turn finds cold caches
                ratios[kind].append(spent / (0.5 * (before + after)))
            before = after
    return {kind: median(found) for kind, found in ratios.items()}


def slower(measure: Callable[[], Mapping[str, float]], reference: Mapping[str, float]) -> dict[str, float]:
    """Operations that took more than `LIMIT` times the reference in each of several measurements, and how much more."""
    found: dict[str, float] = {}
    for number in range(_TRIES):
        ratios = {kind: cost / reference[kind] for kind, cost in measure().items() if kind in reference}
        beyond = {kind: ratio for kind, ratio in ratios.items() if ratio > LIMIT}
        found = beyond if number == 0 else {kind: min(found[kind], beyond[kind]) for kind in found if kind in beyond}
        if not found:
            break
    return found


def check() -> int:
    """Compare this checkout with the last line of the page; 1 and the waterfall if an operation is slower, else 0."""
    rows = read((ROOT / PAGE).read_text(encoding="utf-8"))
    name, (processor, reference) = list(rows.items())[-1]
    here = machine()["processor"]
    if here != processor:
        print(f"not compared with {name}: that was measured on {processor}, and this is {here}")
        return 0
    beyond = slower(lambda: _told(costs(Version.current()), name, reference), reference)
    if not beyond:
        print(f"no operation takes more than {LIMIT:g} times the work that it took in {name}")
        return 0
    for kind, ratio in beyond.items():
        print(f"{_KINDS[kind]} takes {ratio:.2f} times the work that it took in {name}")
    waterfall: Figures = PARTS["waterfall"]([], quick=True)
    print("a query end to end:", *lines(waterfall), sep="\n")
    return 1


def _told(found: dict[str, float], name: str, reference: Mapping[str, float]) -> dict[str, float]:
    ratios = ", ".join(f"{kind} {cost / reference[kind]:.2f}" for kind, cost in found.items() if kind in reference)
    print(f"relative to {name}: {ratios}", flush=True)
    return found


def add(release: str, version: Version) -> None:
    """Measure a version, and write its line."""
    path = ROOT / PAGE
    rows = read(path.read_text(encoding="utf-8")) if path.exists() else {}
    rows[release] = Release(machine()["processor"], costs(version))
    path.write_text(write(rows), encoding="utf-8")
    print(write(rows))


def read(text: str) -> dict[str, Release]:
    """The lines of the page by release."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    head = rows[0][2:] if rows else []
    return {
        name: Release(processor, {kind: float(cell) for kind, cell in zip(head, cells, strict=True) if cell != "-"})
        for name, processor, *cells in rows[2:]
    }


def write(rows: Mapping[str, Release]) -> str:
    """The page."""
    told = [
        [name, processor, *(f"{costs[kind]:.3f}" if kind in costs else "-" for kind in _KINDS)]
        for name, (processor, costs) in rows.items()
    ]
    kinds = ", ".join(f"*{kind}*: {what}" for kind, what in _KINDS.items())
    return page(
        "# What operations cost, release by release",
        prose(
            f"""Processor time of the service's process (of the library's process for the first column), divided by that
            of a calibration loop on the same machine in the same seconds: interpreter, JSON, SQLite, numpy and a
            triangulation, about 2 ms (`benchmarks/service/calibration.py`). So the figures of different machines can
            be compared, roughly. {kinds}. {_SUBMAPS} submaps of about 90 trees, one request at a time."""
        ),
        table(["release", _PROCESSOR, *_KINDS], told, words=2),
        prose(
            f"""`make bench-check` measures this checkout and fails if an operation takes more than {LIMIT:g} times the
            work of the last line, {_TRIES} times in a row; then it prints where a query spends its time. On a processor
            of another kind it compares nothing.
            `python -m benchmarks.service --release NAME` adds a line, or replaces the one of that name. Milliseconds,
            beside an older commit, are in [scaling.md](scaling.md)."""
        ),
    )
