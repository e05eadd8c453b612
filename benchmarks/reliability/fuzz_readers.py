"""Part `readers`: a million inputs to whatever reads what callers send. Only errors of the domain may come out.

An input is a good one whose bytes are damaged, a good one of which parts are replaced, or one from a grammar. A finding
is any other exception; an input that takes longer than `PATIENCE` counts as one that hangs.
"""

import gc
import multiprocessing
import random
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, Final

from benchmarks.experiments import Figures
from benchmarks.reliability.fuzz_targets import READERS, Reader
from benchmarks.scale.measurement import memory

PATIENCE: Final = 10.0
"""Seconds for one input."""
_SHARES: Final = {"lines": 0.34, "bodies": 0.33, "stem maps": 0.25, "parameters": 0.08}
"""Of all inputs, by reader."""
_WARM: Final = 0.2
"""Share of the inputs after which memory is looked at first: until then caches fill."""


@dataclass
class Tally:
    """What one process saw of one reader.

    Attributes:
        inputs: so many.
        accepted: of them were good.
        refused: errors of the domain by name.
        findings: other exceptions, each once: where it came from, and an input that shows it.
        slowest: seconds of the slowest input, and the input.
        memory: MB of its own after a fifth of the inputs, and at the end.
    """

    inputs: int = 0
    accepted: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    findings: dict[str, str] = field(default_factory=dict)
    slowest: tuple[float, str] = (0.0, "")
    memory: tuple[float, float] = (0.0, 0.0)


def run(*, quick: bool, seed: int) -> Figures:
    """Feed all readers, in two processes."""
    inputs = 20_000 if quick else 1_050_000
    jobs = [
        (name, int(inputs * share / 2), 1_000_003 * seed + half) for name, share in _SHARES.items() for half in (0, 1)
    ]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        tallies = pool.starmap(feed, jobs, chunksize=1)
    readers = {name: _merged([t for job, t in zip(jobs, tallies, strict=True) if job[0] == name]) for name in _SHARES}
    return {"inputs": sum(one["inputs"] for one in readers.values()), "readers": readers}


def feed(name: str, inputs: int, seed: int) -> Tally:
    """Give so many inputs to a reader, and see what becomes of each."""
    rng, tally = random.Random(seed), Tally()
    with tempfile.TemporaryDirectory() as folder, READERS[name](Path(folder)) as reader, _alarm():
        for number in range(inputs):
            if number == int(inputs * _WARM):
                tally.memory = (_own(), 0.0)
            _one(reader, reader.draw(rng), tally)
        tally.memory = (tally.memory[0], _own())
    return tally


def _one(reader: Reader, given: Any, tally: Tally) -> None:
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    began = time.perf_counter()
    try:
        refused = reader.read(given)
    except Exception as error:  # noqa: BLE001 (each is a finding, which is what is looked for)
        tally.findings.setdefault(_where(error), repr(given)[:1000])
    else:
        tally.accepted += refused is None
        if refused is not None:
            tally.refused[refused] += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    tally.inputs += 1
    spent = time.perf_counter() - began
    if spent > tally.slowest[0]:
        tally.slowest = (spent, repr(given)[:200])


class _alarm:  # noqa: N801 (used as a function)
    """While it is open, an input that takes too long is interrupted."""

    def __enter__(self) -> None:
        self._before: Callable[[int, FrameType | None], Any] | int | None = signal.signal(signal.SIGALRM, _too_long)

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGALRM, self._before)


def _too_long(number: int, frame: FrameType | None) -> None:
    raise TimeoutError(f"longer than {PATIENCE:g} s")


def _own() -> float:
    gc.collect()
    return float(memory()["own"])


def _where(error: Exception) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} in {last.name} ({Path(last.filename).name}): {str(error)[:200]}"


def _merged(tallies: list[Tally]) -> Figures:
    refused: Counter[str] = Counter()
    findings: dict[str, str] = {}
    for tally in tallies:
        refused.update(tally.refused)
        findings = tally.findings | findings
    seconds, slowest = max(tally.slowest for tally in tallies)
    return {
        "inputs": sum(tally.inputs for tally in tallies),
        "accepted": sum(tally.accepted for tally in tallies),
        "refused": dict(refused.most_common()),
        "findings": [{"what": what, "input": given} for what, given in sorted(findings.items())],
        "slowest_milliseconds": 1e3 * seconds,
        "slowest": slowest,
        "growth_megabytes": max(tally.memory[1] - tally.memory[0] for tally in tallies),
    }
