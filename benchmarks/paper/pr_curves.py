"""The paper's precision-recall curves: over tau, and over gamma, the bound on polygons per observation.

Precision and recall are averages over the 20 cells; a curve runs over the least number of correspondences.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from benchmarks.paper.attempts import MINIMA, attempt
from benchmarks.paper.drive import CELLS, PER_LAP, ROTATIONS, drive
from benchmarks.paper.methods import LETTER_TAU, Paper
from benchmarks.pool import Pool
from urquhart import Config
from urquhart.evaluation.scores import Outcomes, mean_outcome

TAUS: Final = (2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
GAMMAS: Final = (5, 10, 15, 20, None)


@dataclass(frozen=True, slots=True)
class Job:
    """One drive in one cell, several configurations."""

    per_lap: int
    seed: int
    cell: int
    configs: tuple[Config, ...]


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Both sweeps."""
    per_lap, seeds = (5, (seed,)) if quick else (PER_LAP, (seed, seed + 1, seed + 2))
    taus, gammas = (TAUS[1:4], GAMMAS[1::3]) if quick else (TAUS, GAMMAS)
    configs = (*(Config(tau=tau) for tau in taus), *(Config(tau=LETTER_TAU, gamma=gamma) for gamma in gammas))
    jobs = [Job(per_lap, s, cell, configs) for s in seeds for cell in range(len(CELLS))]
    results = pool.map(run_cell, jobs, "PR curves")
    curves = []
    for c, config in enumerate(configs):
        points = []
        for m, minimum in enumerate(MINIMA["letter"]):
            cells: list[Outcomes] = []
            for cell in range(len(CELLS)):
                parts = [r[c][m] for job, r in zip(jobs, results, strict=True) if job.cell == cell]
                cells.append(sum(parts, Outcomes(0, 0, 0)))
            precision, recall, f1 = mean_outcome(cells)
            points.append({"minimum": minimum, "precision": precision, "recall": recall, "f1": f1})
        sweep = "tau" if c < len(taus) else "gamma"
        curves.append({"sweep": sweep, "tau": config.tau, "gamma": config.gamma, "points": points})
    return {"per_lap": per_lap, "seeds": list(seeds), "curves": curves}


def run_cell(job: Job) -> list[list[Outcomes]]:
    """Outcomes of each configuration at each minimum, scored as in the letter."""
    driven = drive(job.per_lap, job.seed, *CELLS[job.cell], ROTATIONS["full"])
    table = []
    for config in job.configs:
        (attempts,) = attempt(driven, Paper(config), config, np.random.default_rng([job.seed, 4, job.cell])).values()
        table.append([attempts.outcomes(driven.positive, "letter", m) for m in MINIMA["letter"]])
    return table
