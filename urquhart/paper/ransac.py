"""Euclidean transform from correspondences by RANSAC over pairs of them (paper, section IV-D).

Each iteration draws two correspondences, solves for the rigid transform, and counts the correspondences that it brings
within `distance`. The search stops when a share `ratio` agrees, or after `iterations` draws. The best transform is then
fitted to all its inliers. If there are no more pairs than iterations, every pair is tried once, in random order: this
is the same search, without drawing a pair twice.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.se2 import SE2, fit


@dataclass(frozen=True, slots=True, eq=False)
class RansacFit:
    """The result of RANSAC: the transform fitted to the inliers, the inliers (K,) bool, and the number of draws."""

    transform: SE2
    inliers: NDArray[np.bool_]
    iterations: int


class PointPairs(NamedTuple):
    """Correspondences, some of them wrong.

    Attributes:
        source, target: (K, 2) float64, metres; row i of `source` may be the same tree as row i of `target`.
        distance: metres, largest residual of an inlier; the paper's d.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    distance: float = 0.5


def ransac(
    pairs: PointPairs,
    rng: np.random.Generator,
    *,
    ratio: float = 0.99,
    iterations: int = 40_000,
    budget: Budget = UNBOUNDED,
) -> RansacFit | None:
    """Estimate `target_T_source` from correspondences.

    Args:
        rng: source of all randomness.
        ratio: share of inliers among all correspondences at which the search stops; the paper's r.
        iterations: most draws; the paper's s.
        budget: when the search must end; by default never.

    Returns:
        The transform fitted to its inliers; None for fewer than two correspondences, or if no two of them fix a
        rotation.

    Raises:
        DeadlinePassed: the deadline passed first.
    """
    source, target, distance = pairs
    n = len(source)
    if n < 2:
        return None
    choices = n * (n - 1) // 2
    order = np.arange(choices if choices <= iterations else 0)
    best, drawn = np.zeros(4), 0
    for draws in budget.portions(min(choices, iterations), n):
        drawn += _search(pairs, rng, ratio, order, (draws.start, draws.stop), best)
        if drawn < draws.stop:
            break
    x, y, yaw, agreeing = best.tolist()
    if agreeing < 2:
        return None
    inliers = _inliers(source, target, x, y, yaw, distance)
    rows = np.flatnonzero(inliers)
    return RansacFit(SE2(*fit(source, target, rows, rows)), inliers, drawn)


@kernel
def _inliers(
    source: NDArray[np.float64], target: NDArray[np.float64], x: float, y: float, yaw: float, distance: float
) -> NDArray[np.bool_]:
    c, s = math.cos(yaw), math.sin(yaw)
    inliers = np.empty(len(source), np.bool_)
    for k in range(len(source)):
        dx = c * source[k, 0] - s * source[k, 1] + x - target[k, 0]
        dy = s * source[k, 0] + c * source[k, 1] + y - target[k, 1]
        inliers[k] = dx * dx + dy * dy < distance * distance
    return inliers


@kernel
def _search(
    among: PointPairs,
    rng: np.random.Generator,
    ratio: float,
    order: NDArray[np.int64],
    draws: tuple[int, int],
    best: NDArray[np.float64],
) -> int:
    """Make the draws `draws[0]` to `draws[1]` (exclusive); returns the number that were made before enough agreed.

    Args:
        order: (P,), all pairs, if each is to be drawn once: those not drawn yet stand from `draws[0]` on; else empty.
        best: (4,), x, y, yaw of the best transform so far, and the number of its inliers; updated.
    """
    source, target, distance = among
    first, last = draws
    n, pairs = len(source), len(order)
    exhaustive = pairs > 0
    rows = np.empty(2, np.int64)
    for draw in range(first, last):
        if exhaustive:
            # One step of a Fisher-Yates shuffle: the next pair not yet drawn.
            swap = draw + int(rng.random() * (pairs - draw))
            order[draw], order[swap] = order[swap], order[draw]
            # Pairs are numbered row by row below the diagonal of an n x n table.
            high = int((1.0 + math.sqrt(1.0 + 8.0 * order[draw])) / 2.0)
            rows[0], rows[1] = order[draw] - high * (high - 1) // 2, high
        else:
            rows[0] = int(rng.random() * n)
            rows[1] = int(rng.random() * (n - 1))
            if rows[1] >= rows[0]:
                rows[1] += 1
        gap = math.hypot(source[rows[0], 0] - source[rows[1], 0], source[rows[0], 1] - source[rows[1], 1])
        gap -= math.hypot(target[rows[0], 0] - target[rows[1], 0], target[rows[0], 1] - target[rows[1], 1])
        # A rigid motion keeps distances. If two points differ by more than 2 d, one of them is no inlier.
        if abs(gap) > 2.0 * distance:
            continue
        x, y, yaw = fit(source, target, rows, rows)
        c, s = math.cos(yaw), math.sin(yaw)
        agreeing = 0
        for k in range(n):
            dx = c * source[k, 0] - s * source[k, 1] + x - target[k, 0]
            dy = s * source[k, 0] + c * source[k, 1] + y - target[k, 1]
            if dx * dx + dy * dy < distance * distance:
                agreeing += 1
        if agreeing > best[3]:
            best[0], best[1], best[2], best[3] = x, y, yaw, agreeing
            if agreeing >= ratio * n:
                return draw + 1 - first
    return last - first
