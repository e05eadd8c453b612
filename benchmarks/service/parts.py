"""What is measured, part by part: each gives the figures of every version, all measured in the same run."""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.server_process import BenchmarkServer
from benchmarks.service import crowd, first_queries, single, start_costs, waterfall
from benchmarks.service.versions import Version
from benchmarks.service.workload import Workload

_CLIENTS: Final = 32
_WRITERS: Final = 8
_ROUNDS: Final = 2
"""Turns of each version at the crowd, so that all see the same machine."""


def measure_single(versions: Sequence[Version], *, quick: bool) -> Figures:
    """One query at a time among a thousand submaps."""
    workload = Workload.make(200 if quick else 1_000, 0)
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        submaps = workload.save(Path(name) / "submaps.npz")
        subjects = {}
        for version in versions:
            server = stack.enter_context(version.service(Path(name)))
            workload.fill(server.url)
            subjects[version.name] = single.Subject(server, stack.enter_context(version.library(submaps)))
        found = single.measure(subjects, workload, asked=40 if quick else 300)
    return {"submaps": len(workload.submaps), "trees": workload.trees, "versions": found}


def measure_crowd(versions: Sequence[Version], *, quick: bool) -> Figures:
    """A fleet: 32 clients, nine of ten requests queries, among ten thousand submaps."""
    workload = Workload.make(300 if quick else 10_000, 0)
    seconds = 2.0 if quick else 10.0
    with _services(versions, workload) as servers:
        found = _in_turn(servers, lambda turn: crowd.fleet(workload, turn), clients=_CLIENTS, seconds=seconds)
    # With several workers the processor time is that of their parent, so it says nothing.
    with _services([versions[-1]], workload, URQUHART_WORKERS=str(os.cpu_count() or 1)) as servers:
        each = _in_turn(servers, lambda turn: crowd.fleet(workload, turn), clients=_CLIENTS, seconds=seconds)
    found[versions[-1].name]["by_workers"] = each[versions[-1].name]
    return {"submaps": len(workload.submaps), "versions": found}


def measure_puts(versions: Sequence[Version], *, quick: bool) -> Figures:
    """Eight clients that store, each submap durable before it is acknowledged."""
    workload = Workload.make(200, 0)
    seconds = 2.0 if quick else 5.0
    with _services(versions, workload) as servers:
        found = _in_turn(servers, lambda turn: crowd.writers(workload, turn), clients=_WRITERS, seconds=seconds)
    return {"trees": workload.trees, "versions": found}


def measure_waterfall(versions: Sequence[Version], *, quick: bool) -> Figures:
    """One query end to end, of this checkout only."""
    workload = Workload.make(200 if quick else 1_000, 0)
    with tempfile.TemporaryDirectory() as name:
        return {"submaps": len(workload.submaps)} | waterfall.measure(Path(name), workload, asked=40 if quick else 300)


def measure_start(versions: Sequence[Version], *, quick: bool) -> Figures:
    """Start, memory and size."""
    return {"versions": {version.name: start_costs.measure(version, first=not quick) for version in versions}}


def measure_first(versions: Sequence[Version], *, quick: bool) -> Figures:
    """The first request of each kind after a start."""
    workload = Workload.make(200 if quick else 1_000, 0)
    found = {version.name: first_queries.measure(version, workload) for version in versions}
    return {"submaps": len(workload.submaps), "versions": found}


def measure_kernels(versions: Sequence[Version], *, quick: bool) -> Figures:
    """What imports and kernels cost a process."""
    return {"versions": {version.name: start_costs.measure_kernels(version) for version in versions}}


PARTS: Final[dict[str, Callable[..., Figures]]] = {
    "single": measure_single,
    "waterfall": measure_waterfall,
    "crowd": measure_crowd,
    "puts": measure_puts,
    "start": measure_start,
    "first": measure_first,
    "kernels": measure_kernels,
}


@contextmanager
def _services(versions: Sequence[Version], workload: Workload, **settings: str) -> Iterator[dict[str, BenchmarkServer]]:
    """A service of each version that holds the submaps, all at once: one that is idle costs the other nothing."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        servers = {version.name: stack.enter_context(version.service(Path(name), **settings)) for version in versions}
        for server in servers.values():
            workload.fill(server.url)
        yield servers


def _in_turn(
    servers: Mapping[str, BenchmarkServer], draw: Callable[[int], crowd.Draw], *, clients: int, seconds: float
) -> dict[str, Figures]:
    """The services in turn; of each the run with the most answers a second, because the machine slows the others."""
    runs: dict[str, list[Figures]] = {name: [] for name in servers}
    for turn in range(_ROUNDS):
        for name, server in servers.items():
            runs[name].append(crowd.drive(server, draw(turn), clients=clients, seconds=seconds))
    return {name: max(found, key=lambda run: float(run["a_second"])) for name, found in runs.items()}
