"""Drives through simulated forests and plantations, matched as the service does, without any odometry."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.maps.matching import KnownSubmap, map_figures, match_all
from benchmarks.pool import Pool
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation

SIDE: Final = 130.0
"""Metres: side of the stand."""
SENSOR: Final = Sensor(25.0, sigma=0.1, detection=0.9, clutter=0.02)
STEP: Final = 12.0
"""Metres between submaps."""
LANE: Final = 20.0
"""Metres between lanes."""
STANDS: Final = {
    "the paper's forest": None,
    "rows 3 x 3 m, jitter 0.3 m": (0.3, 0.9),
    "rows 3 x 3 m, jitter 0.15 m": (0.15, 0.95),
}
"""Jitter of planting (metres) and share of trees that survived; None for the paper's forest."""


@dataclass(frozen=True, slots=True)
class StandJob:
    """One drive through one stand."""

    stand: str
    seed: int


def run_job(job: StandJob) -> dict[str, float]:
    """Drive, match, map."""
    rng = np.random.default_rng([job.seed, 11, list(STANDS).index(job.stand)])
    planted = STANDS[job.stand]
    trees = (
        paper_forest(rng, SIDE)
        if planted is None
        else plantation(SIDE, SIDE, rng, jitter=planted[0], survival=planted[1])
    )
    submaps = []
    for x, y in drive(rng).tolist():
        seen = observe(trees, SE2(x, y, float(rng.uniform(-np.pi, np.pi))), SENSOR, rng)
        submaps.append(KnownSubmap(seen.xy, seen.trees, seen.pose))
    figures, _ = map_figures(submaps, match_all(submaps))
    return figures


def drive(rng: np.random.Generator) -> NDArray[np.float64]:
    """Positions (S, 2), metres: lanes up and down the stand."""
    margin = SENSOR.radius
    along, across = np.arange(margin, SIDE - margin + 1e-9, STEP), np.arange(margin, SIDE - margin + 1e-9, LANE)
    lanes = [np.column_stack([np.full(len(along), x), along[:: 1 - 2 * (k % 2)]]) for k, x in enumerate(across)]
    positions = np.concatenate(lanes)
    return np.asarray(positions + rng.normal(0.0, 1.0, positions.shape))


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every stand, many drives."""
    counts = dict.fromkeys(STANDS, 3) if quick else dict(zip(STANDS, (10, 100, 20), strict=True))
    jobs = [StandJob(name, seed + k) for name, count in counts.items() for k in range(count)]
    results = pool.map(run_job, jobs, "stands")
    rows = {}
    for name in STANDS:
        some = [result for job, result in zip(jobs, results, strict=True) if job.stand == name]
        row = {key: sum(one[key] for one in some) for key in some[0] if key not in ("error", "scale")}
        row |= {"drives": len(some), "folded": sum(one["false_kept"] > 0 for one in some)}
        row |= {"error": float(np.mean([one["error"] for one in some])), "worst": max(one["error"] for one in some)}
        rows[name] = row | {"scale": float(np.median([one["scale"] for one in some]))}
    return {"stands": rows}
