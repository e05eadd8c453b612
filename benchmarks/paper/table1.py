"""Table I: F1 of every method in the 20 cells of noise and detection, for both ranges of rotation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.attempts import MINIMA, SCORINGS, Attempts, Scoring, ask, attempt
from benchmarks.paper.drive import CELLS, PER_LAP, ROTATIONS, Drive, drive
from benchmarks.paper.methods import LETTER_TAU, Glarot, Li, Method, Paper, Robust
from benchmarks.pool import Pool
from urquhart import Config
from urquhart.evaluation.scores import Outcomes, score

GATES: Final = (0.05, 0.06, 0.07, 0.08, 0.1, 0.12)
"""Largest GLAROT distance of two whole observations, as a share of what they hold. The paper's 10 is in units of its
own; whichever of these serves best over all cells is shown."""
BINS: Final = tuple(range(0, 110, 10))
"""Metres between the poses: recall is also counted by distance."""

Counts = NDArray[np.int64]
"""(minima, 3): true positives, false positives, false negatives for each minimum of a scoring."""


@dataclass(frozen=True, slots=True)
class Job:
    """One drive: every method, one cell."""

    per_lap: int
    seed: int
    cell: int
    rotation: str


@dataclass(frozen=True, slots=True)
class CellResult:
    """Counts by method and scoring, right reports by method and distance, pairs by distance, pairs, positive pairs."""

    counts: dict[str, dict[str, Counts]]
    found: dict[str, NDArray[np.int64]]
    pairs_by_distance: NDArray[np.int64]
    pairs: int
    positive: int


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All cells, all methods, both rotation ranges."""
    per_lap, seeds = (5, (seed,)) if quick else (PER_LAP, (seed, seed + 1, seed + 2))
    jobs = [Job(per_lap, s, cell, name) for name in ROTATIONS for s in seeds for cell in range(len(CELLS))]
    results = pool.map(run_cell, jobs, "Table I")
    figures: dict[str, Any] = {
        "cells": [list(cell) for cell in CELLS],
        "minima": {scoring: list(MINIMA[scoring]) for scoring in SCORINGS},
        "per_lap": per_lap,
        "seeds": list(seeds),
        "pairs": results[0].pairs,
        "positive": float(np.mean([result.positive for result in results])),
        "bins": list(BINS),
        "rotations": {},
    }
    for rotation in ROTATIONS:
        chosen = [(job, result) for job, result in zip(jobs, results, strict=True) if job.rotation == rotation]
        figures["rotations"][rotation] = _gather(chosen, seeds)
    return figures


def run_cell(job: Job) -> CellResult:
    """Drive once and try every method on every pair."""
    config = Config()
    driven = drive(job.per_lap, job.seed, *CELLS[job.cell], ROTATIONS[job.rotation])
    rng = np.random.default_rng([job.seed, 3, job.cell])
    counts: dict[str, dict[str, Counts]] = {}
    found: dict[str, NDArray[np.int64]] = {}
    as_printed = Paper(replace(config, tau=LETTER_TAU), "paper-letter")
    methods: tuple[Method, ...] = (Paper(config), as_printed, Glarot(), Li())
    for method in methods:
        for name, attempts in attempt(driven, method, config, rng).items():
            counts[name] = count(attempts, driven)
            reported = (attempts.correspondences >= config.correspondences) & attempts.accepted
            found[name] = _by_distance(driven, reported & attempts.verified_right)
            if name == "glarot":
                for gate in GATES:
                    gated = count(attempts, driven, gate)
                    counts[f"glarot@{gate:g}"] = {"letter": gated["letter"], "verified": gated["verified"]}
    matched, right = ask(driven, Robust(config))
    counts["robust"] = {"verdict": _row(score(matched, right, driven.positive))[None]}
    found["robust"] = _by_distance(driven, matched & right)
    everything = np.ones(len(driven.apart), np.bool_)
    return CellResult(counts, found, _by_distance(driven, everything), len(driven.apart), int(driven.positive.sum()))


def count(attempts: Attempts, driven: Drive, gate: float = np.inf) -> dict[str, Counts]:
    """Counts for every scoring and every minimum."""

    def one(scoring: Scoring, minimum: int) -> Counts:
        return _row(attempts.outcomes(driven.positive, scoring, minimum, gate))

    return {scoring: np.array([one(scoring, minimum) for minimum in MINIMA[scoring]]) for scoring in SCORINGS}


def f1(counts: Any) -> NDArray[np.float64]:
    """F1 (...) of counts (..., 3)."""
    right, wrong, missed = np.moveaxis(np.asarray(counts, np.float64), -1, 0)
    return np.asarray(2.0 * right / np.maximum(2.0 * right + wrong + missed, 1.0))


def best_minimum(scoring: Mapping[str, Any]) -> int:
    """Position of the minimum with the highest mean F1 over the cells: one for all of them."""
    return int(np.argmax(f1(scoring["counts"]).mean(axis=1)))


def _gather(chosen: Sequence[tuple[Job, CellResult]], seeds: Sequence[int]) -> dict[str, Any]:
    """For each method and scoring: counts (minima, cells, 3) over all seeds, and mean F1 by seed (seeds, minima)."""
    methods: dict[str, Any] = {}
    first = chosen[0][1]
    for name, scorings in first.counts.items():
        methods[name] = {}
        for scoring in scorings:
            table = np.zeros((len(seeds), len(CELLS), *scorings[scoring].shape), np.int64)
            for job, result in chosen:
                table[seeds.index(job.seed), job.cell] = result.counts[name][scoring]
            methods[name][scoring] = {
                "counts": table.sum(axis=0).transpose(1, 0, 2).tolist(),
                "mean_by_seed": f1(table).mean(axis=1).tolist(),
            }
    pairs = sum(result.pairs_by_distance for _, result in chosen)
    by_distance = {
        name: (sum(result.found[name] for _, result in chosen) / np.maximum(pairs, 1)).tolist() for name in first.found
    }
    return {"methods": methods, "recall_by_distance": by_distance}


def _row(outcomes: Outcomes) -> Counts:
    return np.array([outcomes.true_positives, outcomes.false_positives, outcomes.false_negatives])


def _by_distance(driven: Drive, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.histogram(driven.apart[chosen], BINS)[0].astype(np.int64)
