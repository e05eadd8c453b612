"""One-to-one partners under a transform, and the transform that fits them best.

A landmark of the query is paired with the nearest one of the submap, unless another query landmark is nearer to that.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.se2 import fit
from urquhart.verify.landmark_grid import LandmarkGrid, nearest


class PairingNumbers(NamedTuple):
    """How landmarks are paired. Chosen by hand, not fitted."""

    rounds: int = 4
    """Most rounds of pairing and fitting."""


PAIRING: Final = PairingNumbers()


@kernel
def count_inliers(
    query: NDArray[np.float64],
    submap: LandmarkGrid,
    transforms: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """A fast score (H,) of many transforms: the number of partners within `reach`, weighted by their distance.

    `query`: (N, 2), metres; `transforms`: (H, 3), x, y, yaw of `submap_T_query`, centred frames; `reach`: metres. The
    weight falls from 1 at distance 0 to 0 at `reach`.
    """
    scores = np.zeros(len(transforms))
    for h in range(len(transforms)):
        c, s = math.cos(transforms[h, 2]), math.sin(transforms[h, 2])
        for i in range(len(query)):
            x = c * query[i, 0] - s * query[i, 1] + transforms[h, 0]
            y = s * query[i, 0] + c * query[i, 1] + transforms[h, 1]
            k, distance = nearest(submap, x, y, reach)
            if k >= 0:
                scores[h] += 1.0 - distance / (reach * reach)
    return scores


@kernel
def pair_up(
    query: NDArray[np.float64],
    submap: LandmarkGrid,
    x: float,
    y: float,
    yaw: float,
    reach: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """One-to-one partners of query landmarks (N, 2), metres, under a transform (x, y, yaw of `submap_T_query`).

    Each query landmark claims its nearest submap landmark within `reach` metres; the nearest claim is kept.

    Returns:
        Query indices (K,), submap indices (K,), squared distances (K,), square metres.
    """
    n = len(query)
    c, s = math.cos(yaw), math.sin(yaw)
    partner, distance = np.full(n, -1, np.int64), np.empty(n)
    owner = np.full(len(submap.landmarks), -1, np.int64)
    for i in range(n):
        px, py = c * query[i, 0] - s * query[i, 1] + x, s * query[i, 0] + c * query[i, 1] + y
        k, distance[i] = nearest(submap, px, py, reach)
        if k >= 0:
            partner[i] = k
            if owner[k] < 0 or distance[i] < distance[owner[k]]:
                owner[k] = i
    kept = 0
    first, second, squared = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n)
    for i in range(n):
        k = partner[i]
        if k >= 0 and owner[k] == i:
            first[kept], second[kept], squared[kept] = i, k, distance[i]
            kept += 1
    return first[:kept].copy(), second[:kept].copy(), squared[:kept].copy()


@kernel
def refine(
    query: NDArray[np.float64],
    submap: LandmarkGrid,
    x: float,
    y: float,
    yaw: float,
    reach: float,
) -> tuple[float, float, float]:
    """Refine a transform (x, y, yaw of `submap_T_query`) by least squares over its partners within `reach` metres.

    Pairing and fitting are repeated until the number of partners stays the same, at most `PAIRING.rounds` times.
    """
    previous = -1
    for _ in range(PAIRING.rounds):
        first, second, _ = pair_up(query, submap, x, y, yaw, reach)
        if len(first) < 3:
            break
        x, y, yaw = fit(query, submap.landmarks, first, second)
        total = len(first)
        if total == previous:
            break
        previous = total
    return x, y, yaw
