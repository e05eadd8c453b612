"""Part `shapes`: what the shapes that cost most cost, up to the most landmarks that are accepted.

Each shape in a process of its own: described, and looked up in a collection of submaps like it, within the deadline
that the service has by default. A shape is turned before it is looked up, and every submap has another scale.
"""

import math
import multiprocessing
import time
from typing import Any, Final

import numpy as np

from benchmarks.experiments import Figures
from benchmarks.reliability.worst_shapes import SHAPES
from benchmarks.scale.measurement import memory
from urquhart import SE2, Budget, Config, Recognizer, describe, warm_up

SIZES: Final = (100, 1_000, 5_000, 20_000)
_QUICK: Final = (100, 2_000)
ALIKE: Final = 8
"""Submaps of the collection."""
_INWARD: Final = 0.9
"""So that the largest shapes stay within the limit on coordinates when they are scaled and turned."""
DEADLINE: Final = 5.0
"""Seconds for one search."""


class Watched(Budget):
    """A budget that knows how much was computed at most between two times that it was asked, in processor seconds."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self._asked, self.silence = math.inf, 0.0

    def is_spent(self) -> bool:
        now = time.thread_time()
        self.silence, self._asked = max(self.silence, now - self._asked), now
        return super().is_spent()


def run(*, quick: bool, seed: int) -> Figures:
    """Measure every shape in a process of its own, one after the other."""
    sizes = _QUICK if quick else SIZES
    context = multiprocessing.get_context("spawn")
    shapes = {}
    for name in SHAPES:
        with context.Pool(1) as pool:
            shapes[name] = pool.apply(_measure, (name, sizes, seed))
    return {"sizes": list(sizes), "alike": ALIKE, "deadline": DEADLINE, "shapes": shapes}


def _measure(name: str, sizes: tuple[int, ...], seed: int) -> list[dict[str, Any]]:
    warm_up(Config())
    before = memory()["most"]
    return [_cost(name, size, seed, before) for size in sizes]


def _cost(name: str, size: int, seed: int, before: float) -> dict[str, Any]:
    """What one shape of one size cost.

    `describe` is in processor seconds; `query` are the seconds until the answer, `describe_query` of them to describe
    what was asked for; `silence` are the processor seconds at most between two times that the search asked whether it
    may go on; `megabytes` are what the process held at most beyond what it held before.
    """
    config = Config()
    xy = SHAPES[name](size, np.random.default_rng([seed, size]))
    xy = _INWARD * (xy - xy.mean(axis=0))
    began = time.process_time()
    describe(xy, config)
    described = time.process_time() - began
    recognizer = Recognizer(config)
    recognizer.add((key, describe(xy * (1.0 + 0.01 * key), config)) for key in range(ALIKE))
    query, budget = SE2(5.0, 3.0, 0.7).apply(xy), Watched(DEADLINE)
    began = time.monotonic()
    found = recognizer.locate(query, budget=budget)
    took = time.monotonic() - began
    return {
        "landmarks": size,
        "describe": described,
        "query": took,
        "describe_query": found.stages[0].milliseconds / 1e3,
        "silence": budget.silence,
        "verdict": found.verdict,
        "reason": found.reason,
        "megabytes": memory()["most"] - before,
    }
