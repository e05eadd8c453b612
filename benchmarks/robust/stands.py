"""Real trees: stem maps cut into discs, censuses taken twice, and plots surveyed twice by different means."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from benchmarks.paper.tracks import BESIDE, SHIPPED
from benchmarks.pool import Pool
from benchmarks.robust.known_places import STRICT, AskedQuery, Points, RobustWorld, TruePlace, gather, summarize
from server.stem_maps.reader import read_stem_map
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.simulation import Sensor, observe

STANDS: Final = {
    **{name: SHIPPED / f"{name}.csv" for name in ("lansing", "bei", "longleaf")},
    **{
        name: BESIDE / f"{name}.csv"
        for name in ("fennoscandia_spruce", "quesnel_treetops", "boreas_sa", "boreas_sp", "hauersteig_1925")
    },
    **{name: BESIDE / "rainier" / f"{name}.csv" for name in "ab08 ag05 ao03 av02 av14 pp17 tb13 to11".split()},
}
CENSUSES: Final = ("scbi", "hauersteig")
"""Stored as first counted; asked about as counted again ten and twenty years later, too."""
PLOTS: Final = {
    "prf025": ("prf025",),
    "rioja": tuple(f"rioja/rioja{k:02d}" for k in range(1, 9)),
    "t3upland": tuple(sorted(f"t3upland/{p.name[:5]}" for p in (BESIDE / "t3upland").glob("*__a.csv"))),
}
NOISE: Final = tuple(product((0.1, 0.2, 0.3), (0.95, 0.8)))
"""Metres, and the chance that a tree is seen, of the query; what is stored has 0.1 m and 95 %."""
CLUTTER: Final = 0.1
TREES: Final = 60
"""Trees in view at a map's density: a sensor's range follows, between the bounds below."""
RANGE: Final = (8.0, 50.0)
STORED: Final = (0.1, 0.95)
HELD_OUT: Final = ("av14", "boreas_sp")
"""Stands that are not stored: what is asked about them must not be found."""


@dataclass(frozen=True, slots=True)
class Job:
    """Queries about one stand."""

    name: str
    seed: int
    queries: int


def available() -> list[str]:
    """Stands and censuses whose files are here."""
    return [name for name, path in STANDS.items() if path.exists()] + [
        name for name in CENSUSES if (BESIDE / f"{name}__a.csv").exists()
    ]


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All stands that are there, then the plots."""
    queries = 4 if quick else 40
    names = available()
    results = pool.map(run_stand, [Job(name, seed, queries) for name in names], "real stands")
    figures: dict[str, Any] = {
        "noise": [list(level) for level in NOISE],
        "held_out": list(HELD_OUT),
        "stands": {
            name: {key: summarize(answers) for key, answers in result.items()}
            for name, result in zip(names, results, strict=True)
        },
    }
    plots = [run_plots(Job("plots", seed, 0), with_diameters=given) for given in (False, True)]
    figures["plots"] = plots
    figures["answers"] = np.concatenate([answers for result in results for answers in result.values()])
    return figures


def run_stand(job: Job) -> dict[str, NDArray[Any]]:
    """Answers about one stand by noise; `again`: as it was counted again."""
    answers: dict[str, list[NDArray[Any]]] = {}
    for noise, question in questions(job):
        answers.setdefault(noise, []).append(question.ask())
    return {noise: gather(rows) for noise, rows in answers.items()}


def questions(job: Job) -> Iterator[tuple[str, AskedQuery]]:
    """What is asked about one stand, with the name of its noise."""
    world, grounds = everything(job.seed)
    rng = np.random.default_rng([job.seed, 8, *job.name.encode()])
    trees, held_out = stand(job.name, job.seed), job.name in HELD_OUT
    reach = sensor_range(trees)
    ground = None if held_out else grounds[job.name]
    for sigma, detection in NOISE:
        for _ in range(job.queries):
            pose = somewhere(trees, reach, rng)
            radius = reach * rng.uniform(0.6, 1.0)
            xy = observe(trees, pose, Sensor(radius, sigma=sigma, detection=detection, clutter=CLUTTER), rng).xy
            yield f"{sigma:g} m, {100 * detection:.0f} %", AskedQuery(world, xy, ground, pose)
    if job.name in CENSUSES:
        later, _ = read(BESIDE / f"{job.name}__b.csv")
        for _ in range(job.queries * len(NOISE)):
            pose = somewhere(later, reach, rng)
            xy = observe(later, pose, Sensor(reach, sigma=0.1, detection=0.95, clutter=CLUTTER), rng).xy
            yield "counted again", AskedQuery(world, xy, ground, pose)


def run_plots(job: Job, *, with_diameters: bool) -> dict[str, Any]:
    """Every plot's second survey, asked of a collection that holds all first ones and all stands."""
    found: dict[str, Any] = {}
    for group, names in PLOTS.items():
        rows = [question.ask() for question in plot_questions(job, group, with_diameters=with_diameters)]
        if rows:
            answers = gather(rows)
            found[group] = summarize(answers) | {"names": list(names), "verdicts": answers["verdict"].tolist()}
    return found


def plot_questions(job: Job, group: str, *, with_diameters: bool) -> Iterator[AskedQuery]:
    """The second survey of each plot of a group, as far as they are here."""
    world, grounds = everything(job.seed)
    for name in PLOTS[group]:
        if (BESIDE / f"{name}__b.csv").exists():
            second, diameters = read(BESIDE / f"{name}__b.csv")
            yield AskedQuery(world, second, grounds[name], truth(name), diameters if with_diameters else None)


@lru_cache(maxsize=2)
def everything(seed: int) -> tuple[RobustWorld, dict[str, int]]:
    """All stands cut into discs, and all plots, in one collection; the number of each one's ground."""
    config = Config()
    warm_up(config)
    rng = np.random.default_rng([seed, 7])
    places, grounds = list[TruePlace](), dict[str, int]()
    for ground, name in enumerate(available()):
        grounds[name] = ground
        if name in HELD_OUT:
            continue
        trees = stand(name, seed)
        reach = sensor_range(trees)
        low, high = trees.min(axis=0), trees.max(axis=0)
        inner = [
            np.arange(a + 0.6 * reach, b - 0.6 * reach + 1e-9, 0.9 * reach) for a, b in zip(low, high, strict=True)
        ]
        for x, y in product(*(axis.tolist() for axis in inner)):
            pose = SE2(x, y, rng.uniform(-np.pi, np.pi))
            seen = observe(trees, pose, Sensor(reach, sigma=STORED[0], detection=STORED[1]), rng)
            if len(seen.xy) >= 12:
                places.append(TruePlace(seen.xy, ground, pose))
    for names in PLOTS.values():
        for name in names:
            path = BESIDE / f"{name}__a.csv"
            if path.exists():
                grounds[name] = 1000 + len(grounds)
                first, diameters = read(path)
                places.append(TruePlace(first, grounds[name], SE2(0.0, 0.0, 0.0), diameters))
    return RobustWorld(places, config, STRICT), grounds


@lru_cache(maxsize=32)
def stand(name: str, seed: int) -> Points:
    """Trees (N, 2) of a stand, metres; those that lie on a raster are moved off it."""
    path = STANDS.get(name, BESIDE / f"{name}__a.csv")
    trees, _ = read(path)
    if name == "quesnel_treetops":
        # Every tree top lies on a raster of 2 m, which no sensor would see.
        trees = trees + np.random.default_rng([seed, 9]).uniform(-1.0, 1.0, trees.shape)
    return trees


def read(path: Path) -> tuple[Points, Points | None]:
    """Trees (N, 2), metres, one of each that stand at one point, and their diameters (N,) where the file has them."""
    found = read_stem_map(path)
    xy = np.asarray(found.xy, np.float64)
    twins = cKDTree(xy).query_pairs(0.01, output_type="ndarray")[:, 1]
    return np.delete(xy, twins, axis=0), None if found.dbh_cm is None else np.delete(found.dbh_cm, twins)


def sensor_range(trees: Points) -> float:
    """Metres: as far as holds `TREES` trees at the map's mean density."""
    density = len(trees) / ConvexHull(trees).volume
    return float(np.clip(np.sqrt(TREES / (np.pi * density)), *RANGE))


def somewhere(trees: Points, reach: float, rng: np.random.Generator) -> SE2:
    """A pose in a stand with at least 15 trees within half the range or the whole of it, if there is one."""
    low, high = trees.min(axis=0) + 0.5 * reach, trees.max(axis=0) - 0.5 * reach
    for _ in range(200):
        x, y = rng.uniform(low, np.maximum(high, low)).tolist()
        if (np.hypot(trees[:, 0] - x, trees[:, 1] - y) < 0.6 * reach).sum() >= 15:
            break
    return SE2(x, y, rng.uniform(-np.pi, np.pi))


def truth(name: str) -> SE2:
    """`a_T_b` of a plot that was surveyed twice."""
    found = json.loads((BESIDE / f"{name}__truth.json").read_text(encoding="utf-8"))["b_to_a"]
    return SE2(found["tx_m"], found["ty_m"], found["theta_rad"])
