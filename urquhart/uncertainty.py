"""How sure a transform is: the one place that makes covariances and information matrices.

The error of a least-squares transform is small and independent about the middle of the trees it was fitted to: there
the normal matrix of Gauss-Newton is diagonal. About a frame's origin that lies far away, the error of yaw swings the
position round, and a covariance in double precision loses what it knows of yaw. So the error is kept about the middle
of the trees, and moved to an origin only to be told.

All matrices are (3, 3) float64 over (x, y, yaw): square metres, metre radians, square radians.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.se2 import SE2

Matrix = NDArray[np.float64]

_ROUNDING: Final = 4.0 * np.finfo(np.float64).eps
"""Share of the sum of a covariance's eigenvalues that rounding may have taken from one of them."""
_LEAST_SPREAD: Final = 1e-6
"""Square metres: sum of squared distances from their middle, of trees that all but coincide."""


class UncertaintyNumbers(NamedTuple):
    """When an origin is too far away for a covariance about it. Chosen by hand, not fitted."""

    curved: float = 0.5
    """An origin is far when the curvature of the turn adds this share of the standard deviation of the position."""
    lost: float = 0.01
    """An origin is also far when rounding takes this share of what the covariance about it knows."""


UNCERTAINTY: Final = UncertaintyNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class PoseUncertainty:
    """The error of a transform `target_T_source`, about a point among the trees that it was fitted to.

    Attributes:
        source, target: (2,) float64, metres, that point in the source frame, and in the target frame.
        covariance: (3, 3), of where the point comes to lie, along the axes of the target frame, and of yaw.
        information: (3, 3), its inverse.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    covariance: Matrix
    information: Matrix

    @staticmethod
    def about_point(source: NDArray[np.float64], target_T_source: SE2, covariance: Matrix) -> "PoseUncertainty":
        """The error whose covariance about the point `source` (2,) is known."""
        held = positive(covariance)
        return PoseUncertainty(source, target_T_source.apply(source[None])[0], held, _inverse(held))

    def covariance_about(self, target_T_source: SE2, point: NDArray[np.float64]) -> Matrix:
        """The covariance (3, 3) of where `point` (2,), source frame, comes to lie, target axes, and of yaw.

        Where the point is far away, the second order of the turn counts, too: its second moment is added.
        """
        arm = self._arm(target_T_source, point)
        swing = _swing(arm)
        moved = swing @ self.covariance @ swing.T
        moved[:2, :2] += 0.75 * self.covariance[2, 2] ** 2 * np.outer(arm, arm)
        return positive(moved)

    def origin_covariance(self, target_T_source: SE2) -> Matrix:
        """The covariance (3, 3) over the transform's own x, y and yaw: about the source's origin, target axes."""
        return self.covariance_about(target_T_source, np.zeros(2))

    def source_information(self, target_T_source: SE2, point: NDArray[np.float64] | None = None) -> Matrix:
        """The information (3, 3) about `point` (2,) of the source frame, its origin by default, along its axes.

        That is how pose graphs weigh an edge: of the error log(measured^-1 true), in the frame that the edge leads to.
        """
        back = _swing(-self._arm(target_T_source, np.zeros(2) if point is None else point))
        c, s = math.cos(target_T_source.yaw), math.sin(target_T_source.yaw)
        to_source = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        information = to_source @ back.T @ self.information @ back @ to_source.T
        return np.asarray(0.5 * (information + information.T))

    def is_far(self, target_T_source: SE2) -> bool:
        """Whether the source's origin is so far from the trees that the covariance about it is of little use."""
        arm = math.hypot(*self._arm(target_T_source, np.zeros(2)).tolist())
        place, turn = float(np.diag(self.covariance)[:2].min()), float(self.covariance[2, 2])
        curved = 0.75 * (turn * arm) ** 2 > UNCERTAINTY.curved**2 * place
        return curved or float(np.finfo(np.float64).eps) * arm**4 * turn > UNCERTAINTY.lost * place

    def widened(self, target_T_source: SE2, more: Matrix) -> "PoseUncertainty":
        """The same with an independent error of covariance `more` (3, 3) about the same point added."""
        return PoseUncertainty.about_point(self.source, target_T_source, self.covariance + more)

    def _arm(self, target_T_source: SE2, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """From the point that the error is about to another one, target axes."""
        arm: NDArray[np.float64] = SE2(0.0, 0.0, target_T_source.yaw).apply((point - self.source)[None])[0]
        return arm


def least_squares(trees: NDArray[np.float64], target_T_source: SE2, variance: float) -> PoseUncertainty:
    """The error of a least-squares transform from inliers with isotropic noise.

    Args:
        trees: (K, 2) float64, metres, source frame: the inliers, K >= 1.
        target_T_source: the transform at the optimum.
        variance: of one coordinate of a residual, square metres.
    """
    middle = trees.mean(axis=0)
    spread = max(float(((trees - middle) ** 2).sum()), _LEAST_SPREAD)
    normal = np.array([len(trees), len(trees), spread]) / variance
    target = target_T_source.apply(middle[None])[0]
    return PoseUncertainty(middle, target, np.diag(1.0 / normal), np.diag(normal))


def compose(a_T_b: SE2, covariance: Matrix, b_T_c: SE2, uncertainty: PoseUncertainty) -> PoseUncertainty:
    """The error of a_T_c = a_T_b @ b_T_c, about the same point as the second's, the two errors being independent.

    `covariance` (3, 3): of a_T_b, about the origin of b, along the axes of a.
    """
    turn = np.eye(3)
    turn[:2, :2] = SE2(0.0, 0.0, a_T_b.yaw).apply(np.eye(2)).T
    swing = _swing(turn[:2, :2] @ uncertainty.target)
    composed = swing @ positive(covariance) @ swing.T + turn @ uncertainty.covariance @ turn.T
    return PoseUncertainty.about_point(uncertainty.source, a_T_b @ b_T_c, composed)


def positive(covariance: Matrix) -> Matrix:
    """The matrix (3, 3) made symmetric, and widened just so much that it has no negative eigenvalue."""
    even = np.asarray(0.5 * (covariance + covariance.T), dtype=np.float64)
    eigenvalues = np.linalg.eigvalsh(even)
    least, rounding = float(eigenvalues[0]), _ROUNDING * float(np.abs(eigenvalues).sum())
    return np.asarray(even + (rounding - min(least, 0.0)) * np.eye(3)) if least < rounding else even


def _swing(arm: NDArray[np.float64]) -> Matrix:
    """How an error about a point moves one that lies `arm` (2,) away from it."""
    return np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]], [0.0, 0.0, 1.0]])


def _inverse(covariance: Matrix) -> Matrix:
    """Of a covariance about a point among the trees; scaled first, since metres and radians are of different sizes."""
    scale = np.sqrt(np.diag(covariance))
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))
