"""Few trees: an observation of a handful of trees among hundreds of submaps of the paper's forest."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.pool import Pool
from benchmarks.robust.known_places import (
    STRICT,
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

TREES: Final = (5, 6, 8, 10, 12, 16)
"""Trees of a query: those nearest to the sensor."""
SETTINGS: Final = ((0.1, 0.95), (0.2, 0.9), (0.4, 0.8))
"""Noise of each coordinate, metres, and the share of trees that is seen."""
CELLS: Final = tuple(product(TREES, SETTINGS))
SIDE: Final = 1000.0
STEP: Final = 50.0
"""Metres between submaps."""
RANGE: Final = 45.0
"""Metres that a submap reaches; neighbours overlap, as they do on a drive."""
STORED: Final = Sensor(RANGE, sigma=0.1, detection=0.95)


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All cells."""
    inside, outside = (12, 12) if quick else (100, 300)
    jobs = [AskedPart(cell, seed, inside, outside) for cell in range(len(CELLS))]
    results = pool.map(run_cell, jobs, "few trees")
    figures = figures_of(results)
    for summary, answers in zip(figures["summaries"], results, strict=True):
        summary["first"] = int((answers["inside"] & answers["right"]).sum())
    about = {"cells": [[trees, *setting] for trees, setting in CELLS], "submaps": len(_world(seed)[0].places)}
    return about | figures


def run_cell(job: AskedPart) -> NDArray[Any]:
    """Answers about one cell."""
    return gather(question.ask() for question in questions(job))


def questions(job: AskedPart) -> Iterator[AskedQuery]:
    """What is asked in one cell: places in the database, then places in another forest."""
    trees, (sigma, detection) = CELLS[job.part]
    world, forests = _world(job.seed)
    rng = np.random.default_rng([job.seed, 11, job.part])
    sensor = Sensor(RANGE, sigma=sigma, detection=detection)
    for count, ground in ((job.inside, 0), (job.outside, None)):
        for _ in range(count):
            pose = SE2(*rng.uniform((STEP, STEP, -np.pi), (SIDE - STEP, SIDE - STEP, np.pi)).tolist())
            xy = observe(forests[0 if ground == 0 else 1], pose, sensor, rng).xy
            yield AskedQuery(world, xy[np.argsort((xy**2).sum(axis=1))[:trees]], ground, pose)


@lru_cache(maxsize=2)
def _world(seed: int) -> tuple[RobustWorld, tuple[Points, Points]]:
    """The database, and the forests: the one that is stored, and another."""
    config = Config()
    warm_up(config)
    rng = np.random.default_rng([seed, 12])
    stored, other = paper_forest(rng, SIDE), paper_forest(rng, SIDE)
    centres = np.arange(STEP, SIDE - STEP + 1.0, STEP).tolist()
    poses = [SE2(x, y, rng.uniform(-np.pi, np.pi)) for x, y in product(centres, centres)]
    places = [TruePlace(observe(stored, pose, STORED, rng).xy, 0, pose) for pose in poses]
    return RobustWorld(places, config, STRICT), (stored, other)
