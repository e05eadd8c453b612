"""Landmarks as they come in: checked, never mended.

Everything behind this module may rely on: at least three landmarks, all finite, no two at the same place, not all on
one line, coordinates that float64 resolves to well under a millimetre.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from urquhart._kernel import kernel

MINIMUM: Final = 3
MAXIMUM: Final = 20_000
COORDINATE_LIMIT: Final = 1e8
"""Metres. Larger than any projected coordinate on Earth; beyond it float64 no longer resolves a micrometre safely."""
RESOLUTION: Final = 1e-3
"""Metres. Landmarks closer than this are one tree recorded twice; a set narrower than this is a line."""


class LandmarkError(ValueError):
    """Landmarks that cannot be described.

    `code` is one of `bad_shape`, `too_few`, `too_many`, `not_finite`, `out_of_range`, `duplicates`, `collinear`,
    `bad_diameters`; `indices` are the positions of the first offending landmarks, where single landmarks are to blame.
    """

    def __init__(self, code: str, message: str, indices: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.code = code
        self.indices = indices


def check_landmarks(xy: ArrayLike) -> NDArray[np.float64]:
    """Return `xy` as an (N, 2) float64 array, metres, in the frame it came in, or refuse it with the reason.

    Raises:
        LandmarkError: see its codes.
    """
    landmarks = _as_points(xy)
    bad, far = first_unusable(landmarks)
    if bad >= 0:
        raise LandmarkError(
            "not_finite", f"landmark {bad} has a coordinate that is not a finite number: drop it", (bad,)
        )
    if far >= 0:
        raise LandmarkError(
            "out_of_range", f"landmark {far} is beyond {COORDINATE_LIMIT:.0e} m: coordinates are metres", (far,)
        )
    if len(landmarks) < MINIMUM:
        raise LandmarkError(
            "too_few", f"{len(landmarks)} landmarks given, at least {MINIMUM} are needed: merge observations first"
        )
    if len(landmarks) > MAXIMUM:
        raise LandmarkError(
            "too_many", f"{len(landmarks)} landmarks given, at most {MAXIMUM} are allowed: cut the map into submaps"
        )
    if smallest_step(landmarks) < RESOLUTION:
        _refuse_duplicates(landmarks)
    if width(landmarks) < RESOLUTION:
        raise LandmarkError("collinear", "all landmarks lie on one line: a tessellation needs some beside it")
    return landmarks


def check_diameters(diameters: ArrayLike | None, count: int) -> NDArray[np.float32]:
    """Return `diameters` as a float32 array of `count`, NaN where one is not known; empty where none is.

    Raises:
        LandmarkError: code `bad_diameters`: not one for each landmark, or one that is not above zero.
    """
    try:
        values = np.array([] if diameters is None else diameters, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise LandmarkError("bad_diameters", "diameters must be numbers, NaN where one is not known") from error
    if diameters is None or (values.shape == (count,) and np.isnan(values).all()):
        return np.empty(0, np.float32)
    if values.shape != (count,):
        raise LandmarkError(
            "bad_diameters", f"{values.size} diameters for {count} landmarks: give one for each, or NaN"
        )
    bad = np.flatnonzero(~np.isnan(values) & ~((values > 0.0) & np.isfinite(values)))
    if len(bad):
        raise LandmarkError("bad_diameters", f"the diameter of landmark {bad[0]} is not above zero", (int(bad[0]),))
    return values


@kernel
def first_unusable(landmarks: NDArray[np.float64]) -> tuple[int, int]:
    """The first landmark that is not finite, and the first beyond the coordinate limit; -1 where there is none."""
    bad = far = -1
    for i in range(len(landmarks)):
        x, y = landmarks[i, 0], landmarks[i, 1]
        if bad < 0 and not (math.isfinite(x) and math.isfinite(y)):
            bad = i
        if far < 0 and (abs(x) > COORDINATE_LIMIT or abs(y) > COORDINATE_LIMIT):
            far = i
    return bad, far


@kernel
def smallest_step(landmarks: NDArray[np.float64]) -> float:
    """Smallest gap between consecutive x coordinates, metres: two landmarks cannot be closer than that."""
    x = np.sort(landmarks[:, 0])
    step = np.inf
    for i in range(len(x) - 1):
        step = min(step, x[i + 1] - x[i])
    return step


@kernel
def width(landmarks: NDArray[np.float64]) -> float:
    """Extent of `landmarks` (N, 2), metres, across their principal direction."""
    n = len(landmarks)
    cx, cy = landmarks[:, 0].mean(), landmarks[:, 1].mean()
    xx = xy = yy = 0.0
    for i in range(n):
        dx, dy = landmarks[i, 0] - cx, landmarks[i, 1] - cy
        xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    s, c = math.sin(angle), math.cos(angle)
    low, high = np.inf, -np.inf
    for i in range(n):
        across = c * (landmarks[i, 1] - cy) - s * (landmarks[i, 0] - cx)
        low, high = min(low, across), max(high, across)
    return high - low


def _as_points(xy: ArrayLike) -> NDArray[np.float64]:
    try:
        points = np.ascontiguousarray(xy, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise LandmarkError("bad_shape", "landmarks must be numbers, one pair [x, y] for each landmark") from error
    if points.size == 0:
        points = points.reshape(0, 2)
    if points.ndim != 2 or points.shape[1] != 2:
        raise LandmarkError("bad_shape", f"landmarks must be pairs [x, y], got an array of shape {points.shape}")
    return points


def _refuse_duplicates(landmarks: NDArray[np.float64]) -> None:
    pairs = cKDTree(landmarks).query_pairs(RESOLUTION, output_type="ndarray")
    if len(pairs):
        first, second = sorted(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))[0]].tolist())
        raise LandmarkError(
            "duplicates",
            f"{len(pairs)} pairs of landmarks are closer than {RESOLUTION * 1000:g} mm, the first are landmarks "
            f"{first} and {second}: keep one of each",
            (first, second),
        )
