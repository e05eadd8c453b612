"""GLARE signatures, compared by the GLAROT distance (Kallasi and Lodi Rizzini 2016; GLARE: Himstedt et al. 2014).

A landmark's signature is a histogram of the other landmarks around it: 8 bins of direction by 50 bins of distance, up
to a range. The signature of an observation is the sum of those of its landmarks. Rotating an observation shifts the
direction bins, so the distance between two signatures is the smallest L1 distance over all shifts.

A landmark counts as a Gaussian over the bins around it, as in GLARE; otherwise one that noise moves over a border would
change a whole count. Shares are integers (`_UNIT` is one landmark): sums of integers do not depend on the order, and
the compiler vectorises them.
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
        directions, distances: number of bins, as in the paper's comparison.
        reach: metres, range of a signature around its landmark. The paper does not name it; 30 m measured best, because
            farther out, more of the signature lies beyond the sensor's range.
        direction_spread, distance_spread: standard deviation of a landmark's Gaussian, in bins; with 0, a landmark
            counts in one bin only.
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
        local: (N, directions * distances) int32, the signature of each landmark; `_UNIT` is one landmark.
        whole: (directions * distances,) int64, the signature of the observation: the sum of the rows.
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
    """GLAROT distance of the signatures of two observations, as a share of their sum: 0 if equal, 1 if disjoint.

    It is a share, because observations differ in size. The paper's first stage requires it to be small.
    """
    total = int(first.whole.sum()) + int(second.whole.sum())
    return glarot_distance(first.whole, second.whole, config.directions) / max(total, 1)


def glarot_distance(a: NDArray[np.int64], b: NDArray[np.int64], directions: int) -> int:
    """The smallest L1 distance between two signatures (S,) over all shifts of the direction bins."""
    step = len(a) // directions
    return int(min(np.abs(a - np.roll(b, shift * step)).sum() for shift in range(directions)))


def match_glarot(
    first: Signatures, second: Signatures, config: GlarotConfig, *, mutual: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Landmarks of the first (K,) int64, each with its nearest of the second (K,) int64 by GLAROT distance.

    Args:
        mutual: keep only pairs that are nearest to each other. Without it, many correspondences are wrong, and several
            may share a landmark, but RANSAC with verification finds more matches. Only with it does the number of
            correspondences mean something.
    """
    if not len(first.local) or not len(second.local):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    table = distance_table(first.local, second.local, config.directions)
    rows, nearest = np.arange(len(table)), table.argmin(axis=1)
    return keep_mutual(table) if mutual else (rows, nearest)


def keep_mutual(table: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (K,) and columns (K,) of a distance table (N, M) that are each other's nearest."""
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
    """The signatures (N, directions * distances) int32 of landmarks (N, 2), metres; distance varies fastest.

    The other parameters are those of `GlarotConfig`.
    """
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
    """Fill `weights` (K,) with a Gaussian around the middle bin's centre plus `offset`, in bins; they sum to one."""
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
    """GLAROT distances (N, M) int32 between all signatures (N, S) and all signatures (M, S)."""
    size = a.shape[1]
    step = size // directions
    table = np.empty((len(a), len(b)), np.int32)
    turned = np.empty(2 * size, np.int32)
    for j in range(len(b)):
        # Written twice in a row: every shift of it is contiguous in memory.
        turned[:size], turned[size:] = b[j], b[j]
        for i in range(len(a)):
            best = np.int32(2**31 - 1)
            for shift in range(directions):
                row, other = a[i], turned[shift * step : shift * step + size]
                total = np.int32(0)
                for k in range(size):
                    # The compiler widens every int32 result to 64 bits; casting back lets it vectorise the loop.
                    difference = np.int32(row[k] - other[k])
                    total = np.int32(total + max(difference, np.int32(-difference)))
                best = min(best, total)
            table[i, j] = best
    return table
