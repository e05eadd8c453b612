"""Rows of trees along straight lines and curves: they repeat themselves, and no place in them is told from another."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart import SE2, Config, Recognition, Recognizer, describe

CONFIG = Config()
Trees = NDArray[np.float64]


def corner(count: int, spacing: float) -> Trees:
    """Two rows at a right angle, and one tree beside them."""
    along = np.arange(count // 2) * spacing
    rows = [np.column_stack([along, 0.0 * along]), np.column_stack([0.0 * along[1:], along[1:]])]
    return np.vstack([*rows, [[1.0, 1.0]]])


def ring(count: int, spacing: float, shown: int | None = None) -> Trees:
    """Trees along a circle, or the first `shown` of them."""
    turn = 2.0 * np.pi * np.arange(shown or count) / count
    return count * spacing / (2.0 * np.pi) * np.column_stack([np.cos(turn), np.sin(turn)])


def row(count: int, spacing: float, strays: int) -> Trees:
    """A straight row, and some trees beside it."""
    beside = np.random.default_rng(9).uniform(0.0, 100.0, (strays, 2))
    return np.vstack([np.column_stack([np.arange(count) * spacing, np.zeros(count)]), beside])


def recognize(stored: list[Trees], asked: Trees, noise: float, seed: int) -> Recognition:
    rng = np.random.default_rng(seed)
    recognizer = Recognizer(CONFIG)
    recognizer.add((key, describe(xy, CONFIG)) for key, xy in enumerate(stored))
    pose = SE2(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-3.0, 3.0))
    return recognizer.locate(pose.apply(asked + rng.normal(0.0, noise, asked.shape)))


@pytest.mark.parametrize(
    ("stored", "asked"),
    [
        pytest.param(ring(1000, 3.0), corner(60, 3.0), id="corner in a ring"),
        pytest.param(ring(1000, 0.5), corner(100, 0.5), id="hedge in a ring"),
        pytest.param(ring(628, 3.0, 300), corner(100, 3.0), id="corner in an arc"),
        pytest.param(ring(1000, 3.0), ring(1000, 3.0, 60), id="part of a ring"),
        pytest.param(
            ring(1000, 3.0),
            np.vstack([ring(1000, 3.0, 60), ring(1000, 3.0, 60)[:30:10] + [5.0, 7.0]]),
            id="part of a ring and strays",
        ),
        pytest.param(ring(120, 3.0), ring(120, 3.0, 30), id="part of a small ring"),
        pytest.param(ring(60, 3.0), ring(60, 3.0, 40), id="most of a small ring"),
        pytest.param(ring(1000, 3.0, 300), row(60, 3.0, 5), id="straight row in an arc"),
        pytest.param(row(400, 3.0, 9), row(60, 3.0, 0) + [0.0, 1.0], id="part of a long row"),
        pytest.param(ring(4000, 0.5), corner(2000, 0.5), id="few trees of a large query"),
    ],
)
def test_no_place_along_a_row_is_told_from_another(stored: Trees, asked: Trees) -> None:
    """At the edge of a submap much larger than what is matched, too: rivals lie along the row, not about the middle."""
    for seed in range(2):
        found = recognize([stored], asked, 0.1, seed)
        assert found.verdict != "matched", (seed, found.candidates[0].transform)


@pytest.mark.parametrize("make", [lambda: corner(2000, 1.0), lambda: corner(400, 1.0), lambda: corner(300, 0.8)])
def test_a_corner_of_close_rows_lies_on_itself(make: Callable[[], Trees]) -> None:
    """Every second partner is a neighbour's when a pose is half a planting distance off, and that fits as well."""
    trees = make()
    recognizer = Recognizer(CONFIG)
    recognizer.add([(0, describe(trees, CONFIG)), (1, describe(ring(5000, 2.5), CONFIG))])
    found = recognizer.locate(trees)
    best = found.candidates[0]
    assert best.key == 0
    assert best.transform.distance(SE2.identity())[0] < 0.01 or found.verdict != "matched"
    assert np.sqrt(np.diag(best.uncertainty.covariance)).max() < 1.0
