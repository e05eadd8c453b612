"""Table II by maps: tracks through real stem maps, every submap matched with every other, optimised together."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.maps.matching import KnownSubmap, map_figures, match_all
from benchmarks.paper.table2 import OFF, judge
from benchmarks.paper.tracks import LEVELS, MAPS, cut, read_maps
from benchmarks.pool import Pool


@dataclass(frozen=True, slots=True)
class TrackJob:
    """One track through one file of a map at one level of noise."""

    level: str
    name: str
    part: int
    seed: int


def run_job(job: TrackJob) -> dict[str, Any]:
    """Match and map one track, and judge its steps as Table II does."""
    maps, _ = read_maps((job.name,))
    submaps = cut(maps[job.name][job.part], *LEVELS[job.level], np.random.default_rng([job.seed, 7, job.part]))
    rng = np.random.default_rng([job.seed, 8, job.part])
    known = [KnownSubmap(one.xy, one.trees, one.pose) for one in submaps]
    matched = match_all(known)
    figures, poses = map_figures(known, matched)
    paper, _ = map_figures(known, matched, "dbscan")
    errors, reference, right = [], [], 0
    for k, (before, after) in enumerate(pairwise(submaps)):
        if poses.part[k] == poses.part[k + 1]:
            step = judge(before, after, poses.pose(k).inverse() @ poses.pose(k + 1), rng)
            errors.append(step.errors)
            reference.append(step.reference)
            right += bool(step.errors.mean() < OFF)
    return figures | {
        "steps": len(submaps) - 1,
        "right": right,
        "errors": np.concatenate([np.empty(0), *errors]),
        "reference": np.concatenate([np.empty(0), *reference]),
        "dbscan_doubled": paper["doubled"],
        "dbscan_mixed": paper["mixed"],
    }


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every map that is there, at both levels of noise."""
    maps, missing = read_maps(("lansing",) if quick else tuple(MAPS))
    seeds = (seed,) if quick else (seed, seed + 1, seed + 2)
    jobs = [
        TrackJob(level, name, part, one)
        for level in LEVELS
        for name, parts in maps.items()
        for part in range(len(parts))
        for one in seeds
    ]
    results = pool.map(run_job, jobs, "Table II")
    rows = []
    for level in LEVELS:
        for name in maps:
            asked = (level, name)
            some = [r for job, r in zip(jobs, results, strict=True) if (job.level, job.name) == asked]
            row: dict[str, Any] = {"level": level, "map": name}
            for key in (
                "steps",
                "right",
                "false",
                "false_kept",
                "trees",
                "doubled",
                "lost",
                "mixed",
                "dbscan_doubled",
                "dbscan_mixed",
            ):
                row[key] = float(sum(one[key] for one in some))
            for key in ("errors", "reference"):
                row[key] = float(np.mean(np.concatenate([one[key] for one in some])))
            rows.append(row)
    return {"tracks": rows, "missing": missing}
