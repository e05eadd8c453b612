"""What the paper leaves open, each choice with tau found again for it, because most of them change what tau means.

Three figures a configuration, each over the 20 cells:

    letter       mean F1 over pairs, scored as in the letter, at its best minimum of correspondences
    verified     mean F1 over pairs, scored by all-landmark verification
    collection   share of observations that `method="paper"` finds, and places right, among 361 submaps

The defaults are those with the best mean of the last two: what the mode is used for is looking observations up, one
against one and in a collection. Pairs alone would like any tau, however large, because verification forgives it; in a
collection the votes drown.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.everyday import Forest
from benchmarks.paper.attempts import MINIMA, attempt
from benchmarks.paper.drive import CELLS, PER_LAP, ROTATIONS, SIDE, drive
from benchmarks.paper.methods import Glarot, Method, Paper
from benchmarks.paper.table1 import count, f1
from benchmarks.pool import Pool
from urquhart import SE2, Config, Recognition, Recognizer, describe
from urquhart.evaluation.scores import ROTATION, TRANSLATION
from urquhart.paper.glarot import GlarotConfig

SHARES: Final = (0.25, 0.3, 0.35, 0.4, 0.5, 0.75)
"""Values of tau as shares of M: descriptors, and so their distances, grow with the number of samples. 0.4 M is 8 for
M = 20. Times `SQUARED` for squared distances."""
FEWER: Final = (0.3, 0.35, 0.4, 0.5)
"""Values tried for everything but the default M: the best lies among them."""
SQUARED: Final = 12.5
"""Metres: about what turns a difference of distances into one of their squares, twice the polygons' radius."""
SAMPLES: Final = (10, 20, 32, 64)
WINDOWS: Final = (0, 1, 16)
"""Largest difference in vertex count, beside the letter's 3; 16 is no gate at all."""


GLARES: Final = {
    "30 m": GlarotConfig(),
    "30 m, no spread": GlarotConfig(direction_spread=0.0, distance_spread=0.0),
    "50 m": GlarotConfig(reach=50.0),
    "50 m, no spread": GlarotConfig(reach=50.0, direction_spread=0.0, distance_spread=0.0),
    "100 m, no spread": GlarotConfig(reach=100.0, direction_spread=0.0, distance_spread=0.0),
}
"""What the paper does not say of its GLAROT: how far GLARE looks, and whether a landmark counts in more than one
bin."""


@dataclass(frozen=True, slots=True)
class Variation:
    """A configuration and the table it belongs in."""

    group: str
    label: str
    config: Config


@dataclass(frozen=True, slots=True)
class PairsJob:
    """One drive in one cell with one method."""

    per_lap: int
    seed: int
    cell: int
    method: Method


@dataclass(frozen=True, slots=True)
class CollectionJob:
    """One collection with one configuration, asked `queries` times in each cell."""

    side: float
    seed: int
    queries: int
    config: Config


def variations(quick: bool) -> list[Variation]:
    """Everything that is tried, each configuration once."""
    shares, fewer, samples = (FEWER[::2], FEWER[::2], SAMPLES[1:2]) if quick else (SHARES, FEWER, SAMPLES)
    found: dict[Config, Variation] = {}

    def add(group: str, label: str, config: Config) -> None:
        found.setdefault(config, Variation(group, label, config))

    for m in samples:
        for squared in (False, True):
            for share in shares if m == 20 else fewer:
                tau = round(share * m * (SQUARED if squared else 1.0), 2)
                kind = "squared" if squared else "plain"
                add("distance", f"{kind}, M = {m}", Config(samples=m, squared=squared, tau=tau))
    for share in fewer:
        plain = Config(samples=20, squared=False, tau=round(20 * share, 2))
        add("hull", "hull kept", replace(plain, keep_hull=True))
        for window in WINDOWS:
            label = "no gate" if window == 16 else f"|dn| <= {window}"
            add("vertex count", label, replace(plain, vertex_window=window))
    return list(found.values())


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Every variation over pairs and in a collection."""
    per_lap, side, queries = (5, 400.0, 2) if quick else (PER_LAP, SIDE, 15)
    tried, cells = variations(quick), range(len(CELLS))
    pairs = [PairsJob(per_lap, seed, cell, Paper(v.config)) for v in tried for cell in cells]
    outcomes = pool.map(run_pairs, pairs, "Ablation, pairs")
    # A table of distances is dear and the differences are large: fewer pairs will do.
    glares = list(GLARES)[:2] if quick else list(GLARES)
    few = [PairsJob(4 if quick else 7, seed, cell, Glarot(GLARES[name])) for name in glares for cell in cells]
    by_glare = pool.map(run_pairs, few, "Ablation, GLARE")
    asked = pool.map(
        run_collection, [CollectionJob(side, seed, queries, v.config) for v in tried], "Ablation, collection"
    )
    rows = []
    for i, (v, collection) in enumerate(zip(tried, asked, strict=True)):
        means = _means(outcomes[i * len(CELLS) : (i + 1) * len(CELLS)])["paper"]
        rows.append({"group": v.group, "label": v.label, "tau": v.config.tau} | collection | means)
    glare = {name: _means(by_glare[i * len(CELLS) : (i + 1) * len(CELLS)]) for i, name in enumerate(glares)}
    return {
        "per_lap": per_lap,
        "seeds": [seed],
        "queries": queries * len(CELLS),
        "minima": {scoring: list(minima) for scoring, minima in MINIMA.items()},
        "default": Config().to_dict(),
        "rows": rows,
        "glare": glare,
        "hull": _price_of_the_hull(pool, side, seed, queries),
    }


def run_pairs(job: PairsJob) -> dict[str, dict[str, NDArray[np.int64]]]:
    """Counts by variant of the method, scoring and minimum."""
    driven = drive(job.per_lap, job.seed, *CELLS[job.cell], ROTATIONS["full"])
    rng = np.random.default_rng([job.seed, 5, job.cell])
    return {name: count(a, driven) for name, a in attempt(driven, job.method, Config(), rng).items()}


def _means(cells: Sequence[Mapping[str, Mapping[str, NDArray[np.int64]]]]) -> dict[str, dict[str, list[float]]]:
    """Mean F1 over cells by variant, scoring and minimum."""
    return {
        name: {
            scoring: f1(np.stack([cell[name][scoring] for cell in cells])).mean(axis=0).tolist() for scoring in scorings
        }
        for name, scorings in cells[0].items()
    }


def run_collection(job: CollectionJob) -> dict[str, Any]:
    """Share of observations found and right, how many were matched and wrong, bytes and polygons a submap."""
    forest, seen = _world(job.side, job.seed, job.queries)
    features = [describe(xy, job.config) for xy in forest.submaps]
    recognizer = Recognizer(job.config)
    recognizer.add(enumerate(features))
    right = wrong = 0
    for pose, xy in seen:
        found = recognizer.locate(xy, limit=1, method="paper")
        good = _is_right(found, forest, pose)
        right, wrong = right + good, wrong + (found.verdict == "matched" and not good)
    return {
        "collection": right / len(seen),
        "collection_wrong": wrong,
        "submaps": len(features),
        "polygons": float(np.mean([len(f.tessellation) for f in features])),
        "bytes": float(np.mean([len(f.pack()) for f in features])),
    }


@lru_cache(maxsize=1)
def _world(side: float, seed: int, queries: int) -> tuple[Forest, list[tuple[SE2, NDArray[np.float64]]]]:
    """A forest cut into overlapping submaps, and observations of it, `queries` in each cell."""
    rng = np.random.default_rng([seed, 6])
    forest = Forest.grow(side, rng)
    return forest, [forest.look(rng, *cell) for cell in CELLS for _ in range(queries)]


def _price_of_the_hull(pool: Pool, side: float, seed: int, queries: int) -> dict[str, float]:
    """What keeping hull polygons is worth to the default method, and costs it: share found, ratio of query times."""
    forest, seen = _world(side, seed, queries)
    step = pool.alone("Ablation, price of the hull", len(seen))
    recognizers = []
    for keep in (True, False):
        config = Config(keep_hull=keep)
        recognizers.append(Recognizer(config))
        recognizers[-1].add((key, describe(xy, config)) for key, xy in enumerate(forest.submaps))
    right, ratios = [0, 0], []
    for pose, xy in seen:
        spent = []
        for at, recognizer in enumerate(recognizers):
            started = time.perf_counter()
            found = recognizer.locate(xy, limit=1)
            spent.append(time.perf_counter() - started)
            right[at] += _is_right(found, forest, pose)
        ratios.append(spent[0] / spent[1])
        step()
    return {"found_kept": right[0] / len(seen), "found_dropped": right[1] / len(seen), "time_ratio": median(ratios)}


def _is_right(found: Recognition, forest: Forest, pose: SE2) -> bool:
    """Whether an observation made at `pose` (map_T_query) was matched with a transform within the paper's bounds."""
    if found.verdict != "matched":
        return False
    best = found.candidates[0]
    shift, turn = (forest.poses[best.key] @ best.transform).distance(pose)
    return shift < TRANSLATION and turn < ROTATION
