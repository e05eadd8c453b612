"""Stem diameters as evidence: never required, and never able to do harm.

A diameter tells little of one tree and much of forty. Only its rank within its own stand is used, so that neither the
unit nor the instrument's bias nor ten years of growth matter: logarithms, less their median, over their spread. With
z_1, z_2 such scores of a pair of partners and rho their correlation if they are one tree, the pair's evidence is the
log-likelihood ratio of two correlated normal variables against two independent ones,

    -log(1 - rho^2) / 2 - (rho^2 (z_1^2 + z_2^2) - 2 rho z_1 z_2) / (2 (1 - rho^2)).

rho is what measuring twice leaves of the spread: in a plantation of equal stems it is small, and diameters say little.
A likelihood ratio exceeds e^x by chance with a probability of e^-x at most, so that a wrong pose gains nothing by it;
and because half of all prior belief stays with "these diameters are worthless", a right one loses no more than log 2.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


class DiameterNumbers(NamedTuple):
    """How far stem diameters are trusted. Chosen by hand, not fitted."""

    error: float = 0.12
    """Usual error of the logarithm of a diameter between two measurements of a tree: a tenth of it and some growth."""
    fewest: int = 8
    """With fewer diameters than this their spread is not known, and none is used."""
    farthest: float = 2.5
    """Scores are cut off here: one stem that was mistyped must not outweigh a stand."""
    most_correlation: float = 0.9
    """Correlation never believed to be higher, however wide the stand's spread."""


DIAMETERS: Final = DiameterNumbers()


@kernel
def standardize_diameters(diameters: NDArray[np.float32]) -> tuple[NDArray[np.float64], float]:
    """Scores (N,) of diameters within their own stand, NaN where not known, and the spread of their logarithms.

    Scores are empty, and the spread is 0, where too few diameters are known or all are alike.
    """
    logs = np.log(diameters.astype(np.float64))
    known = logs[~np.isnan(logs)]
    if len(known) < DIAMETERS.fewest:
        return np.empty(0), 0.0
    middle = np.median(known)
    # 1.4826 times the median deviation is the standard deviation of a normal variable.
    spread = 1.4826 * np.median(np.abs(known - middle))
    if spread <= DIAMETERS.error:
        return np.empty(0), 0.0
    scores = np.empty(len(logs))
    for i in range(len(logs)):
        score = (logs[i] - middle) / spread
        scores[i] = score if math.isnan(score) else min(max(score, -DIAMETERS.farthest), DIAMETERS.farthest)
    return scores, spread


@kernel
def score_diameter_pairs(
    query: NDArray[np.float64],
    query_spread: float,
    submap: NDArray[np.float64],
    submap_spread: float,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> float:
    """Evidence from the diameters of partners `first` (K,) of the query and `second` (K,) of the submap.

    `query`, `submap`: scores as `standardize_diameters` gives them.
    """
    if len(query) == 0 or len(submap) == 0:
        return 0.0
    shared = 1.0 - (DIAMETERS.error / min(query_spread, submap_spread)) ** 2
    rho = min(max(shared, 0.0), DIAMETERS.most_correlation)
    left = 1.0 - rho * rho
    total = 0.0
    for k in range(len(first)):
        a, b = query[first[k]], submap[second[k]]
        if not (math.isnan(a) or math.isnan(b)):
            total -= 0.5 * math.log(left) + (rho * rho * (a * a + b * b) - 2.0 * rho * a * b) / (2.0 * left)
    if total > 0.0:
        return total + math.log(0.5 + 0.5 * math.exp(-total))
    return math.log(0.5 + 0.5 * math.exp(max(total, -700.0)))
