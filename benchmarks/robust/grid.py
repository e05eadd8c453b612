"""The extended grid: noise, detection and clutter far beyond the paper's, beside an oracle that knows the pose."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.pool import Pool
from benchmarks.robust.known_places import (
    PAPER,
    AskedPart,
    AskedQuery,
    Points,
    RobustWorld,
    TruePlace,
    figures_of,
    gather,
)
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.simulation import Sensor, observe, paper_forest

SIGMAS: Final = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Metres, each coordinate of each of the two observations."""
DETECTIONS: Final = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
CLUTTERS: Final = (0.0, 0.3, 1.0)
"""False landmarks, as a share of the seen ones."""
CELLS: Final = tuple((s, d, c) for c in CLUTTERS for d in DETECTIONS for s in SIGMAS)
SENSOR: Final = 50.0
SIDE: Final = 1000.0


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All cells."""
    positive, negative = (12, 24) if quick else (200, 2000)
    jobs = [AskedPart(cell, seed, positive, negative) for cell in range(len(CELLS))]
    results = pool.map(run_cell, jobs, "extended grid")
    about = {"cells": [list(cell) for cell in CELLS], "positive": positive, "negative": negative}
    return about | figures_of(results)


def run_cell(job: AskedPart) -> NDArray[Any]:
    """Answers about every pair of one cell."""
    return gather(question.ask() for question in questions(job))


def questions(job: AskedPart) -> Iterator[AskedQuery]:
    """Every pair of one cell, each submap a collection of its own: those of the same place, then the others."""
    sigma, detection, clutter = CELLS[job.part]
    config, trees = Config(), _forest(job.seed)
    rng = np.random.default_rng([job.seed, 5, job.part])

    def look(pose: SE2) -> Points:
        return observe(trees, pose, Sensor(SENSOR, sigma=sigma, detection=detection, clutter=clutter), rng).xy

    worlds, queries = [], []
    for _ in range(job.inside):
        here = SE2(*rng.uniform((120.0, 120.0, 0.0), (SIDE - 120.0, SIDE - 120.0, 2.0 * np.pi)).tolist())
        # Uniform over the disc of poses that count as the same place (the paper's 50 m).
        distance, bearing = SENSOR * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
        there = SE2(
            here.x + distance * np.cos(bearing), here.y + distance * np.sin(bearing), rng.uniform(0.0, 2.0 * np.pi)
        )
        worlds.append(RobustWorld([TruePlace(look(here), 0, here)], config, PAPER))
        queries.append((look(there), there))
    for world, (xy, pose) in zip(worlds, queries, strict=True):
        yield AskedQuery(world, xy, 0, pose)
    found = 0
    while found < job.outside:
        i, j = rng.integers(job.inside, size=2).tolist()
        xy, pose = queries[j]
        place = worlds[i].places[0].pose
        if np.hypot(place.x - pose.x, place.y - pose.y) > 2.0 * SENSOR:
            found += 1
            yield AskedQuery(worlds[i], xy, None, pose)


@lru_cache(maxsize=2)
def _forest(seed: int) -> Points:
    warm_up(Config())
    return paper_forest(np.random.default_rng([seed, 4]), SIDE)
