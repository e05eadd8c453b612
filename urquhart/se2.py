"""Rigid transforms of the plane.

A transform is named by its frames, target first: `submap_T_query` takes points of the query frame to the submap frame,
p_submap = R(yaw) p_query + t. Metres, radians, counter-clockwise.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel


@dataclass(frozen=True, slots=True)
class SE2:
    """A rigid transform: rotation by `yaw` (radians, counter-clockwise), then translation by (`x`, `y`) metres."""

    x: float
    y: float
    yaw: float

    @staticmethod
    def identity() -> "SE2":
        """The identity transform."""
        return SE2(0.0, 0.0, 0.0)

    @staticmethod
    def shift(offset: NDArray[np.float64]) -> "SE2":
        """Translation by `offset` (2,), metres, without rotation."""
        return SE2(float(offset[0]), float(offset[1]), 0.0)

    def apply(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points (N, 2), metres, from the source frame to the target frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turned = np.asarray(xy, dtype=np.float64) @ np.array([[c, s], [-s, c]])
        return np.asarray(turned + np.array([self.x, self.y]))

    def inverse(self) -> "SE2":
        """`b_T_a` of `a_T_b`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return SE2(-c * self.x - s * self.y, s * self.x - c * self.y, wrap(-self.yaw))

    def __matmul__(self, other: "SE2") -> "SE2":
        """`a_T_b @ b_T_c` is `a_T_c`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return SE2(self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, wrap(self.yaw + other.yaw))

    def distance(self, other: "SE2") -> tuple[float, float]:
        """Translation (metres) and rotation (radians, >= 0) between two transforms with the same frames."""
        return math.hypot(self.x - other.x, self.y - other.y), abs(wrap(self.yaw - other.yaw))


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


@kernel
def fit(
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    pairs_source: NDArray[np.int64],
    pairs_target: NDArray[np.int64],
) -> tuple[float, float, float]:
    """Least-squares rigid transform (x, y, yaw) that takes `source[pairs_source]` onto `target[pairs_target]`.

    `source`, `target`: (N, 2) and (M, 2) float64, metres. The closed form for the plane (Umeyama 1991, without scale):
    the rotation is the argument of the complex correlation of the centred sets. At least two distinct pairs are needed.
    """
    n = len(pairs_source)
    ax = ay = bx = by = 0.0
    for k in range(n):
        i, j = pairs_source[k], pairs_target[k]
        ax += source[i, 0]
        ay += source[i, 1]
        bx += target[j, 0]
        by += target[j, 1]
    ax, ay, bx, by = ax / n, ay / n, bx / n, by / n
    dot = cross = 0.0
    for k in range(n):
        i, j = pairs_source[k], pairs_target[k]
        px, py = source[i, 0] - ax, source[i, 1] - ay
        qx, qy = target[j, 0] - bx, target[j, 1] - by
        dot += px * qx + py * qy
        cross += px * qy - py * qx
    yaw = math.atan2(cross, dot)
    c, s = math.cos(yaw), math.sin(yaw)
    return bx - c * ax + s * ay, by - s * ax - c * ay, yaw
