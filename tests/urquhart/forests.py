"""Landmark sets that tests share: natural, clustered, planted, and barely legal ones."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from urquhart import SE2

Points = NDArray[np.float64]


def uniform(rng: np.random.Generator, count: int = 80, side: float = 80.0) -> Points:
    return rng.uniform(0.0, side, (count, 2))


def clustered(rng: np.random.Generator, count: int = 80) -> Points:
    centres = rng.uniform(0.0, 80.0, (6, 2))
    return centres[rng.integers(0, 6, count)] + rng.normal(0.0, 3.0, (count, 2))


def grid(rng: np.random.Generator) -> Points:
    """An exact square grid with holes: every four neighbours lie on one circle."""
    columns, rows = rng.integers(3, 12, 2)
    points = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) * 3.0
    kept = points[rng.random(len(points)) < 0.85]
    return kept if spread(kept) else points


def lattice(rng: np.random.Generator) -> Points:
    """Equilateral planting: every triangle has three longest edges."""
    columns, rows = rng.integers(3, 10, 2)
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    points = np.column_stack([(i + 0.5 * (j % 2)).ravel() * 2.0, j.ravel() * np.sqrt(3.0)])
    kept = points[rng.random(len(points)) < 0.9]
    return kept if spread(kept) else points


def avenue(rng: np.random.Generator) -> Points:
    """Long runs on two parallel lines and a few trees beside them."""
    along = np.arange(int(rng.integers(4, 15))) * 5.0
    lines = np.concatenate([np.column_stack([along, np.full(len(along), y)]) for y in (0.0, 8.0)])
    return np.concatenate([lines, rng.uniform(0.0, 40.0, (4, 2))])


def ring(rng: np.random.Generator) -> Points:
    """Trees on one circle, some inside."""
    angle = np.linspace(0.0, 2.0 * np.pi, int(rng.integers(6, 20)), endpoint=False)
    return np.concatenate([20.0 * np.column_stack([np.cos(angle), np.sin(angle)]), rng.uniform(-8.0, 8.0, (6, 2))])


def pose(rng: np.random.Generator, low: float, high: float) -> SE2:
    """A pose uniform in a square, turned anywhere."""
    x, y = rng.uniform(low, high, 2).tolist()
    return SE2(x, y, float(rng.uniform(-np.pi, np.pi)))


def spread(points: Points) -> bool:
    return len(points) > 3 and bool((np.ptp(points, axis=0) > 0.5).all())


def all_kinds(seed: int, each: int) -> Iterator[tuple[str, Points]]:
    rng = np.random.default_rng(seed)
    for make in (uniform, clustered, grid, lattice, avenue, ring):
        for _ in range(each):
            yield make.__name__, make(rng)
    for _ in range(each):
        yield "small", rng.uniform(0.0, 20.0, (int(rng.integers(3, 12)), 2))
