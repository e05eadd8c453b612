"""The worlds of the benchmarks, and what is asked of each: fewer questions than there, of the same kinds."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.levels.asking import ROW, ask
from benchmarks.paper.drive import CELLS, ROTATIONS, SENSOR, drive
from benchmarks.robust import edges, grid, rows, stands
from benchmarks.robust.known_places import PAPER, STRICT, AskedPart, AskedQuery, RobustWorld, TruePlace
from benchmarks.scale.tiled_forest import GOOD, MARGIN, POOR, RADIUS, Setting
from benchmarks.scale.tiled_forest import World as Forest
from urquhart import SE2, Config, warm_up
from urquhart.evaluation.simulation import Sensor, observe

SIZES: Final = (1_000, 10_000)
"""Submaps of the large forests."""
SETTINGS: Final = (GOOD, POOR, Setting(0.6, 0.7))


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of world.

    Attributes:
        parts: in how many parts it is asked, each by one process at a time.
        questions: about one part, by its number, the seed, and how many of each sort.
        count: questions of each sort in a part, in a full run and in a quick one; 0 leaves the world out.
    """

    parts: int
    questions: Callable[[int, int, int], Iterator[AskedQuery]]
    count: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Job:
    """One part of a world."""

    world: str
    part: int
    seed: int
    count: int


def run(job: Job) -> NDArray[Any]:
    """Rows (Q,) of `asking.ROW` about one part of a world."""
    warm_up(Config())
    asked = (ask(question) for question in WORLDS[job.world].questions(job.part, job.seed, job.count))
    return np.array([row for row in asked if row is not None], ROW)


def jobs(name: str, seed: int, *, quick: bool) -> Sequence[Job]:
    """All parts of a world, or every tenth of them in a quick run; none where it is left out."""
    kind = WORLDS[name]
    count = kind.count[quick]
    return [Job(name, part, seed, count) for part in range(0, kind.parts, 10 if quick else 1) if count]


def _drives(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
    """Pairs of observations of one drive in a cell of the paper's Table I; those surely near and surely far."""
    driven = drive(count, seed, *CELLS[part], ROTATIONS["full"])
    worlds = [RobustWorld([TruePlace(o.xy, 0, o.pose)], Config(), PAPER) for o in driven.observations]
    for i, j, apart in zip(driven.first.tolist(), driven.second.tolist(), driven.apart.tolist(), strict=True):
        if apart < SENSOR or apart > 2.0 * SENSOR:
            seen = driven.observations[j]
            yield AskedQuery(worlds[i], seen.xy, 0 if apart < SENSOR else None, seen.pose)


def _grid(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
    return grid.questions(AskedPart(part, seed, count, count))


def _rows(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
    return rows.questions(AskedPart(part, seed, count, count))


def _edges(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
    return edges.questions(edges.Job(part, seed, count))


def _stands(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
    return (question for _, question in stands.questions(stands.Job(stands.available()[part], seed, count)))


def _plots(part: int, seed: int, _: int) -> Iterator[AskedQuery]:
    group, with_diameters = list(stands.PLOTS)[part // 2], bool(part % 2)
    return stands.plot_questions(stands.Job("plots", seed, 0), group, with_diameters=with_diameters)


def _forest(submaps: int) -> Callable[[int, int, int], Iterator[AskedQuery]]:
    """Questions about a forest with so many submaps: each part has a noise, and asks inside or from another forest."""

    def questions(part: int, seed: int, count: int) -> Iterator[AskedQuery]:
        forest, world = _stored(submaps, seed)
        setting, inside = SETTINGS[part // 2], part % 2 == 0
        east, north = forest.sides
        for number in range(count):
            rng = np.random.default_rng([seed, 11, part, number])
            x, y, yaw = rng.uniform((0.0, 0.0, -np.pi), (east, north, np.pi)).tolist()
            pose = SE2(MARGIN + x, MARGIN + y, yaw)
            trees = forest.trees_near(pose.x, pose.y, 0 if inside else 1)
            seen = observe(trees, pose, Sensor(RADIUS, sigma=setting.sigma, detection=setting.detection), rng)
            yield AskedQuery(world, seen.xy, 0 if inside else None, pose)

    return questions


@lru_cache(maxsize=1)
def _stored(submaps: int, seed: int) -> tuple[Forest, RobustWorld]:
    forest = Forest(submaps, seed)
    seen = [forest.submap(index) for index in range(submaps)]
    return forest, RobustWorld([TruePlace(one.xy, 0, one.pose) for one in seen], Config(), STRICT)


WORLDS: Final = {
    "the paper's drives, one submap each": Kind(len(CELLS), _drives, (5, 2)),
    "extended grid, one submap each": Kind(len(grid.CELLS), _grid, (20, 3)),
    "plantations, 36 submaps": Kind(len(rows.KINDS), _rows, (10, 2)),
    "edges of plantations, 1 to 36 submaps": Kind(len(edges.KINDS), _edges, (3, 1)),
    "real stands": Kind(len(stands.available()), _stands, (6, 1)),
    "plots surveyed twice": Kind(2 * len(stands.PLOTS), _plots, (1, 0)),
    **{
        f"paper's forest, {submaps:,} submaps": Kind(2 * len(SETTINGS), _forest(submaps), (100, 0)) for submaps in SIZES
    },
}
