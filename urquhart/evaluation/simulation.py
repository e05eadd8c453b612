"""Simulated forests and observations: the paper's simulation, plantations, and noise for real stem maps.

All randomness comes from the `numpy.random.Generator` that is passed in.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.se2 import SE2


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedObservation:
    """The landmarks that a sensor saw from one pose.

    Attributes:
        xy: (N, 2) float64, metres, sensor frame.
        trees: (N,) int64, index of each landmark's tree in the forest; -1 for a false landmark.
        pose: `map_T_sensor`.
    """

    xy: NDArray[np.float64]
    trees: NDArray[np.int64]
    pose: SE2


class Sensor(NamedTuple):
    """How far a simulated sensor sees, and how well.

    Attributes:
        radius: metres, its range.
        sigma: metres, standard deviation of each coordinate (the paper's position noise, section V-B).
        detection: probability that a tree in range is seen (the paper's omega).
        clutter: number of false landmarks, uniform in the disc, as a share of the trees that are seen.
    """

    radius: float
    sigma: float = 0.0
    detection: float = 1.0
    clutter: float = 0.0


def bridson(
    width: float, height: float, minimum_distance: float, rng: np.random.Generator, attempts: int = 30
) -> NDArray[np.float64]:
    """A Poisson-disc sample (N, 2) float64, metres, of a rectangle (Bridson 2007, "Fast Poisson disk sampling").

    Args:
        width, height: metres, of the rectangle.
        minimum_distance: metres, between any two points.
        attempts: Bridson's k: tries around each active point before it is retired.
    """
    return _bridson(float(width), float(height), float(minimum_distance), attempts, rng)


@kernel
def _bridson(
    width: float, height: float, spacing: float, attempts: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    cell = spacing / math.sqrt(2.0)
    columns, rows = int(width / cell) + 1, int(height / cell) + 1
    grid = np.full((columns, rows), -1, np.int64)
    points = np.empty((columns * rows, 2))
    active = np.empty(columns * rows, np.int64)
    points[0, 0], points[0, 1] = rng.random() * width, rng.random() * height
    grid[int(points[0, 0] / cell), int(points[0, 1] / cell)] = 0
    active[0], alive, count = 0, 1, 1
    while alive > 0:
        pick = int(rng.random() * alive)
        centre = active[pick]
        placed = False
        for _ in range(attempts):
            # Uniform over the annulus between one and two times `spacing`.
            radius = spacing * math.sqrt(1.0 + 3.0 * rng.random())
            angle = 2.0 * math.pi * rng.random()
            x = points[centre, 0] + radius * math.cos(angle)
            y = points[centre, 1] + radius * math.sin(angle)
            if not (0.0 <= x < width and 0.0 <= y < height):
                continue
            i, j = int(x / cell), int(y / cell)
            clear = True
            for a in range(max(i - 2, 0), min(i + 3, columns)):
                for b in range(max(j - 2, 0), min(j + 3, rows)):
                    other = grid[a, b]
                    if other >= 0:
                        dx, dy = points[other, 0] - x, points[other, 1] - y
                        if dx * dx + dy * dy < spacing * spacing:
                            clear = False
            if clear:
                points[count, 0], points[count, 1] = x, y
                grid[i, j] = count
                active[alive] = count
                alive += 1
                count += 1
                placed = True
                break
        if not placed:
            alive -= 1
            active[pick] = active[alive]
    return points[:count].copy()


def paper_forest(rng: np.random.Generator, side: float = 1000.0) -> NDArray[np.float64]:
    """The paper's forest (section V-B): (N, 2) float64, metres, Poisson-disc at 7 m, plus Gaussian noise of 3 m.

    `side`: metres, of the square.
    """
    trees = bridson(side, side, 7.0, rng)
    return trees + rng.normal(0.0, 3.0, trees.shape)


def plantation(
    width: float,
    height: float,
    rng: np.random.Generator,
    *,
    spacing: tuple[float, float] = (3.0, 3.0),
    jitter: float = 0.3,
    survival: float = 0.9,
) -> NDArray[np.float64]:
    """Trees (N, 2) float64, metres, planted in rows.

    Args:
        width, height: metres, of the stand.
        spacing: metres between trees in a row, and between rows.
        jitter: metres, standard deviation of each coordinate of a tree from its planting point.
        survival: probability that a planting point still has a tree.
    """
    columns, rows = np.meshgrid(np.arange(0.0, width, spacing[0]), np.arange(0.0, height, spacing[1]))
    points = np.column_stack([columns.ravel(), rows.ravel()])
    points = points[rng.random(len(points)) < survival]
    return points + rng.normal(0.0, jitter, points.shape)


def observe(trees: NDArray[np.float64], pose: SE2, sensor: Sensor, rng: np.random.Generator) -> SimulatedObservation:
    """The observation by a sensor at `pose` (`map_T_sensor`) of `trees` (N, 2), metres, map frame."""
    radius, sigma, detection, clutter = sensor
    offset = trees - np.array([pose.x, pose.y])
    seen = np.flatnonzero((offset**2).sum(axis=1) <= radius * radius)
    seen = seen[rng.random(len(seen)) < detection]
    xy = pose.inverse().apply(trees[seen] + rng.normal(0.0, sigma, (len(seen), 2)))
    false = round(clutter * len(seen))
    distance, bearing = radius * np.sqrt(rng.random(false)), rng.uniform(0.0, 2.0 * np.pi, false)
    ghosts = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing)])
    order = rng.permutation(len(seen) + false)
    landmarks = np.concatenate([seen, np.full(false, -1)])[order].astype(np.int64)
    return SimulatedObservation(np.ascontiguousarray(np.concatenate([xy, ghosts])[order]), landmarks, pose)
