"""The paper's Table I with any rotation: F1 and milliseconds a pair, the default method beside its peers."""

import time
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.attempts import MINIMA, attempt
from benchmarks.paper.drive import CELLS, PER_LAP, ROTATIONS, Drive, drive
from benchmarks.paper.methods import Glarot, Li, Method, Paper
from benchmarks.paper.table1 import best_minimum, f1
from benchmarks.pool import Pool
from benchmarks.robust.known_places import MATCHED, PAPER, RobustWorld, TruePlace, gather
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.scores import Outcomes, score

PEERS: Final = ("paper", "glarot-local", "li")
"""As `benchmarks.paper` has them; a report counts where the same verification lets the transform pass."""


@dataclass(frozen=True, slots=True)
class Job:
    """One drive in one cell; with the peers or without."""

    per_lap: int
    seed: int
    cell: int
    peers: bool


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Answers about all pairs, which of them are near (P,), and for each peer its counts by minimum and its time."""

    answers: NDArray[Any]
    positive: NDArray[np.bool_]
    counts: dict[str, NDArray[np.int64]]
    milliseconds: dict[str, float]


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Three drives through each cell, the peers on the first of them."""
    per_lap, seeds = (5, (seed,)) if quick else (PER_LAP, (seed, seed + 1, seed + 2))
    jobs = [Job(per_lap, s, cell, s == seed) for s in seeds for cell in range(len(CELLS))]
    results = pool.map(run_cell, jobs, "Table I")
    cells: list[dict[str, Any]] = []
    for cell in range(len(CELLS)):
        found = [result for job, result in zip(jobs, results, strict=True) if job.cell == cell]
        outcomes = [outcome(result) for result in found]
        first = found[0].answers
        cells.append(
            {
                "cell": list(CELLS[cell]),
                "f1_by_seed": [one.f1 for one in outcomes],
                "wrong": sum(one.false_positives for one in outcomes),
                "missed": sum(one.false_negatives for one in outcomes),
                "right": sum(one.true_positives for one in outcomes),
                "milliseconds": float(np.median(np.concatenate([one.answers["milliseconds"] for one in found]))),
                "milliseconds_first": float(np.median(first["milliseconds"])),
            }
        )
    with_peers = [result for job, result in zip(jobs, results, strict=True) if job.peers]
    peers: dict[str, Any] = {}
    for name in PEERS:
        table = np.stack([result.counts[name] for result in with_peers])
        counts = {"counts": table.transpose(1, 0, 2).tolist()}
        best = best_minimum(counts)
        peers[name] = {
            "minimum": MINIMA["verified"][best],
            "f1": f1(table[:, best]).tolist(),
            "milliseconds": [result.milliseconds[name] for result in with_peers],
        }
    return {
        "per_lap": per_lap,
        "seeds": list(seeds),
        "pairs": len(results[0].answers),
        "cells": cells,
        "peers": peers,
        "answers": np.concatenate([result.answers for result in results]),
    }


def run_cell(job: Job) -> Result:
    """Every pair of one drive; the second observation asks about the first."""
    config = Config()
    warm_up(config)
    driven = drive(job.per_lap, job.seed, *CELLS[job.cell], ROTATIONS["full"])
    answers = ask_pairs(driven, config)
    counts, milliseconds = {}, {}
    if job.peers:
        rng = np.random.default_rng([job.seed, 3, job.cell])
        methods: tuple[Method, ...] = (Paper(config), Glarot(), Li())
        for method in methods:
            start = time.perf_counter()
            attempts = attempt(driven, method, config, rng)
            spent = 1e3 * (time.perf_counter() - start) / len(driven.first) / len(attempts)
            for name in set(attempts) & set(PEERS):
                rows = [attempts[name].outcomes(driven.positive, "verified", least) for least in MINIMA["verified"]]
                counts[name] = np.array([(o.true_positives, o.false_positives, o.false_negatives) for o in rows])
                milliseconds[name] = spent
    return Result(answers, driven.positive, counts, milliseconds)


def ask_pairs(driven: Drive, config: Config) -> NDArray[Any]:
    """An answer (`worlds.ANSWER`) for each pair of a drive, each first observation a collection of its own."""
    worlds = [RobustWorld([TruePlace(o.xy, 0, o.pose)], config, PAPER) for o in driven.observations]
    rows = []
    for i, j, near in zip(driven.first.tolist(), driven.second.tolist(), driven.positive.tolist(), strict=True):
        seen = driven.observations[j]
        row = worlds[i].ask(seen.xy, 0, SE2(seen.pose.x, seen.pose.y, seen.pose.yaw), oracle=False)
        row["inside"] = near or row["right"]
        rows.append(row)
    return gather(rows)


def outcome(result: Result) -> Outcomes:
    """Right, wrong and missed pairs, as the paper counts them."""
    matched = result.answers["verdict"] == MATCHED
    return score(matched, result.answers["right"], result.positive)
