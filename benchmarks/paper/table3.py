"""Table III: what describing an observation and matching a pair cost, for every method in one run; and how it grows.

One thread, one process, nothing else running; all methods take turns over the same observations and pairs, so that each
sees the same machine. Matching ends with correspondences, as in the paper; what RANSAC and verification add is listed
beside it. The robust method has no correspondences to show: its figure is the whole look-up in a collection of one
submap, less the description of the query.
"""

import math
import time
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.attempts import Verifier, agree
from benchmarks.paper.drive import drive
from benchmarks.paper.methods import Glarot, Li, Method, Paper, Points, Robust
from benchmarks.pool import Pool
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.simulation import Sensor, observe, paper_forest

CELL: Final = (0.1, 0.95)
"""Noise and detection: a middling cell of Table I."""
GROWTH: Final = (50, 100, 200, 400, 800, 1600)
"""Landmarks of an observation, for the slopes; the range of the sensor grows with them, the forest stays."""
STEEP: Final = 200
"""Slopes are fitted from this many landmarks on: below it, fixed costs hide the growth."""
APART: Final = 0.4
"""Ranges between the two observations of a pair whose growth is measured."""


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Times at the paper's size, and their growth."""
    config = Config()
    warm_up(config)
    sizes, repeats = (GROWTH[:4], 3) if quick else (GROWTH, 10)
    step = pool.alone("Table III", 1 + len(sizes))
    driven = drive(6 if quick else 14, seed, *CELL, 2.0 * math.pi)
    seen = [o.xy for o in driven.observations]
    rng = np.random.default_rng([seed, 9])
    wanted = 40 if quick else 400
    # Half of the pairs within the sensor's range of each other, half of them not.
    near, far = np.flatnonzero(driven.positive), np.flatnonzero(~driven.positive)
    rows = np.concatenate([rng.choice(near, wanted // 2), rng.choice(far, wanted // 2)])
    pairs = list(zip(driven.first[rows].tolist(), driven.second[rows].tolist(), strict=True))
    at_size = measure(seen, pairs, config, rng)
    step()
    growth: dict[str, dict[str, list[float]]] = {}
    counts = []
    for size in sizes:
        views = views_of(size, 4 if quick else 6, np.random.default_rng([seed, 10, size]))
        counts.append(float(np.mean([len(xy) for xy in views])))
        both = [(i, i + 1) for i in range(0, len(views), 2)] * repeats
        for name, row in measure(views, both, config, rng).items():
            for part in ("describe", "match"):
                growth.setdefault(name, {}).setdefault(part, []).append(row[part])
        step()
    return {
        "cell": list(CELL),
        "landmarks": float(np.mean([len(xy) for xy in seen])),
        "pairs": wanted,
        "methods": at_size,
        "growth": {"landmarks": counts, "methods": growth},
        "slopes": {
            name: {part: slope(counts, times) for part, times in parts.items()} for name, parts in growth.items()
        },
        "steep_from": STEEP,
    }


def measure(
    seen: list[Points], pairs: list[tuple[int, int]], config: Config, rng: np.random.Generator
) -> dict[str, dict[str, float]]:
    """Median milliseconds by method: describe one observation, match one pair, and what follows a match."""
    methods: dict[str, Method] = {"paper": Paper(config), "glarot-local": Glarot(), "li": Li((100.0,))}
    robust = Robust(config)
    described = {name: [method.describe(xy) for xy in seen] for name, method in methods.items()}
    collections = [robust.describe(xy) for xy in seen]
    verifier = Verifier(seen, config)
    times: dict[str, dict[str, list[float]]] = {name: {} for name in (*methods, "robust")}

    def note(name: str, part: str, started: float) -> None:
        times[name].setdefault(part, []).append((time.perf_counter() - started) * 1e3)

    for xy in seen:
        for name, method in methods.items():
            started = time.perf_counter()
            method.describe(xy)
            note(name, "describe", started)
    for i, j in pairs:
        for name, method in methods.items():
            query, submap = described[name][j], described[name][i]
            started = time.perf_counter()
            found = method.match(query, submap, rng)[name]
            note(name, "match", started)
            if name == "glarot-local":
                started = time.perf_counter()
                method.gate(query, submap)
                note(name, "gate", started)
            started = time.perf_counter()
            consensus = agree(seen[j], seen[i], found, config, rng)
            note(name, "ransac", started)
            if consensus is not None:
                started = time.perf_counter()
                verifier.refine(i, j, consensus.transform)
                note(name, "verify", started)
        started = time.perf_counter()
        answer = collections[i].locate(seen[j], limit=1)
        whole = (time.perf_counter() - started) * 1e3
        describing = sum(stage.milliseconds for stage in answer.stages if stage.name == "describe")
        times["robust"].setdefault("describe", []).append(describing)
        times["robust"].setdefault("match", []).append(whole - describing)
    return {name: {part: median(values) for part, values in parts.items()} for name, parts in times.items()}


def views_of(size: int, count: int, rng: np.random.Generator) -> list[NDArray[np.float64]]:
    """`count` observations of about `size` landmarks each, in pairs that overlap."""
    trees = paper_forest(rng, 1000.0)
    density = len(trees) / 1000.0**2
    reach = math.sqrt(size / (CELL[1] * density * math.pi))
    views = []
    for _ in range(count // 2):
        x, y, yaw, bearing = rng.uniform((300.0, 300.0, -np.pi, -np.pi), (700.0, 700.0, np.pi, np.pi)).tolist()
        step = APART * reach
        both = SE2(x, y, yaw), SE2(x + step * math.cos(bearing), y + step * math.sin(bearing), -yaw)
        views += [observe(trees, pose, Sensor(reach, sigma=CELL[0], detection=CELL[1]), rng).xy for pose in both]
    return views


def slope(counts: list[float], times: list[float]) -> float:
    """Exponent of growth: least squares through log time against log landmarks, from `STEEP` landmarks on."""
    x, y = np.log(counts), np.log(times)
    steep = np.array(counts) >= 0.9 * STEEP
    return float(np.polyfit(x[steep], y[steep], 1)[0])
