"""Plantations: trees in rows, where every wrong pose looks good."""

from collections.abc import Iterator
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
from urquhart.evaluation.simulation import Sensor, observe, plantation

SPACINGS: Final = ((3.0, 3.0), (2.5, 3.5))
"""Metres between the trees of a row, and between rows."""
JITTERS: Final = (0.15, 0.3, 0.4)
SURVIVALS: Final = (0.8, 0.95)
SIGMAS: Final = (0.05, 0.1, 0.2)
KINDS: Final = tuple(product(SPACINGS, JITTERS, SURVIVALS, SIGMAS))
RADII: Final = (15.0, 25.0)
"""Metres: each place and each query has a range of its own in between."""
DETECTION: Final = 0.95
SIDE: Final = 120.0
"""Metres: side of the mapped area; the stand goes on beyond it for the same again."""
STEP: Final = 20.0
"""Metres between submaps."""


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All kinds."""
    inside, outside = (6, 12) if quick else (100, 280)
    jobs = [AskedPart(kind, seed, inside, outside) for kind in range(len(KINDS))]
    results = pool.map(run_kind, jobs, "plantations")
    kinds = [[list(spacing), jitter, survival, sigma] for spacing, jitter, survival, sigma in KINDS]
    return {"kinds": kinds} | figures_of(results)


def run_kind(job: AskedPart) -> NDArray[Any]:
    """Answers about one kind."""
    return gather(question.ask() for question in questions(job))


def questions(job: AskedPart) -> Iterator[AskedQuery]:
    """What is asked about one kind: places in the database, then others.

    Half of the places that are not in the database lie further down the same rows, half in another stand that was
    planted alike.
    """
    spacing, jitter, survival, sigma = KINDS[job.part]
    config = Config()
    warm_up(config)
    rng = np.random.default_rng([job.seed, 6, job.part])
    mapped, other = (
        plantation(2.0 * SIDE + 60.0, SIDE, rng, spacing=spacing, jitter=jitter, survival=survival) for _ in range(2)
    )

    def look(trees: Points, pose: SE2) -> Points:
        return observe(trees, pose, Sensor(rng.uniform(*RADII), sigma=sigma, detection=DETECTION), rng).xy

    def pose(low: float, high: float) -> SE2:
        x, y, yaw = rng.uniform((low, RADII[0], -np.pi), (high, SIDE - RADII[0], np.pi)).tolist()
        return SE2(x, y, yaw)

    centres = np.arange(RADII[0], SIDE - RADII[0] + 1.0, STEP)
    places = []
    for x, y in product(centres.tolist(), centres.tolist()):
        at = SE2(x, y, rng.uniform(-np.pi, np.pi))
        places.append(TruePlace(look(mapped, at), 0, at))
    world = RobustWorld(places, config, STRICT)
    for _ in range(job.inside):
        at = pose(RADII[0], SIDE - RADII[0])
        yield AskedQuery(world, look(mapped, at), 0, at)
    for k in range(job.outside):
        # No tree of these was in view of any submap.
        at = pose(SIDE + 2.0 * RADII[1] - RADII[0], 2.0 * SIDE + 60.0 - RADII[1])
        yield AskedQuery(world, look(mapped if k % 2 else other, at), None, at)
