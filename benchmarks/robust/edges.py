"""Plantations at their worst: planted by machine, or seen at a corner or an edge that is like another one."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.pool import Pool
from benchmarks.robust.known_places import STRICT, AskedQuery, Points, RobustWorld, TruePlace, gather, summarize
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.simulation import Sensor, observe, plantation

SURVIVAL: Final = 0.97


@dataclass(frozen=True, slots=True)
class EdgeKind:
    """One kind of stand, and the place in it that is asked for.

    Attributes:
        scene: name of one of `SCENES`.
        spacing: metres between the trees of a row, and between rows.
        jitter: metres, standard deviation of a tree about its planting point.
        survival: share of the planting points that have a tree.
    """

    scene: str
    spacing: tuple[float, float]
    jitter: float
    survival: float = SURVIVAL


@dataclass(frozen=True, slots=True)
class Job:
    """One kind, in that many stands."""

    kind: int
    seed: int
    stands: int


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All kinds."""
    results = pool.map(run_kind, [Job(kind, seed, 1 if quick else 30) for kind in range(len(KINDS))], "edges")
    return {
        "kinds": [[kind.scene, list(kind.spacing), kind.jitter, kind.survival] for kind in KINDS],
        "summaries": [summarize(answers) for answers in results],
        "answers": np.concatenate(results),
    }


def run_kind(job: Job) -> NDArray[Any]:
    """Answers (Q,) about one kind."""
    return gather(question.ask() for question in questions(job))


def questions(job: Job) -> Iterator[AskedQuery]:
    """What is asked about one kind, one place or more in each stand."""
    warm_up(Config())
    kind = KINDS[job.kind]
    for stand in range(job.stands):
        yield from SCENES[kind.scene](kind, np.random.default_rng([job.seed, 8, job.kind, stand]))


def _world(trees: Points, poses: Sequence[SE2], radius: float, rng: np.random.Generator) -> RobustWorld:
    """What is seen from the poses, stored."""
    places = [
        TruePlace(observe(trees, pose, Sensor(radius, sigma=0.03, detection=0.98), rng).xy, 0, pose) for pose in poses
    ]
    return RobustWorld(places, Config(), STRICT)


def _turn(rng: np.random.Generator) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def _inside(kind: EdgeKind, rng: np.random.Generator) -> Iterator[AskedQuery]:
    """Amid the rows, with 36 submaps stored: a pose one row off explains nearly as much."""
    trees = plantation(90.0, 90.0, rng, spacing=kind.spacing, jitter=kind.jitter, survival=kind.survival)
    centres = range(20, 90, 12)
    world = _world(trees, [SE2(x, y, _turn(rng)) for x, y in product(centres, centres)], 20.0, rng)
    for _ in range(4):
        x, y = rng.uniform(20.0, 70.0, 2).tolist()
        pose = SE2(x, y, _turn(rng))
        yield AskedQuery(world, observe(trees, pose, Sensor(20.0, sigma=0.05, detection=0.95), rng).xy, 0, pose)


def _corner(kind: EdgeKind, rng: np.random.Generator) -> Iterator[AskedQuery]:
    """The corner of an orchard, stored beside the opposite corner; then only the opposite one is stored."""
    trees = plantation(150.0, 150.0, rng, spacing=kind.spacing, jitter=kind.jitter, survival=kind.survival)
    poses = [SE2(0.0, 0.0, _turn(rng)), SE2(145.0, 145.0, _turn(rng))]
    yield from _known_and_not(trees, poses, SE2(0.0, 0.0, _turn(rng)), 40.0, rng)


def _edge(kind: EdgeKind, rng: np.random.Generator) -> Iterator[AskedQuery]:
    """The middle of an edge, with three edges stored; then the edge that is not stored."""
    plant = hexagonal if kind.scene == "edge, hexagonal" else thinned
    trees = plant(70.0, rng, kind.spacing[0], kind.jitter, kind.survival)
    far_x, far_y = trees.max(axis=0).tolist()
    edges = [(0.5 * far_x, 0.0), (0.5 * far_x, far_y), (far_x, 0.5 * far_y)]
    world = _world(trees, [SE2(x, y, _turn(rng)) for x, y in edges], 24.0, rng)
    for x, y, ground in ((0.5 * far_x, 0.0, 0), (0.0, 0.5 * far_y, None)):
        pose = SE2(x, y, _turn(rng))
        yield AskedQuery(world, observe(trees, pose, Sensor(24.0, sigma=0.03, detection=0.98), rng).xy, ground, pose)


def _twin(kind: EdgeKind, rng: np.random.Generator) -> Iterator[AskedQuery]:
    """One of two stands side by side, planted alike, both stored; then only the other one is."""
    one, two = (
        plantation(38.0, 38.0, rng, spacing=kind.spacing, jitter=kind.jitter, survival=kind.survival) + [x, 0.0]
        for x in (0.0, 45.0)
    )
    poses = [SE2(x, y, _turn(rng)) for x in (57.0, 71.0, 12.0, 26.0) for y in (12.0, 26.0)]
    pose = SE2(float(rng.uniform(60.0, 68.0)), float(rng.uniform(15.0, 23.0)), 1.0)
    yield from _known_and_not(np.concatenate([one, two]), poses, pose, 16.0, rng, known=4)


def _lane(kind: EdgeKind, rng: np.random.Generator) -> Iterator[AskedQuery]:
    """The lane between two stands, with only their outer edges stored.

    Either stand's edge fits the stored one: those two poses claim different trees of the query, and rule each other
    out.
    """
    stands = [hexagonal(47.0, rng, kind.spacing[0], kind.jitter, kind.survival) + [x, 0.0] for x in (0.0, 55.0)]
    trees = np.concatenate(stands)
    world = _world(trees, [SE2(0.0, 23.5, _turn(rng)), SE2(102.0, 23.5, _turn(rng))], 21.4, rng)
    pose = SE2(51.0, 23.5, _turn(rng))
    yield AskedQuery(world, observe(trees, pose, Sensor(21.4, sigma=0.03, detection=0.98), rng).xy, None, pose)


def _known_and_not(
    trees: Points, poses: Sequence[SE2], pose: SE2, radius: float, rng: np.random.Generator, known: int = 1
) -> Iterator[AskedQuery]:
    """Ask for `pose` with all poses stored, then without the first `known`, which are those near it."""
    seen = observe(trees, pose, Sensor(radius, sigma=0.03, detection=0.98), rng).xy
    yield AskedQuery(_world(trees, poses, radius, rng), seen, 0, pose)
    yield AskedQuery(_world(trees, poses[known:], radius, rng), seen, None, pose)


def hexagonal(side: float, rng: np.random.Generator, spacing: float, jitter: float, survival: float) -> Points:
    """Trees (N, 2), metres, in a square of that side, each as far from its six neighbours."""
    rise = spacing * np.sqrt(3.0) / 2.0
    i, j = np.meshgrid(np.arange(int(side / spacing) + 1), np.arange(int(side / rise) + 1))
    points = np.column_stack([((i + 0.5 * (j % 2)) * spacing).ravel(), (j * rise).ravel()])
    points = points[rng.random(len(points)) < survival]
    trees: Points = points + rng.normal(0.0, jitter, points.shape)
    return trees


def thinned(side: float, rng: np.random.Generator, spacing: float, jitter: float, survival: float) -> Points:
    """Trees (N, 2), metres, in a square of that side, in rows of which every third was cut."""
    points = plantation(side, side, rng, spacing=(spacing, spacing), jitter=0.0, survival=survival)
    points = points[np.round(points[:, 1] / spacing) % 3 != 2]
    trees: Points = points + rng.normal(0.0, jitter, points.shape)
    return trees


SCENES: Final[dict[str, Callable[[EdgeKind, np.random.Generator], Iterator[AskedQuery]]]] = {
    "inside": _inside,
    "corner": _corner,
    "edge, hexagonal": _edge,
    "edge, thinned": _edge,
    "twin stands": _twin,
    "lane": _lane,
}
KINDS: Final = (
    EdgeKind("inside", (3.0, 3.0), 0.0, 1.0),
    EdgeKind("inside", (2.5, 3.5), 0.0),
    EdgeKind("inside", (3.0, 3.0), 0.03),
    EdgeKind("inside", (3.0, 3.0), 0.1),
    EdgeKind("inside", (2.5, 3.5), 0.15, 0.95),
    EdgeKind("inside", (2.0, 4.0), 0.2, 0.9),
    *(EdgeKind("corner", (5.0, 5.0), j, s) for j in (0.0, 0.03, 0.06, 0.1, 0.2, 0.3) for s in (1.0, 0.95)),
    *(EdgeKind(f"edge, {plant}", (4.0, 4.0), j) for plant in ("hexagonal", "thinned") for j in (0.0, 0.03, 0.06)),
    *(EdgeKind("twin stands", (3.0, 3.0), j) for j in (0.0, 0.03, 0.06, 0.1)),
    *(EdgeKind("lane", (4.0, 4.0), j, 0.95) for j in (0.03, 0.06, 0.1)),
)
"""What is planted to the centimetre tells one row from the next nowhere; ten centimetres of each tree are enough."""
