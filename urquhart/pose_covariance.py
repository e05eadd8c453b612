"""The uncertainty of a transform. Covariances and information matrices are made here and nowhere else.

About the centroid of the trees that a least-squares transform was fitted to, the errors of x, y and yaw are
independent: the Gauss-Newton normal matrix is diagonal there. About an origin far away, an error of yaw also moves the
position, and double precision no longer resolves the yaw in such a covariance. So the uncertainty is stored about the
centroid, and moved to an origin only for output.

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
_CLEAR: Final = 16.0 * _ROUNDING
"""Share of the cubed trace that a determinant must have to be surely not a result of rounding."""
_LEAST_SPREAD: Final = 1e-6
"""Square metres: least sum of squared distances of the trees from their centroid, so that no matrix is singular."""


class UncertaintyNumbers(NamedTuple):
    """When an origin is too far away for a covariance about it to be useful. Chosen by hand, not fitted."""

    curved: float = 0.5
    """An origin is far if the curvature of the rotation adds this share of the position's standard deviation."""
    lost: float = 0.01
    """An origin is also far if rounding takes this share of the information in the covariance about it."""


UNCERTAINTY: Final = UncertaintyNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class PoseUncertainty:
    """The uncertainty of a transform `target_T_source`, about a reference point among the trees it was fitted to.

    Attributes:
        source, target: (2,) float64, metres, the reference point in the source frame and in the target frame.
        covariance: (3, 3) float64 over (x, y, yaw): of the transformed reference point along the axes of the target
            frame, in square metres, and of the yaw, in square radians.
        information: (3, 3) float64, the inverse of the covariance.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    covariance: Matrix
    information: Matrix

    @staticmethod
    def about_point(source: NDArray[np.float64], target_T_source: SE2, covariance: Matrix) -> "PoseUncertainty":
        """The uncertainty with the given covariance (3, 3) about the point `source` (2,), metres, source frame."""
        held = positive(covariance)
        return PoseUncertainty(source, target_T_source.apply(source[None])[0], held, _inverse(held))

    def position_of(self, target_T_source: SE2, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """The position (2,), metres, target frame, of a `point` (2,), metres, source frame, near the reference point.

        It comes from the reference point, so rounding does not grow with the distance to the frames' origins.
        """
        return np.asarray(self.target + np.array(self._arm(target_T_source, point)))

    def shift_of(self, target_T_source: SE2, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far (2,), metres, the coordinates of a `point` (2,), metres, source frame, differ in the target frame."""
        arm = point - self.source
        return np.asarray((self.target - self.source) + (np.array(self._arm(target_T_source, point)) - arm))

    def covariance_about(self, target_T_source: SE2, point: NDArray[np.float64]) -> Matrix:
        """The covariance (3, 3) about another `point` (2,), metres, source frame; axes of the target frame.

        It includes the second moment of the second-order term of the rotation, which matters for far points.
        """
        x, y = self._arm(target_T_source, point)
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = self.covariance.tolist()
        # S C S^T with the Jacobian S of `_swing`, term by term: numpy takes five times as long for a 3 x 3 matrix.
        moved_xt, moved_yt, second = xt - y * tt, yt + x * tt, 0.75 * tt * tt
        moved_xx = xx - y * xt - y * moved_xt + second * x * x
        moved_xy = xy + x * xt - y * moved_yt + second * x * y
        moved_yy = yy + x * yt + x * moved_yt + second * y * y
        moved = ((moved_xx, moved_xy, moved_xt), (moved_xy, moved_yy, moved_yt), (moved_xt, moved_yt, tt))
        return positive(np.array(moved))

    def origin_covariance(self, target_T_source: SE2) -> Matrix:
        """The covariance (3, 3) of the transform's own x, y and yaw: about the source's origin, target axes."""
        return self.covariance_about(target_T_source, np.zeros(2))

    def source_information(self, target_T_source: SE2, point: NDArray[np.float64] | None = None) -> Matrix:
        """The information (3, 3) about `point` (2,), metres, along the axes of the source frame.

        By default the point is the source's origin. Pose graphs weight an edge this way: by the information of the
        error log(measured^-1 true), in the frame that the edge leads to.
        """
        back = _swing(-np.array(self._arm(target_T_source, np.zeros(2) if point is None else point)))
        c, s = math.cos(target_T_source.yaw), math.sin(target_T_source.yaw)
        to_source = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        information = to_source @ back.T @ self.information @ back @ to_source.T
        return np.asarray(0.5 * (information + information.T))

    def is_far(self, target_T_source: SE2) -> bool:
        """Whether the source's origin is too far from the trees for a covariance about it (`UNCERTAINTY`)."""
        arm = math.hypot(*self._arm(target_T_source, np.zeros(2)))
        place, turn = float(np.diag(self.covariance)[:2].min()), float(self.covariance[2, 2])
        curved = 0.75 * (turn * arm) ** 2 > UNCERTAINTY.curved**2 * place
        return curved or float(np.finfo(np.float64).eps) * arm**4 * turn > UNCERTAINTY.lost * place

    def widened(self, target_T_source: SE2, more: Matrix) -> "PoseUncertainty":
        """The same uncertainty plus an independent error with covariance `more` (3, 3) about the same point."""
        return PoseUncertainty.about_point(self.source, target_T_source, self.covariance + more)

    def _arm(self, target_T_source: SE2, point: NDArray[np.float64]) -> tuple[float, float]:
        """The vector, metres, from the reference point to `point`, along the axes of the target frame.

        Not by arrays, which take five times as long for one point; an answer with five candidates has 20 of these.
        """
        (x, y), (middle_x, middle_y) = point.tolist(), self.source.tolist()
        c, s = math.cos(target_T_source.yaw), math.sin(target_T_source.yaw)
        x, y = x - middle_x, y - middle_y
        return c * x - s * y, s * x + c * y


def least_squares(trees: NDArray[np.float64], target_T_source: SE2, variance: float) -> PoseUncertainty:
    """The uncertainty of a least-squares transform that was fitted to inliers with isotropic noise.

    Args:
        trees: (K, 2) float64, metres, source frame: the inliers, K >= 1.
        target_T_source: the transform at the optimum.
        variance: square metres, the variance of one coordinate of a residual.
    """
    middle = trees.mean(axis=0)
    spread = max(float(((trees - middle) ** 2).sum()), _LEAST_SPREAD)
    normal = np.array([len(trees), len(trees), spread]) / variance
    target = target_T_source.apply(middle[None])[0]
    return PoseUncertainty(middle, target, np.diag(1.0 / normal), np.diag(normal))


def compose(a_T_b: SE2, covariance: Matrix, b_T_c: SE2, uncertainty: PoseUncertainty) -> PoseUncertainty:
    """The uncertainty of a_T_c = a_T_b @ b_T_c, if the errors of both are independent.

    Args:
        covariance: (3, 3), of a_T_b, about the origin of b, along the axes of a.
        uncertainty: of b_T_c; the result is about the same reference point.
    """
    turn = np.eye(3)
    turn[:2, :2] = SE2(0.0, 0.0, a_T_b.yaw).apply(np.eye(2)).T
    swing = _swing(turn[:2, :2] @ uncertainty.target)
    composed = swing @ positive(covariance) @ swing.T + turn @ uncertainty.covariance @ turn.T
    return PoseUncertainty.about_point(uncertainty.source, a_T_b @ b_T_c, composed)


def positive(covariance: Matrix) -> Matrix:
    """The symmetric part of a matrix (3, 3), plus just enough of the identity to make every eigenvalue positive."""
    even = np.asarray(0.5 * (covariance + covariance.T), dtype=np.float64)
    if _is_clearly_positive(even):
        return even
    eigenvalues = np.linalg.eigvalsh(even)
    least, rounding = float(eigenvalues[0]), _ROUNDING * float(np.abs(eigenvalues).sum())
    return np.asarray(even + (rounding - min(least, 0.0)) * np.eye(3)) if least < rounding else even


def _is_clearly_positive(matrix: Matrix) -> bool:
    """Whether the least eigenvalue of a symmetric matrix (3, 3) is surely above rounding.

    The product of the two larger eigenvalues is at most a quarter of the squared trace, so the determinant bounds the
    least one. This takes a fifth of the time that the eigenvalues take, and is the case unless the origin is far away.
    """
    (a, b, c), (_, d, e), (_, _, f) = matrix.tolist()
    trace = a + d + f
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    return bool(a > 0.0 and a * d > b * b and determinant > _CLEAR * trace**3)


def _swing(arm: NDArray[np.float64]) -> Matrix:
    """The Jacobian (3, 3) that moves an error about a point to one about the point `arm` (2,), metres, away."""
    return np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]], [0.0, 0.0, 1.0]])


def _inverse(covariance: Matrix) -> Matrix:
    """The inverse of a covariance. It is scaled first, because metres and radians differ in size."""
    scale = np.sqrt(np.diag(covariance))
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))
