"""Scores of answers: pose errors, precision and recall, alignment of landmarks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.se2 import SE2

TRANSLATION: Final = 10.0**0.5
"""Metres: the paper's bound on the translation error, whose square must be below 10 (section V-B)."""
ROTATION: Final = np.radians(20.0)
"""Radians: the paper's bound on the rotation error (section V-B)."""


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Counts of pairs: reported and right, reported and wrong, and positive but not reported."""

    true_positives: int
    false_positives: int
    false_negatives: int

    @property
    def precision(self) -> float:
        """Share of the reported pairs that are right; 1 if nothing was reported."""
        reported = self.true_positives + self.false_positives
        return self.true_positives / reported if reported else 1.0

    @property
    def recall(self) -> float:
        """Share of the right and missed pairs that are right; 1 if there was nothing to find."""
        wanted = self.true_positives + self.false_negatives
        return self.true_positives / wanted if wanted else 1.0

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 0 if nothing is right."""
        total = self.precision + self.recall
        return 2.0 * self.precision * self.recall / total if self.true_positives and total else 0.0

    def __add__(self, other: "Outcomes") -> "Outcomes":
        return Outcomes(
            self.true_positives + other.true_positives,
            self.false_positives + other.false_positives,
            self.false_negatives + other.false_negatives,
        )


def score(reported: NDArray[np.bool_], right: NDArray[np.bool_], positive: NDArray[np.bool_]) -> Outcomes:
    """The outcomes of P pairs; each array is (P,) bool.

    Args:
        reported: whether the method reports the pair as a match.
        right: whether the transform is within the bounds; ignored for pairs that are not reported.
        positive: whether the true poses are so near that the pair counts as missed if it is not reported.
    """
    return Outcomes(int((reported & right).sum()), int((reported & ~right).sum()), int((positive & ~reported).sum()))


def outcomes_by_threshold(
    strength: NDArray[np.float64],
    right: NDArray[np.bool_],
    positive: NDArray[np.bool_],
    thresholds: Sequence[float],
) -> list[Outcomes]:
    """The outcomes for each threshold, if the pairs whose `strength` (P,) reaches it are reported.

    `strength`: for example the number of correspondences; `right`, `positive`: as in `score`.
    """
    return [score(strength >= threshold, right, positive) for threshold in thresholds]


def pose_errors(
    found: NDArray[np.float64], truth: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Translation errors (P,), metres, and rotation errors (P,), radians, of transforms (P, 3): x, y, yaw.

    Both are `a_T_b`. The translation error is that of b's origin in a, as in the paper (section V-B):
    || T(t_i) - H T(t_j) ||.
    """
    turn = (found[:, 2] - truth[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return np.hypot(found[:, 0] - truth[:, 0], found[:, 1] - truth[:, 1]), np.abs(turn)


def is_right(found: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which transforms (P, 3) are within the paper's bounds of the true ones (section V-B): (P,) bool; NaN is not."""
    shift, turn = pose_errors(found, truth)
    return np.asarray((shift < TRANSLATION) & (turn < ROTATION))


@dataclass(frozen=True, slots=True)
class Alignment:
    """Distances between landmarks that are the same tree, after alignment: mean, least and most, metres; and count."""

    mean: float
    least: float
    most: float
    pairs: int

    @staticmethod
    def over(distances: NDArray[np.float64]) -> "Alignment":
        """The alignment of distances (K,), metres; NaN if there are none."""
        if not len(distances):
            return Alignment(np.nan, np.nan, np.nan, 0)
        return Alignment(float(distances.mean()), float(distances.min()), float(distances.max()), len(distances))


def alignment_errors(
    first: NDArray[np.float64], second: NDArray[np.float64], first_T_second: SE2
) -> NDArray[np.float64]:
    """Distances (K,), metres, between true pairs after a transform; the paper's Table II summarises them.

    `first`, `second`: (K, 2), metres, each in its own frame; row i of one and row i of the other are the same tree.
    """
    gap = first - first_T_second.apply(second)
    return np.asarray(np.hypot(gap[:, 0], gap[:, 1]))


def mean_outcome(outcomes: Sequence[Outcomes]) -> tuple[float, float, float]:
    """Mean precision, recall and F1 of several experiments with equal weights, as the paper averages its cells."""
    return (
        float(np.mean([outcome.precision for outcome in outcomes])),
        float(np.mean([outcome.recall for outcome in outcomes])),
        float(np.mean([outcome.f1 for outcome in outcomes])),
    )
