"""The paper's forest as large as a database needs it, in tiles, each made from a seed of its own when it is seen.

A tree knows no neighbour in the next tile: the 7 m between trees are not kept across the seams. Three trees in a
hundred stand near enough to one for that, and the noise of 3 m hides most of it.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.evaluation.simulation import Sensor, observe, paper_forest
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


class Kind(NamedTuple):
    """A kind of query: who asks, and whether from inside the mapped area or from another forest."""

    setting: Setting
    inside: bool

    def __str__(self) -> str:
        return f"{self.setting}, {'inside' if self.inside else 'not in the database'}"


GOOD: Final = Setting(0.2, 0.9)
POOR: Final = Setting(0.4, 0.8)
STORED: Final = GOOD
"""Submaps were seen by a robot, too."""
KINDS: Final = {
    "inside-20": Kind(GOOD, True),
    "outside-20": Kind(GOOD, False),
    "inside-40": Kind(POOR, True),
    "outside-40": Kind(POOR, False),
}


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

    def __init__(self, submaps: int, seed: int, *, tile: float = TILE) -> None:
        self.submaps, self.seed, self.tile = submaps, seed, tile
        self.rows, self.columns = grid_shape(submaps)
        self._trees_of = lru_cache(maxsize=_KEPT)(self._grow)

    @property
    def sides(self) -> tuple[float, float]:
        """Metres, of the rectangle in which the centres lie: east, north."""
        return SPACING * (self.columns - 1), SPACING * (self.rows - 1)

    def submap(self, index: int, drive: int = 0) -> Seen:
        """What the robot saw that stored submap `index`, or what another one saw there on a `drive` of its own."""
        rng = np.random.default_rng([self.seed, _HERE, index, *([drive] if drive else [])])
        row, column = divmod(index, self.columns)
        pose = SE2(MARGIN + SPACING * column, MARGIN + SPACING * row, float(rng.uniform(-np.pi, np.pi)))
        return self._look(pose, STORED, 0, rng)

    def query(self, name: str, number: int) -> Seen:
        """Query `number` of a kind of `PROBLEM_TYPES`: uniform over the area in which the centres lie, any heading."""
        kind = KINDS[name]
        rng = np.random.default_rng([self.seed, _ASKED, list(KINDS).index(name), number])
        east, north = self.sides
        x, y, yaw = rng.uniform((0.0, 0.0, -np.pi), (east, north, np.pi)).tolist()
        return self._look(SE2(MARGIN + x, MARGIN + y, yaw), kind.setting, 0 if kind.inside else 1, rng)

    def nearest(self, x: float, y: float) -> int:
        """The submap whose centre is nearest to a point of the map, metres."""
        column = min(max(round((x - MARGIN) / SPACING), 0), self.columns - 1)
        row = min(max(round((y - MARGIN) / SPACING), 0), self.rows - 1)
        return row * self.columns + column

    def trees_near(self, x: float, y: float, forest: int = 0) -> NDArray[np.float64]:
        """Trees (N, 2), metres, map frame: all within the sensor's range of a point, and others; `forest` 0 or 1."""
        strips = []
        for i, j in self._tiles_near(x, y):
            trees = self._trees_of(forest, i, j)
            low, high = np.searchsorted(trees[:, 0], (x - RADIUS, x + RADIUS))
            strips.append(trees[low:high])
        return np.concatenate(strips)

    def _look(self, pose: SE2, setting: Setting, forest: int, rng: np.random.Generator) -> Seen:
        trees = self.trees_near(pose.x, pose.y, forest)
        seen = observe(trees, pose, Sensor(RADIUS, sigma=setting.sigma, detection=setting.detection), rng)
        return Seen(pose, seen.xy)

    def _tiles_near(self, x: float, y: float) -> Iterator[tuple[int, int]]:
        reach = RADIUS + _STRAY
        for i in range(max(int((x - reach) // self.tile), 0), int((x + reach) // self.tile) + 1):
            for j in range(max(int((y - reach) // self.tile), 0), int((y + reach) // self.tile) + 1):
                yield i, j

    def _grow(self, forest: int, i: int, j: int) -> NDArray[np.float64]:
        """Trees (N, 2), metres, map frame, of a tile, from west to east."""
        rng = np.random.default_rng([self.seed, _TREES, forest, i, j])
        trees = paper_forest(rng, self.tile) + np.array([i * self.tile, j * self.tile])
        ordered: NDArray[np.float64] = trees[np.argsort(trees[:, 0], kind="stable")]
        return ordered
