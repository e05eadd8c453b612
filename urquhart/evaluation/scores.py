"""Scores: pose errors, precision and recall, alignment of landmarks. Arrays in, numbers out; no plotting."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.se2 import SE2

TRANSLATION: Final = 10.0**0.5
"""Metres: the paper asks for a squared translation error below 10 (section V-B)."""
ROTATION: Final = np.radians(20.0)
"""Radians: the paper's bound on the rotation error."""


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Reported pairs that are right and wrong, and positive pairs that were not reported."""

    true_positives: int
    false_positives: int
    false_negatives: int

    @property
    def precision(self) -> float:
        """Right among the reported; 1 where nothing was reported."""
        reported = self.true_positives + self.false_positives
        return self.true_positives / reported if reported else 1.0

    @property
    def recall(self) -> float:
        """Right among the right and the missed; 1 where there was nothing to find."""
        wanted = self.true_positives + self.false_negatives
        return self.true_positives / wanted if wanted else 1.0

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 0 where nothing is right."""
        total = self.precision + self.recall
        return 2.0 * self.precision * self.recall / total if self.true_positives and total else 0.0

    def __add__(self, other: "Outcomes") -> "Outcomes":
        return Outcomes(
            self.true_positives + other.true_positives,
            self.false_positives + other.false_positives,
            self.false_negatives + other.false_negatives,
        )


def score(reported: NDArray[np.bool_], right: NDArray[np.bool_], positive: NDArray[np.bool_]) -> Outcomes:
    """Outcomes over pairs, each array (P,) bool.

    Args:
        reported: the method says the pair is a match.
        right: the transform it gives is within the bounds; what it says of pairs it does not report is not looked at.
        positive: the true poses are near enough for the pair to count as missed when it is not reported.
    """
    return Outcomes(int((reported & right).sum()), int((reported & ~right).sum()), int((positive & ~reported).sum()))


def sweep(
    strength: NDArray[np.float64],
    right: NDArray[np.bool_],
    positive: NDArray[np.bool_],
    thresholds: Sequence[float],
) -> list[Outcomes]:
    """Outcomes when pairs of at least each threshold's strength (say, correspondences) are reported."""
    return [score(strength >= threshold, right, positive) for threshold in thresholds]


def pose_errors(
    found: NDArray[np.float64], truth: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Translation (P,), metres, and rotation (P,), radians, between transforms (P, 3): x, y, yaw.

    Frames: both `a_T_b`; the translation error is that of the origin of b in a, as in the paper's
    || T(t_i) - H T(t_j) ||.
    """
    turn = (found[:, 2] - truth[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return np.hypot(found[:, 0] - truth[:, 0], found[:, 1] - truth[:, 1]), np.abs(turn)


def is_right(found: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which transforms (P, 3) are within the paper's bounds of the true ones; NaN rows are not."""
    shift, turn = pose_errors(found, truth)
    return np.asarray((shift < TRANSLATION) & (turn < ROTATION))


@dataclass(frozen=True, slots=True)
class Alignment:
    """Distances between landmarks that are the same tree, after alignment: metres, and how many there are."""

    mean: float
    least: float
    most: float
    pairs: int

    @staticmethod
    def over(distances: NDArray[np.float64]) -> "Alignment":
        """Of distances (K,), metres; NaN where there are none."""
        if not len(distances):
            return Alignment(np.nan, np.nan, np.nan, 0)
        return Alignment(float(distances.mean()), float(distances.min()), float(distances.max()), len(distances))


def alignment_errors(
    first: NDArray[np.float64], second: NDArray[np.float64], first_T_second: SE2
) -> NDArray[np.float64]:
    """How far a transform leaves true pairs apart (K,), metres: row i of `first` (K, 2) and of `second` (K, 2).

    Both in metres, each in its own frame; what the paper's Table II takes mean, minimum and maximum of.
    """
    gap = first - first_T_second.apply(second)
    return np.asarray(np.hypot(gap[:, 0], gap[:, 1]))


def mean_outcome(outcomes: Sequence[Outcomes]) -> tuple[float, float, float]:
    """Average precision, recall and F1 of several experiments, each counting alike (the paper's way with its cells)."""
    return (
        float(np.mean([outcome.precision for outcome in outcomes])),
        float(np.mean([outcome.recall for outcome in outcomes])),
        float(np.mean([outcome.f1 for outcome in outcomes])),
    )
