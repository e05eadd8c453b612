"""Stem diameters as evidence. They are never required, and can hardly do harm.

The diameter of one tree says little, those of forty trees say much. Each is standardised within its own stand, as the
logarithm minus the median, divided by the spread. So neither the unit, nor the bias of an instrument, nor ten years of
growth matter. With z_1, z_2 the scores of a pair of partners, and rho their correlation if they are one tree, the
evidence of the pair is the log-likelihood ratio of two correlated normal variables against two independent ones,

    -log(1 - rho^2) / 2 - (rho^2 (z_1^2 + z_2^2) - 2 rho z_1 z_2) / (2 (1 - rho^2)).

rho follows from the share of the spread that is not measurement error: in a plantation of equal stems it is small, and
diameters say little. By chance, a likelihood ratio exceeds e^x with a probability of at most e^-x, so a wrong pose
gains nothing. Half of the prior probability is given to "these diameters are worthless", so a right pose loses at most
log 2.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


class DiameterNumbers(NamedTuple):
    """How far stem diameters are trusted. Chosen by hand, not fitted."""

    error: float = 0.12
    """Usual error of the logarithm of a diameter: about a tenth from measuring, and some growth."""
    fewest: int = 8
    """Fewest diameters that are used: of fewer, the spread is not known."""
    farthest: float = 2.5
    """Scores are clipped here: one mistyped diameter must not outweigh a stand."""
    most_correlation: float = 0.9
    """Largest correlation, however wide the spread of the stand."""


DIAMETERS: Final = DiameterNumbers()


@kernel
def standardize_diameters(diameters: NDArray[np.float32]) -> tuple[NDArray[np.float64], float]:
    """Standardise diameters (N,), any unit, NaN where not known, within their own stand.

    Returns:
        Scores (N,), NaN where the diameter is not known, and the spread of the logarithms. The scores are empty, and
        the spread is 0, if too few diameters are known, or all are about equal.
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
    """Evidence (natural logarithm) from the diameters of pairs: `first` (K,) of the query, `second` (K,) of the submap.

    `query`, `submap`, and their spreads: as `standardize_diameters` returns them.
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
