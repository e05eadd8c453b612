"""Landmarks in the shapes that cost a method most: on circles, in rows, on lattices, at every scale at once."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Shape = Callable[[int, np.random.Generator], Points]


def _arc(count: int, radius: float, turn: float = 2.0 * math.pi) -> Points:
    angle = turn * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _natural(count: int, rng: np.random.Generator) -> Points:
    return rng.uniform(0.0, 3.0 * math.sqrt(count), (count, 2))


def _circles(count: int, _: np.random.Generator) -> Points:
    half = count // 2
    return np.concatenate([_arc(half, 0.3 * count), _arc(count - half, 0.35 * count)])


def _fan(count: int, _: np.random.Generator) -> Points:
    return np.concatenate([np.zeros((1, 2)), _arc(count - 1, 0.6 * count, math.pi)])


def _spiral(count: int, _: np.random.Generator) -> Points:
    along = np.sqrt(np.arange(count) + 1.0)
    return np.column_stack([along * np.cos(2.0 * along), along * np.sin(2.0 * along)])


def _square(count: int, _: np.random.Generator) -> Points:
    side = math.ceil(math.sqrt(count))
    return 2.0 * np.column_stack(np.divmod(np.arange(count), side)).astype(np.float64)


def _hexagonal(count: int, rng: np.random.Generator) -> Points:
    row, place = _square(count, rng).T
    return np.column_stack([place + (row / 2.0) % 2.0, row * math.sqrt(0.75)])


def _thin(count: int, rng: np.random.Generator) -> Points:
    return np.column_stack([np.arange(count, dtype=np.float64), rng.normal(0.0, 0.01, count)])


def _parabola(count: int, _: np.random.Generator) -> Points:
    x = 0.1 * (np.arange(count) - count // 2)
    return np.column_stack([x, x * x])


def _stray(count: int, rng: np.random.Generator) -> Points:
    return np.concatenate([_natural(count - 1, rng), [[1e7, 0.0]]])


def _exponential(count: int, rng: np.random.Generator) -> Points:
    x = 0.01 * np.exp(np.linspace(0.0, 20.0, count)) + 0.01 * np.arange(count)
    return np.column_stack([x, rng.uniform(0.0, 1.0, count)])


def _row(count: int, _: np.random.Generator) -> Points:
    row = np.column_stack([np.arange(count - 1.0), np.zeros(count - 1)])
    return np.concatenate([row, [[count / 2.0 + 0.3, 5.0]]])


def _rows(count: int, _: np.random.Generator) -> Points:
    place, row = np.divmod(np.arange(count), 2)
    return np.column_stack([1.0 * place, 50.0 * row])


def _wide(count: int, rng: np.random.Generator) -> Points:
    return np.column_stack([np.linspace(-1e8, 1e8, count), rng.uniform(-1.0, 1.0, count)])


SHAPES: Final[dict[str, Shape]] = {
    "natural": _natural,
    "circle": lambda count, _: _arc(count, 0.3 * count),
    "two circles": _circles,
    "fan": _fan,
    "spiral": _spiral,
    "square lattice": _square,
    "hexagonal lattice": _hexagonal,
    "line, 1 cm wide": _thin,
    "parabola": _parabola,
    "one stray at 10,000 km": _stray,
    "exponential spacing": _exponential,
    "at 100,000 km": lambda count, rng: 9.9e7 + _natural(count, rng),
    "one row and a tree": _row,
    "two rows": _rows,
    "200,000 km wide": _wide,
}
"""Shapes by name: called with how many landmarks and a source of randomness, (N, 2), metres; all are accepted."""
