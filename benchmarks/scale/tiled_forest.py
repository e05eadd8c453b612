"""Forests as large as a database needs them, in tiles, each made from a seed of its own when it is seen.

A tree knows no neighbour in the next tile: the least distance between trees is not kept across the seams. In the
paper's forest three trees in a hundred stand near enough to one for that, and the noise of 3 m hides most of it.
"""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.evaluation.simulation import Sensor, bridson, observe, paper_forest
from urquhart.options import Effort
from urquhart.se2 import SE2

TILE: Final = 1000.0
"""Metres: side of a tile."""
RADIUS: Final = 50.0
"""Metres: range of the sensor."""
SPACING: Final = 50.0
"""Metres between the centres of neighbouring submaps, on a square grid."""
MARGIN: Final = 100.0
"""Metres from the forest's edge to the first centre."""
_STRAY: Final = 20.0
"""Metres that a tree may have been moved out of its tile by a Gaussian of 3 m; farther is not looked for."""
_KEPT: Final = 256
"""Tiles kept in memory."""
_TREES, _HERE, _ASKED = 0, 1, 2
"""What a seed is for."""


class Setting(NamedTuple):
    """What a sensor is like: noise of a coordinate in metres, and the chance that a tree in range is seen."""

    sigma: float
    detection: float

    def __str__(self) -> str:
        return f"{100 * self.sigma:.0f} cm, {100 * self.detection:.0f} %"


class ForestKind(NamedTuple):
    """What grows, and from how far it is seen.

    Attributes:
        grow: trees (N, 2) float64, metres, of a square tile with a side in metres.
        radius: metres, range of the sensor.
        spacing: metres between the centres of neighbouring submaps, on a square grid.
        tile: metres, side of a tile.
    """

    grow: Callable[[np.random.Generator, float], NDArray[np.float64]]
    radius: float = RADIUS
    spacing: float = SPACING
    tile: float = TILE


def dense_stand(rng: np.random.Generator, side: float) -> NDArray[np.float64]:
    """A stand of 300 to 2,000 trees per hectare, evenly in the logarithm: (N, 2) float64, metres, of a square.

    Trees keep 0.6 times the distance that they would have in a regular pattern, and moved by a tenth of it.
    """
    density = 1e-4 * math.exp(rng.uniform(math.log(300.0), math.log(2000.0)))
    apart = 0.6 / math.sqrt(density)
    trees = bridson(side, side, apart, rng)
    kept = trees[rng.random(len(trees)) < density * side**2 / len(trees)]
    return kept + rng.normal(0.0, 0.1 * apart, kept.shape)


FORESTS: Final = {"paper": ForestKind(paper_forest), "dense": ForestKind(dense_stand, 30.0, 30.0, 300.0)}


class Kind(NamedTuple):
    """A kind of query: who asks, whether from inside the mapped area or from another forest, and with what effort."""

    setting: Setting
    inside: bool
    effort: Effort = "fast"
    forest: str = "paper"

    def __str__(self) -> str:
        where = "inside" if self.inside else "not in the database"
        return ", ".join(
            (*(("dense",) if self.forest == "dense" else ()), str(self.setting), where)
            + (("full effort",) if self.effort == "full" else ())
        )


GOOD: Final = Setting(0.2, 0.9)
POOR: Final = Setting(0.4, 0.8)
STORED: Final = GOOD
"""Submaps were seen by a robot, too."""
KINDS: Final = {
    "inside-20": Kind(GOOD, True),
    "outside-20": Kind(GOOD, False),
    "inside-40": Kind(POOR, True),
    "outside-40": Kind(POOR, False),
    "dense-inside-20": Kind(GOOD, True, forest="dense"),
    "dense-outside-20": Kind(GOOD, False, forest="dense"),
    "inside-20-full": Kind(GOOD, True, "full"),
    "outside-20-full": Kind(GOOD, False, "full"),
    "inside-40-full": Kind(POOR, True, "full"),
    "dense-inside-20-full": Kind(GOOD, True, "full", "dense"),
    "dense-outside-20-full": Kind(GOOD, False, "full", "dense"),
}
PLAIN: Final = tuple(name for name, kind in KINDS.items() if kind.effort == "fast" and kind.forest == "paper")
"""Kinds that rivals are asked and pictures show."""


def questions_of(name: str) -> str:
    """The kind whose observations a kind asks: `full` asks the same as `fast`."""
    return name.removesuffix("-full")


class Seen(NamedTuple):
    """An observation: `map_T_sensor`, and landmarks (N, 2) float64, metres, sensor frame."""

    pose: SE2
    xy: NDArray[np.float64]


def grid_shape(submaps: int) -> tuple[int, int]:
    """Rows and columns, as near to a square as `submaps` can be divided: exactly so many, and no ragged edge."""
    rows = next(k for k in range(math.isqrt(submaps), 0, -1) if submaps % k == 0)
    return rows, submaps // rows


class World:
    """A forest with `submaps` places on a grid, row by row, and another forest of the same size to ask from.

    Everything depends on the seed and on its own number alone, never on what was made before it.
    """

    def __init__(self, submaps: int, seed: int, *, forest: str = "paper", tile: float | None = None) -> None:
        self.kind = FORESTS[forest]
        self.submaps, self.seed, self.tile = submaps, seed, self.kind.tile if tile is None else tile
        self.rows, self.columns = grid_shape(submaps)
        self._trees_of = lru_cache(maxsize=_KEPT)(self._grow)

    @property
    def sides(self) -> tuple[float, float]:
        """Metres, of the rectangle in which the centres lie: east, north."""
        return self.kind.spacing * (self.columns - 1), self.kind.spacing * (self.rows - 1)

    def submap(self, index: int, drive: int = 0) -> Seen:
        """What the robot saw that stored submap `index`, or what another one saw there on a `drive` of its own."""
        rng = np.random.default_rng([self.seed, _HERE, index, *([drive] if drive else [])])
        row, column = divmod(index, self.columns)
        x, y = MARGIN + self.kind.spacing * column, MARGIN + self.kind.spacing * row
        pose = SE2(x, y, float(rng.uniform(-np.pi, np.pi)))
        return self._look(pose, STORED, 0, rng)

    def query(self, name: str, number: int) -> Seen:
        """Query `number` of a kind of `KINDS`: uniform over the area in which the centres lie, any heading."""
        kind = KINDS[name]
        rng = np.random.default_rng([self.seed, _ASKED, list(KINDS).index(name), number])
        east, north = self.sides
        x, y, yaw = rng.uniform((0.0, 0.0, -np.pi), (east, north, np.pi)).tolist()
        return self._look(SE2(MARGIN + x, MARGIN + y, yaw), kind.setting, 0 if kind.inside else 1, rng)

    def nearest(self, x: float, y: float) -> int:
        """The submap whose centre is nearest to a point of the map, metres."""
        column = min(max(round((x - MARGIN) / self.kind.spacing), 0), self.columns - 1)
        row = min(max(round((y - MARGIN) / self.kind.spacing), 0), self.rows - 1)
        return row * self.columns + column

    def trees_near(self, x: float, y: float, forest: int = 0) -> NDArray[np.float64]:
        """Trees (N, 2), metres, map frame: all within the sensor's range of a point, and others; `forest` 0 or 1."""
        strips = []
        for i, j in self._tiles_near(x, y):
            trees = self._trees_of(forest, i, j)
            low, high = np.searchsorted(trees[:, 0], (x - self.kind.radius, x + self.kind.radius))
            strips.append(trees[low:high])
        return np.concatenate(strips)

    def _look(self, pose: SE2, setting: Setting, forest: int, rng: np.random.Generator) -> Seen:
        trees = self.trees_near(pose.x, pose.y, forest)
        seen = observe(trees, pose, Sensor(self.kind.radius, sigma=setting.sigma, detection=setting.detection), rng)
        return Seen(pose, seen.xy)

    def _tiles_near(self, x: float, y: float) -> Iterator[tuple[int, int]]:
        reach = self.kind.radius + _STRAY
        for i in range(max(int((x - reach) // self.tile), 0), int((x + reach) // self.tile) + 1):
            for j in range(max(int((y - reach) // self.tile), 0), int((y + reach) // self.tile) + 1):
                yield i, j

    def _grow(self, forest: int, i: int, j: int) -> NDArray[np.float64]:
        """Trees (N, 2), metres, map frame, of a tile, from west to east."""
        rng = np.random.default_rng([self.seed, _TREES, forest, i, j])
        trees = self.kind.grow(rng, self.tile) + np.array([i * self.tile, j * self.tile])
        ordered: NDArray[np.float64] = trees[np.argsort(trees[:, 0], kind="stable")]
        return ordered
