"""GLARE signatures compared with the GLAROT distance (Kallasi and Lodi Rizzini 2016; GLARE: Himstedt et al. 2014).

A landmark's signature is a histogram of where the other landmarks are around it: 8 bins of direction by 50 bins of
distance, up to a range. The signature of an observation adds up those of its landmarks. Turning an observation shifts
the direction bins, so the distance between two signatures is the smallest L1 distance over all shifts.

A landmark counts as a Gaussian over the bins about it, as in GLARE: without that, one that noise moves over a border
changes a whole count. Shares are kept as whole numbers (`_UNIT` is one landmark): sums of integers need no order and
run many at a time.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel

_UNIT: Final = 1024


@dataclass(frozen=True, slots=True)
class GlarotConfig:
    """Bins of direction and distance as in the paper's comparison, range in metres, spread of a landmark in bins."""

    directions: int = 8
    distances: int = 50
    reach: float = 30.0
    direction_spread: float = 0.5
    distance_spread: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Signatures:
    """Signatures of one observation: (N, directions * distances) int32 for its landmarks, one row for the whole."""

    landmarks: NDArray[np.float64]
    local: NDArray[np.int32]
    whole: NDArray[np.int32]


def describe_glare(landmarks: NDArray[np.float64], config: GlarotConfig) -> Signatures:
    """Signatures of landmarks (N, 2) float64, metres."""
    local = local_signatures(
        landmarks, config.directions, config.distances, config.reach, config.direction_spread, config.distance_spread
    )
    return Signatures(landmarks, local, local.sum(axis=0, dtype=np.int32))


def global_distance(first: Signatures, second: Signatures, config: GlarotConfig) -> float:
    """GLAROT distance of the global signatures, as a share of all they hold: 0 alike, 1 nothing in common.

    A share, because observations differ in size; the paper's first stage asks for it to be small.
    """
    total = int(first.whole.sum()) + int(second.whole.sum())
    return glarot_distance(first.whole, second.whole, config.directions) / max(total, 1)


def match_glarot(
    first: Signatures, second: Signatures, config: GlarotConfig
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each landmark of the first (K,) int64 with its nearest of the second (K,) int64 by GLAROT distance.

    Not one-to-one: many are wrong, and RANSAC sorts them out far better than a threshold or a check in both directions.
    """
    nearest = distance_table(first.local, second.local, config.directions).argmin(axis=1)
    return np.arange(len(nearest)), nearest


@kernel
def local_signatures(
    landmarks: NDArray[np.float64],
    directions: int,
    distances: int,
    reach: float,
    direction_spread: float,
    distance_spread: float,
) -> NDArray[np.int32]:
    """One row (directions * distances) int32 for each landmark, in `_UNIT`; direction is the slower index."""
    n = len(landmarks)
    rows = np.zeros((n, directions * distances), np.int32)
    by_direction, by_distance = np.empty(3), np.empty(7)
    for i in range(n):
        for j in range(n):
            dx, dy = landmarks[j, 0] - landmarks[i, 0], landmarks[j, 1] - landmarks[i, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            if i == j or distance >= reach:
                continue
            turn = np.arctan2(dy, dx) / (2.0 * np.pi) % 1.0 * directions
            ring = distance / reach * distances
            a, r = int(turn), int(ring)
            spread_over(by_direction, turn - a - 0.5, direction_spread)
            spread_over(by_distance, ring - r - 0.5, distance_spread)
            for da in range(3):
                row = (a + da - 1) % directions * distances
                for dr in range(7):
                    if 0 <= r + dr - 3 < distances:
                        rows[i, row + r + dr - 3] += round(by_direction[da] * by_distance[dr] * _UNIT)
    return rows


@kernel
def spread_over(weights: NDArray[np.float64], offset: float, spread: float) -> None:
    """Fill `weights` with a Gaussian about the middle bin's centre plus `offset`, bins, so that they sum to one."""
    total = 0.0
    for k in range(len(weights)):
        weights[k] = np.exp(-0.5 * ((k - len(weights) // 2 - offset) / spread) ** 2)
        total += weights[k]
    for k in range(len(weights)):
        weights[k] /= total


def glarot_distance(a: NDArray[np.int32], b: NDArray[np.int32], directions: int) -> int:
    """Smallest L1 distance between two signatures (S,) over all shifts of direction."""
    return int(distance_table(a[None], b[None], directions)[0, 0])


@kernel
def distance_table(a: NDArray[np.int32], b: NDArray[np.int32], directions: int) -> NDArray[np.int32]:
    """GLAROT distance (N, M) int32 between every two rows of (N, S) and (M, S)."""
    size = a.shape[1]
    step = size // directions
    table = np.empty((len(a), len(b)), np.int32)
    turned = np.empty(2 * size, np.int32)
    for j in range(len(b)):
        # Written twice in a row, every shift of it is one run of memory.
        turned[:size], turned[size:] = b[j], b[j]
        for i in range(len(a)):
            best = np.int32(2**31 - 1)
            for shift in range(directions):
                total = np.int32(0)
                start = shift * step
                for k in range(size):
                    total += abs(a[i, k] - turned[start + k])
                best = min(best, total)
            table[i, j] = best
    return table
