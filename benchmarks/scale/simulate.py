"""What is stored and what is asked, made before anything is timed and kept in files."""

import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from rich.console import Console

from benchmarks.experiments import progress_on
from benchmarks.pool import Pool
from benchmarks.scale.measurement import Figures, Measurement
from benchmarks.scale.measurement_plan import asked
from benchmarks.scale.observations import Observations, join, write
from benchmarks.scale.tiled_forest import KINDS, World, questions_of

WARMING: Final = 10
"""Queries that are not counted: the last of each kind, asked first."""
_MOST: Final = 20_000
"""Submaps, or queries, that one process makes at a time."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Submaps, or queries of a kind, from `first` on up to `last`, and the file they go to."""

    forest: str
    submaps: int
    seed: int
    what: str
    first: int
    last: int
    folder: Path
    name: str


def run(measurement: Measurement) -> Figures:
    """Write the submaps and all queries; seconds and sizes."""
    begun = time.perf_counter()
    wanted = {measurement.submaps_name: measurement.submaps} | {
        name: asked(name, measurement.submaps, quick=False) + WARMING
        for name, kind in KINDS.items()
        if kind.forest == measurement.forest and questions_of(name) == name
    }
    stretches = [
        Stretch(
            measurement.forest,
            measurement.submaps,
            measurement.seed,
            what,
            first,
            min(first + _band(measurement), count),
            measurement.room,
            f"{what}.{first}",
        )
        for what, count in wanted.items()
        for first in range(0, count, _band(measurement))
    ]
    with progress_on(Console()) as progress, Pool(measurement.workers, progress) as pool:
        pool.map(make, stretches, f"{measurement.submaps:,} submaps seen")
    for what in wanted:
        join(measurement.room, what, [stretch.name for stretch in stretches if stretch.what == what])
    submaps = Observations.load(measurement.room, measurement.submaps_name)
    world = World(measurement.submaps, measurement.seed, forest=measurement.forest)
    return {
        "seconds": time.perf_counter() - begun,
        "landmarks": len(submaps.points) / len(submaps),
        "sides": list(world.sides),
    }


def make(stretch: Stretch) -> None:
    """Write one stretch."""
    world = _world(stretch.submaps, stretch.seed, stretch.forest)
    numbers = range(stretch.first, stretch.last)
    if stretch.what in KINDS:
        seen = [world.query(stretch.what, number) for number in numbers]
    else:
        seen = [world.submap(index) for index in numbers]
    write(stretch.folder, stretch.name, seen)


def _band(measurement: Measurement) -> int:
    """Submaps of one stretch: whole rows of the grid, so that a process meets few tiles twice."""
    columns = World(measurement.submaps, measurement.seed).columns
    return max(1, _MOST // columns) * columns


@lru_cache(maxsize=1)
def _world(submaps: int, seed: int, forest: str) -> World:
    return World(submaps, seed, forest=forest)
