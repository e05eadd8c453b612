"""Of the answers given with confidence p, how many are right: over all experiments together, and for each alone."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LEAST: Final = 500
"""Answers in a bin."""
MOST: Final = 24
"""Bins."""


def reliability(answers: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Bins over all answers with a pose, and over those of each experiment, by confidence."""
    kinds = {name: found[found["inliers"] > 0] for name, found in answers.items()}
    everything = np.concatenate(list(kinds.values()))
    return {
        "answers": {name: len(found) for name, found in kinds.items()},
        "bins": bins(everything, LEAST),
        "by_kind": {name: bins(found, min(LEAST, max(len(found) // 12, 20))) for name, found in kinds.items()},
        "expected_error": expected_error(everything),
    }


def bins(answers: NDArray[Any], least: int) -> list[dict[str, float]]:
    """Bins of at least `least` answers, by rising confidence: how many, mean confidence, share that is right.

    Almost all answers are sure of being right or of knowing nothing; borders are laid evenly in log-odds, and bins
    with too few answers are joined with the next.
    """
    order = np.argsort(answers["confidence"], kind="stable")
    p, right = answers["confidence"][order].astype(np.float64), answers["right"][order]
    borders = 1.0 / (1.0 + np.exp(-np.linspace(-7.0, 7.0, MOST)))
    cuts = [0]
    for border in borders:
        at = int(np.searchsorted(p, border))
        if at - cuts[-1] >= least and len(p) - at >= least:
            cuts.append(at)
    cuts.append(len(p))
    return [
        {"count": b - a, "confidence": float(p[a:b].mean()), "right": float(right[a:b].mean())}
        for a, b in pairwise(cuts)
        if b > a
    ]


def expected_error(answers: NDArray[Any]) -> float:
    """Mean over all answers of how far the confidence of their bin is from its share of right ones."""
    found = bins(answers, LEAST)
    total = sum(one["count"] for one in found)
    return float(sum(one["count"] * abs(one["confidence"] - one["right"]) for one in found) / max(total, 1))
