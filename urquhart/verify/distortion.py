"""Whether what is left between matched trees is noise, or shows that one side is distorted: tilted, scaled or bent.

A rigid transform explains two sightings of the same trees up to noise. A tilted sensor shortens one direction, a wrong
unit or range stretches all of them, and a trajectory that drifts within a submap bends it. What is left after the
transform is fitted by these fields, one after the other; each must explain more than noise would in one of a thousand.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from urquhart.se2 import SE2


class DistortionNumbers(NamedTuple):
    """When a match shows a distortion, and how large that can be. Chosen by hand, not fitted, unless a field says
    otherwise."""

    false_alarms: float = 1e-3
    """Share of undistorted matches in which each of the two tests errs, which `tests/urquhart/test_distortion.py`
    counts."""
    largest: float = 0.1
    """Displacement that a distortion brings about as far from the middle as the trees are spread, as a share of that
    distance: a tenth is a scale of 1.1, or a tilt by 25 degrees."""
    fewest: int = 4
    """Residuals that must be left over, for a test to say anything."""
    height: float = 1.3
    """Metres between a sensor and the height at which stems are measured (breast height, 1.3 m, by convention): seen
    from a tilted sensor, all stems are off by its sine times this."""
    neither: float = 13.8
    """Squared standard deviations beyond which a stretch is neither a tilt nor a scale. Follows from `false_alarms`:
    the chi-square quantile for two numbers is -2 log(0.001)."""
    near: float = 2.0
    """An origin among the trees, where the sensor may have been, is no more than this many times their spread away."""


DISTORTION: Final = DistortionNumbers()
_RIGID, _AFFINE, _BENT = 3, 6, 12
"""Numbers that a field has: rigid, stretched along two directions, and bent."""

WARNINGS: Final[Mapping[str, str]] = {
    "tilted": "one direction is longer than the other on one side: a sensor was tilted, or drifted along a line",
    "scaled": "one side is larger than the other: a unit, a range calibration or a map's scale is off",
    "bent": "one side is bent: it was gathered along a trajectory that drifted",
    "far_origin": "the query's origin is far from its trees: use the covariance about their middle (`middle`)",
    "mirrored": "nothing was found, but a mirror image of the query is: an axis or the direction of angles is reversed",
}
"""What each warning means."""

Field = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Distortion:
    """What is wrong with the shape of one of two sightings.

    Attributes:
        words: `tilted`, `scaled`, `bent`; none where noise explains everything.
        covariance: (3, 3) float64 over (x, y, yaw) about the middle of the trees, target axes: how far off the
            transform may be because of it, beyond noise.
    """

    words: tuple[str, ...]
    covariance: NDArray[np.float64]


def find_distortion(source: Field, target: Field, target_T_source: SE2) -> Distortion:
    """Look for a distortion in what a least-squares transform leaves between pairs of trees.

    Args:
        source, target: (K, 2) float64, metres: the trees of either side in its own frame, pair by pair.
        target_T_source: the transform at the optimum.
    """
    none = Distortion((), np.zeros((3, 3)))
    if 2 * len(source) < _AFFINE + DISTORTION.fewest:
        return none
    middle = source.mean(axis=0)
    turn = SE2(0.0, 0.0, target_T_source.yaw)
    trees, there = turn.apply(source - middle), target_T_source.apply(middle[None])[0]
    spread = max(float(np.sqrt((trees**2).mean())), 1e-9)
    left = (target - there - trees).T.ravel()
    size = _BENT if 2 * len(source) >= _BENT + DISTORTION.fewest else _AFFINE
    fit = _Fit(_fields(trees / spread)[:, :size], left, DISTORTION.largest * spread)
    strained = fit.explains(_RIGID, _AFFINE)
    bent = size == _BENT and fit.explains(_AFFINE, _BENT)
    if not (strained or bent):
        return none
    values, spreads = fit.solve(_BENT if bent else _AFFINE)
    words, covariance = list[str](), np.zeros((3, 3))
    if strained:
        words, stretch, along = _name(values, spreads)
        if "tilted" in words:
            covariance += _hidden_by_tilt(stretch / spread, along)
    if bent:
        words.append("bent")
    # Nobody knows which side it is, nor where its sensor was: the origins are the best guess, where they are near.
    for origin in (turn.apply(-middle[None])[0], -there):
        if np.hypot(*origin) <= DISTORTION.near * np.sqrt(2.0) * spread:
            covariance += _off_at(origin / spread, spread, values, spreads)
    return Distortion(tuple(words), covariance)


class _Fit:
    """Least squares of what is left, field after field; nested, so that one factorisation serves all tests."""

    def __init__(self, fields: Field, left: Field, largest: float) -> None:
        """`largest`: metres, one standard deviation of what distortions are like before anything is seen of them."""
        self._largest = largest
        self._q, self._r = np.linalg.qr(fields)
        self._parts = self._q.T @ left
        self._total = float(left @ left)

    def explains(self, size: int, larger: int) -> bool:
        """Whether the larger field explains significantly more than the one it contains (F test)."""
        rest = self._rest(larger)
        degrees = len(self._q) - larger
        gained = float((self._parts[size:larger] ** 2).sum()) / (larger - size)
        if degrees < DISTORTION.fewest or rest <= 1e-18:
            return False
        return float(fdtrc(larger - size, degrees, gained / (rest / degrees))) < DISTORTION.false_alarms

    def solve(self, size: int) -> tuple[Field, Field]:
        """The coefficients (size,) of a field and their covariance (size, size).

        Trees along two lines do not tell all of them: what they leave open is bounded by how large distortions are.
        """
        variance = self._rest(size) / (len(self._q) - size)
        held = self._r[:size, :size]
        known = np.full(size, self._largest**-2)
        known[:_RIGID] = 0.0
        covariance = np.linalg.inv(held.T @ held / variance + np.diag(known))
        return covariance @ (held.T @ self._parts[:size]) / variance, covariance

    def _rest(self, size: int) -> float:
        return max(self._total - float((self._parts[:size] ** 2).sum()), 0.0)


def _fields(at: Field) -> Field:
    """Displacements (2 N, 12) at places (N, 2) for a unit of each coefficient: x of all places, then y of all."""
    x, y = at.T
    one, none = np.ones(len(at)), np.zeros(len(at))
    along_x = [one, none, -y, x, x, y, x * x, x * y, y * y, none, none, none]
    along_y = [none, one, x, y, -y, x, none, none, none, x * x, x * y, y * y]
    return np.concatenate([np.column_stack(along_x), np.column_stack(along_y)])


def _name(values: Field, spreads: Field) -> tuple[list[str], float, float]:
    """What a stretch is called; the larger of its two, and the direction that it is along, radians.

    A tilt shortens one direction and leaves the one across; a scale stretches both alike. What is nearer, counted in
    standard deviations, is told, and both where it is neither.
    """
    both, first, second = values[3:6].tolist()
    size, angle = max(float(np.hypot(first, second)), 1e-300), 0.5 * float(np.arctan2(second, first))
    sign = 1.0 if both >= 0.0 else -1.0
    slope = np.array([1.0, -sign * first / size, -sign * second / size])
    across = (both - sign * size) ** 2 / float(slope @ spreads[3:6, 3:6] @ slope)
    uneven = float(values[4:6] @ np.linalg.solve(spreads[4:6, 4:6], values[4:6]))
    words = ["tilted"] if across < uneven else ["scaled"]
    if min(across, uneven) > DISTORTION.neither:
        words = ["tilted", "scaled"]
    return words, both + sign * size, angle if sign > 0.0 else angle + 0.5 * np.pi


def _hidden_by_tilt(stretch: float, along: float) -> Field:
    """Covariance (3, 3) of how far a tilt moves all trees alike, which no field can show."""
    angle = np.sqrt(2.0 * min(abs(stretch), 0.5))
    moved = DISTORTION.height * np.sin(angle) * np.array([np.cos(along), np.sin(along), 0.0])
    return np.outer(moved, moved)


def _off_at(origin: Field, spread: float, values: Field, spreads: Field) -> Field:
    """How far off a rigid transform is, as a covariance (3, 3), if the sensor was at `origin`, in units of `spread`.

    There the field tells where the sensor is and how it is turned.
    """
    size = len(values)
    place = _fields(origin[None])[:, :size]
    x, y = origin
    turned = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -0.5 * x, -y, x, 0.5 * y, 0.0])[:size]
    # What moves the middle is the move at the origin less what the turn there brings.
    moved = place - np.outer([-y, x], turned)
    told = np.vstack([moved, turned / spread])
    off = told @ values
    return np.asarray(np.outer(off, off) + told @ spreads @ told.T)
