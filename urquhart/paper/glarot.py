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
    """Parameters of GLARE and GLAROT.

    Attributes:
        directions, distances: bins, as in the paper's comparison.
        reach: metres, how far about a landmark its signature looks. The paper does not say; 30 m measured best, because
            farther out more of it lies beyond the sensor's range or was not there the other time.
        direction_spread, distance_spread: standard deviation of a landmark's Gaussian, bins; 0 counts it whole in the
            bin where it lies.
    """

    directions: int = 8
    distances: int = 50
    reach: float = 30.0
    direction_spread: float = 0.5
    distance_spread: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Signatures:
    """Signatures of one observation.

    Attributes:
        landmarks: (N, 2) float64, metres, the observation's frame.
        local: (N, directions * distances) int32, a row for each landmark, in units of `_UNIT` to the landmark.
        whole: (directions * distances,) int64, the sum of the rows: the signature of the observation.
    """

    landmarks: NDArray[np.float64]
    local: NDArray[np.int32]
    whole: NDArray[np.int64]


def describe_glare(landmarks: NDArray[np.float64], config: GlarotConfig) -> Signatures:
    """Signatures of landmarks (N, 2) float64, metres, any rigid frame."""
    local = local_signatures(
        landmarks, config.directions, config.distances, config.reach, config.direction_spread, config.distance_spread
    )
    return Signatures(landmarks, local, local.sum(axis=0, dtype=np.int64))


def global_distance(first: Signatures, second: Signatures, config: GlarotConfig) -> float:
    """GLAROT distance of the global signatures, as a share of all they hold: 0 alike, 1 nothing in common.

    A share, because observations differ in size; the paper's first stage asks for it to be small.
    """
    total = int(first.whole.sum()) + int(second.whole.sum())
    return glarot_distance(first.whole, second.whole, config.directions) / max(total, 1)


def glarot_distance(a: NDArray[np.int64], b: NDArray[np.int64], directions: int) -> int:
    """Smallest L1 distance between two signatures (S,) over all shifts of direction."""
    step = len(a) // directions
    return int(min(np.abs(a - np.roll(b, shift * step)).sum() for shift in range(directions)))


def match_glarot(
    first: Signatures, second: Signatures, config: GlarotConfig, *, mutual: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each landmark of the first (K,) int64 with its nearest of the second (K,) int64 by GLAROT distance.

    Args:
        mutual: keep only pairs that are nearest to each other. Without it many correspondences are wrong and several
            may share a landmark; a RANSAC with a verification behind it makes more of those than of a few. Their number
            alone says something only with it.
    """
    if not len(first.local) or not len(second.local):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    table = distance_table(first.local, second.local, config.directions)
    rows, nearest = np.arange(len(table)), table.argmin(axis=1)
    return keep_mutual(table) if mutual else (rows, nearest)


def keep_mutual(table: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (K,) and columns (K,) of a distance table (N, M) that are nearest to each other."""
    nearest = table.argmin(axis=1)
    rows = np.flatnonzero(table.argmin(axis=0)[nearest] == np.arange(len(table)))
    return rows, nearest[rows]


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
    if spread <= 0.0:
        weights[:] = 0.0
        weights[len(weights) // 2] = 1.0
        return
    total = 0.0
    for k in range(len(weights)):
        weights[k] = np.exp(-0.5 * ((k - len(weights) // 2 - offset) / spread) ** 2)
        total += weights[k]
    for k in range(len(weights)):
        weights[k] /= total


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
                row, other = a[i], turned[shift * step : shift * step + size]
                total = np.int32(0)
                for k in range(size):
                    # The compiler widens every int32 result to 64 bits; cast back at once, many run at a time.
                    difference = np.int32(row[k] - other[k])
                    total = np.int32(total + max(difference, np.int32(-difference)))
                best = min(best, total)
            table[i, j] = best
    return table
