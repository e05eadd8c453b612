"""Odometry that lies: drives in which one step of odometry is far off, and what the map makes of it."""

import time
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from benchmarks.maps.graphs import GraphJob, simulate
from benchmarks.pool import Pool
from urquhart.mapping.optimisation import optimise
from urquhart.mapping.pose_arrays import compose, inverse

LIES: Final = {"slips by 4.5 m": (4.0, 2.0, 0.0), "turns by 29 degrees": (0.0, 0.0, 0.5)}
SUBMAPS: Final = 120
DRIFTS: Final = (0.01, 0.03, 0.05)


@dataclass(frozen=True, slots=True)
class LieJob:
    """A drive, and by which of `LIES` one random step of its odometry is off."""

    drive: GraphJob
    lie: str | None


def run_job(job: LieJob) -> dict[str, float]:
    """Optimise one drive."""
    made = simulate(job.drive)
    given, submaps = made.constraints, job.drive.submaps
    edge = int(np.random.default_rng([7, job.drive.seed]).integers(0, submaps - 1))
    if job.lie is not None:
        poses = given.poses.copy()
        poses[edge : edge + 1] = compose(poses[edge : edge + 1], np.array([LIES[job.lie]]))
        given = replace(given, poses=poses)
    began = time.perf_counter()
    found = optimise(submaps, given)
    seconds = time.perf_counter() - began
    refused = np.array([reason is not None for reason in found.refusals])
    out = np.flatnonzero(refused & given.trusted).tolist()
    right = ~made.false & ~given.trusted
    truth = compose(inverse(made.truth[:1]).repeat(submaps, axis=0), made.truth)
    wrong = [] if job.lie is None else [edge]
    return {
        "refused": float(out == wrong != []),
        "said": float(out != wrong and any(set(wrong) & {*one.edges} for one in found.contradictions)),
        "right_odometry": float(len(set(out) - set(wrong))),
        "doubted": float(sum(one.outcome == "undecided" for one in found.contradictions)),
        "false_kept": float((made.false & ~refused).sum()),
        "false": float(made.false.sum()),
        "right_refused": float((right & refused).sum()),
        "right": float(right.sum()),
        "error": float(np.hypot(*(found.poses - truth)[:, :2].T).mean()),
        "seconds": seconds,
    }


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """No lie and each lie, without false loops and with them, alone and in groups."""
    kinds = [(0.0, False), (0.3, False), (0.3, True)]
    cells = [(lie, false, grouped) for lie in (None, *LIES) for false, grouped in kinds]
    jobs = [
        LieJob(GraphJob(SUBMAPS, drift, false, grouped, seed + k), lie)
        for lie, false, grouped in cells
        for drift in DRIFTS
        for k in range(2 if quick else 20)
    ]
    results = pool.map(run_job, jobs, "odometry")
    rows = []
    for cell in cells:
        some = [
            result
            for job, result in zip(jobs, results, strict=True)
            if (job.lie, job.drive.false, job.drive.grouped) == cell
        ]
        row: dict[str, Any] = {"lie": cell[0], "share": cell[1], "grouped": cell[2], "drives": len(some)}
        row |= {name: sum(one[name] for one in some) for name in some[0] if name not in ("error", "seconds")}
        row |= {name: float(np.mean([one[name] for one in some])) for name in ("error", "seconds")}
        rows.append(row)
    return {"rows": rows}
