"""Poses of drives that go on: what is taken in at once, how long it takes, and how far a search of all is from it."""

import time
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.maps.graphs import GraphJob, simulate
from benchmarks.pool import Pool
from urquhart.mapping.online.session_poses import CurrentPoses, GrowingPoses
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_arrays import compose, inverse, wrapped
from urquhart.mapping.pose_graph import PoseConstraints

SIZES: Final = ((120, 60, 3), (1000, 60, 1))
"""Submaps of a drive, those of them that come one by one, and drives."""
DRIFTS: Final = (0.03,)
FALSE: Final = ((0.0, False), (0.3, False), (0.3, True))


@dataclass(frozen=True, slots=True)
class OnlineJob:
    """A drive, and how many of its submaps come one by one."""

    drive: GraphJob
    coming: int


def run_job(job: OnlineJob) -> dict[str, Any]:
    """Take in one submap after the other; search all constraints whenever that is due."""
    made, size = simulate(job.drive), job.drive.submaps
    last = np.maximum(made.constraints.first, made.constraints.second)
    order = np.argsort(last, kind="stable")
    given, last, false = _some(made.constraints, order), last[order], made.false[order]

    def searched(count: int) -> tuple[GrowingPoses, OptimisedPoses]:
        some = _some(given, last < count)
        found = optimise(count, some)
        return GrowingPoses(count, some, found), found

    (growing, _), seconds, searches = searched(size - job.coming), list[float](), 0
    now = growing.current()
    for submap in range(size - job.coming, size):
        now, spent = _timed(growing, submap + 1, _some(given, last == submap))
        seconds.append(spent)
        if now.search_due and submap + 1 < size:
            (growing, _), searches = searched(submap + 1), searches + 1
    _, whole = searched(size)
    used = np.array([standing == "used" for standing in now.standings])
    pending = np.array([standing == "pending" for standing in now.standings])
    truth = compose(inverse(made.truth[:1]).repeat(size, axis=0), made.truth)
    return {
        "loops": float((~given.trusted).sum()),
        "false": float(false.sum()),
        "false_used": float((false & used).sum()),
        "right_unused": float((~false & ~used & ~pending).sum()),
        "pending": float(pending.sum()),
        "searches": float(searches),
        "apart": float(np.hypot(*_off(now.poses, whole.poses)[:, :2].T).max()),
        "error": float(np.hypot(*_off(now.poses, truth)[:, :2].T).mean()),
        "seconds": seconds,
    }


def _timed(growing: GrowingPoses, count: int, more: PoseConstraints) -> tuple[CurrentPoses, float]:
    began = time.perf_counter()
    growing.add(count, more)
    now = growing.current()
    return now, time.perf_counter() - began


def _some(given: PoseConstraints, which: NDArray[np.bool_] | NDArray[np.int64]) -> PoseConstraints:
    return PoseConstraints(*(getattr(given, name)[which] for name in given.__slots__))


def _off(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    off = one - other
    off[:, 2] = wrapped(off[:, 2])
    return off


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every size and drift, without false loops and with them, alone and in groups."""
    cells = [(size, drift, *false) for size in (SIZES[:1] if quick else SIZES) for drift in DRIFTS for false in FALSE]
    jobs = [
        OnlineJob(GraphJob(size[0], drift, false, grouped, seed + k), size[1])
        for size, drift, false, grouped in cells
        for k in range(1 if quick else size[2])
    ]
    results = pool.map(run_job, jobs, "drives that go on")
    rows = []
    for size, drift, false, grouped in cells:
        key = (size[0], drift, false, grouped)
        some = [
            result
            for job, result in zip(jobs, results, strict=True)
            if (job.drive.submaps, job.drive.drift, job.drive.false, job.drive.grouped) == key
        ]
        row: dict[str, Any] = {"submaps": size[0], "coming": size[1], "drift": drift, "share": false}
        row |= {"grouped": grouped, "drives": len(some)}
        for name in ("loops", "false", "false_used", "right_unused", "pending", "searches"):
            row[name] = sum(one[name] for one in some)
        seconds = np.concatenate([one["seconds"] for one in some])
        row |= {"median": float(np.median(seconds)), "p95": float(np.quantile(seconds, 0.95))}
        row |= {"worst": float(seconds.max()), "apart": max(one["apart"] for one in some)}
        rows.append(row | {"error": float(np.mean([one["error"] for one in some]))})
    return {"rows": rows}
