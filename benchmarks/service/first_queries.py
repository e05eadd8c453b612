"""The first request of each kind after a start: what it waits for that later ones do not."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Final

import orjson

from benchmarks.experiments import Figures
from benchmarks.scale.tiled_forest import World
from benchmarks.service.connection import Connection, request_bytes
from benchmarks.service.versions import Version
from benchmarks.service.workload import BASE, Workload, put_request, query_request

_LATER: Final = 15
"""Requests of a kind after its first one, whose median is what it usually takes."""
_STARTS: Final = 3
"""Starts of the service. Of each kind, the start with the smallest ratio counts, because the machine only adds time."""
_UNKNOWN: Final = frozenset({400, 415, 422})

Draw = Callable[[int], bytes]
"""The request of a number."""


def measure(version: Version, workload: Workload) -> Figures:
    """By kind, milliseconds of the `first` request after a start, the median of `later` ones, and their `ratio`; and
    of the kind with the largest ratio, `worst` and `slowest`. A kind that a version does not know is left out.
    """
    with tempfile.TemporaryDirectory() as name:
        with version.service(Path(name)) as server:
            workload.fill(server.url)
        starts = [_after_a_start(version, Path(name), workload, number) for number in range(_STARTS)]
    kinds = {kind: min((one[kind] for one in starts), key=lambda found: found["ratio"]) for kind in starts[0]}
    slowest = max(kinds, key=lambda kind: kinds[kind]["ratio"])
    return {"kinds": kinds, "slowest": slowest, "worst": kinds[slowest]["ratio"], "first": kinds[slowest]["first"]}


def _after_a_start(version: Version, folder: Path, workload: Workload, start: int) -> dict[str, Figures]:
    found = {}
    with version.service(folder) as server, Connection(server.url) as connection:
        # The order turns with the start, because the first kind of all also waits for what the others need as well.
        kinds = list(_kinds(workload, start).items())
        for kind, draw in kinds[start:] + kinds[:start]:
            times = []
            for number in range(1 + _LATER):
                began = time.perf_counter()
                answer = connection.send(draw(number))
                times.append(1e3 * (time.perf_counter() - began))
                if answer.status in _UNKNOWN:
                    break
                if answer.status not in (200, 201):
                    raise RuntimeError(f"{kind}: the service answered {answer.status}: {answer.body[:200]!r}")
            else:
                later = median(times[1:])
                found[kind] = {"first": times[0], "later": later, "ratio": times[0] / later}
    return found


def _kinds(workload: Workload, start: int) -> dict[str, Draw]:
    """Requests by kind. A submap that is stored has a name that no other start has used."""
    world = World(len(workload.submaps), 0)
    foreign = [world.query("outside-20", number).xy.round(3) for number in range(1 + _LATER)]
    views = workload.views

    def batch(number: int) -> bytes:
        several = [{"xy": views[(number + more) % len(views)].tolist()} for more in range(4)]
        return request_bytes("POST", f"{BASE}/queries/batch", orjson.dumps({"queries": several}))

    return {
        "stored place": lambda number: query_request(views[number]),
        "foreign place": lambda number: query_request(foreign[number]),
        "foreign place, full effort": lambda number: query_request(foreign[number], effort="full"),
        "few trees": lambda number: query_request(views[number][:12]),
        "with an explanation": lambda number: query_request(views[number], explain=True),
        "batch of four": batch,
        "PUT": lambda number: put_request(f"first-{start}-{number}", foreign[number]),
    }
