"""Whether the residuals of a match are noise, or show that one side is distorted: tilted, scaled or bent.

A rigid transform explains two observations of the same trees up to noise. A tilted sensor shortens one direction, a
wrong unit or range scales all directions, and a trajectory that drifts within a submap bends it. The residuals are
fitted by these displacement fields, one after the other, and F tests decide whether a field explains more than noise.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from urquhart._kernel import kernel
from urquhart.se2 import SE2


class DistortionNumbers(NamedTuple):
    """When a match shows a distortion, and how large that can be. Chosen by hand, not fitted, unless a field says
    otherwise."""

    false_alarms: float = 1e-3
    """Significance level of each of the two tests; `tests/urquhart/test_distortion.py` counts the false alarms."""
    largest: float = 0.1
    """Usual size of a distortion: the displacement at one spread of the trees from their centroid, as a share of that
    distance. A tenth is a scale of 1.1, or a tilt by 25 degrees."""
    fewest: int = 4
    """Fewest degrees of freedom that a test needs."""
    height: float = 1.3
    """Metres between a sensor and the height at which stems are measured (breast height, 1.3 m, by convention). A tilt
    moves all stems by its sine times this."""
    neither: float = 13.8
    """Squared standard deviations beyond which a stretch is neither a pure tilt nor a pure scale. Follows from
    `false_alarms`: the chi-square quantile for two numbers is -2 log(0.001)."""
    near: float = 2.0
    """An origin within this many spreads of the trees' centroid may be where the sensor was."""


DISTORTION: Final = DistortionNumbers()
_RIGID, _AFFINE, _BENT = 3, 6, 12
"""Coefficients of a field: rigid; affine (stretched along two directions); and bent (quadratic)."""

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
    """A distortion of one of two observations of the same trees.

    Attributes:
        words: `tilted`, `scaled`, `bent`; empty if noise explains everything.
        covariance: (3, 3) float64 over (x, y, yaw) about the centroid of the trees, target axes, metres and radians:
            the error of the transform because of the distortion, beyond noise.
    """

    words: tuple[str, ...]
    covariance: NDArray[np.float64]


def find_distortion(source: Field, target: Field, target_T_source: SE2) -> Distortion:
    """Look for a distortion in the residuals of a least-squares transform.

    Args:
        source, target: (K, 2) float64, metres: the paired trees of each side, in the side's own frame.
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
    fields = _fields(trees / spread)
    parts = explained_parts(fields, left, size)
    total = float(left @ left)
    strained = _explains(parts, total, len(left), (_RIGID, _AFFINE))
    bent = size == _BENT and _explains(parts, total, len(left), (_AFFINE, _BENT))
    if not (strained or bent):
        return none
    size = _BENT if bent else _AFFINE
    values, spreads = _solve(fields[:, :size], left, DISTORTION.largest * spread)
    words, covariance = list[str](), np.zeros((3, 3))
    if strained:
        words, stretch, along = _name(values, spreads)
        if "tilted" in words:
            covariance += _hidden_by_tilt(stretch / spread, along)
    if bent:
        words.append("bent")
    # It is unknown which side is distorted, and where its sensor was: an origin that is near is the best guess.
    for origin in (turn.apply(-middle[None])[0], -there):
        if np.hypot(*origin) <= DISTORTION.near * np.sqrt(2.0) * spread:
            covariance += _off_at(origin / spread, spread, values, spreads)
    return Distortion(tuple(words), covariance)


@kernel
def explained_parts(fields: Field, left: Field, size: int) -> Field:
    """How much of the residuals each field explains beyond those before it, as a signed length, metres: (size,).

    By Gram-Schmidt; a field that depends on those before it explains nothing more.

    Args:
        fields: (2 K, C), displacements by a unit of each coefficient, as `_fields` returns them.
        left: (2 K,), residuals, metres.
        size: fields that are used, the first ones.
    """
    basis = fields.T[:size].copy()
    parts = np.zeros(len(basis))
    for c in range(len(basis)):
        before = math.sqrt((basis[c] * basis[c]).sum())
        for b in range(c):
            basis[c] -= (basis[b] * basis[c]).sum() * basis[b]
        length = math.sqrt((basis[c] * basis[c]).sum())
        if length <= 1e-9 * before:
            basis[c] = 0.0
            continue
        basis[c] /= length
        parts[c] = (basis[c] * left).sum()
    return parts


def _explains(parts: Field, total: float, count: int, sizes: tuple[int, int]) -> bool:
    """Whether the fields from the first to the second of `sizes` explain significantly more than noise (F test).

    Args:
        parts: of `explained_parts`.
        total: sum of the squares of `count` residuals.
    """
    size, larger = sizes
    rest = max(total - float(parts[:larger] @ parts[:larger]), 0.0)
    degrees = count - larger
    gained = float(parts[size:larger] @ parts[size:larger]) / (larger - size)
    if degrees < DISTORTION.fewest or rest <= 1e-18:
        return False
    return float(fdtrc(larger - size, degrees, gained / (rest / degrees))) < DISTORTION.false_alarms


def _solve(fields: Field, left: Field, largest: float) -> tuple[Field, Field]:
    """The coefficients (C,) of the least-squares fit, and their covariance (C, C).

    Trees along two lines do not determine all coefficients; the prior bounds the others.

    Args:
        fields: (2 K, C).
        left: (2 K,), residuals, metres.
        largest: metres, prior standard deviation of all coefficients but the rigid ones.
    """
    q, r = np.linalg.qr(fields)
    parts = q.T @ left
    variance = max(float(left @ left - parts @ parts), 0.0) / (len(left) - len(parts))
    known = np.full(len(parts), largest**-2)
    known[:_RIGID] = 0.0
    covariance = np.linalg.inv(r.T @ r / variance + np.diag(known))
    return covariance @ (r.T @ parts) / variance, covariance


@kernel
def _fields(at: Field) -> Field:
    """Displacements (2 N, 12) at positions (N, 2) by a unit of each coefficient: x of all positions, then y of all."""
    count = len(at)
    fields = np.zeros((2 * count, _BENT))
    for n in range(count):
        x, y = at[n]
        along_x, along_y = fields[n], fields[count + n]
        along_x[0] = along_y[1] = 1.0
        along_x[2], along_y[2] = -y, x
        along_x[3], along_y[3] = x, y
        along_x[4], along_y[4] = x, -y
        along_x[5], along_y[5] = y, x
        along_x[6] = along_y[9] = x * x
        along_x[7] = along_y[10] = x * y
        along_x[8] = along_y[11] = y * y
    return fields


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
    """Covariance (3, 3) of the common shift of all trees by a tilt, which residuals cannot show."""
    angle = np.sqrt(2.0 * min(abs(stretch), 0.5))
    moved = DISTORTION.height * np.sin(angle) * np.array([np.cos(along), np.sin(along), 0.0])
    return np.outer(moved, moved)


def _off_at(origin: Field, spread: float, values: Field, spreads: Field) -> Field:
    """The error of the rigid transform, as a covariance (3, 3), if the sensor was at `origin`, in units of `spread`.

    The field at `origin` gives the true displacement and rotation of the sensor. `values`, `spreads`: coefficients and
    their covariance.
    """
    size = len(values)
    place = _fields(origin[None])[:, :size]
    x, y = origin
    turned = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -0.5 * x, -y, x, 0.5 * y, 0.0])[:size]
    # The displacement of the centroid is that at the origin, minus the effect of the rotation there.
    moved = place - np.outer([-y, x], turned)
    told = np.vstack([moved, turned / spread])
    off = told @ values
    return np.asarray(np.outer(off, off) + told @ spreads @ told.T)
