"""Checks of incoming landmarks. They are refused with the reason, and never repaired.

All other modules rely on this: there are at least three landmarks, all finite, no two at the same place, not all on one
line, with coordinates that float64 resolves to well under a millimetre.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from urquhart._kernel import kernel

MINIMUM: Final = 3
MAXIMUM: Final = 20_000
COORDINATE_LIMIT: Final = 1e8
"""Metres: larger than any projected coordinate on Earth; beyond it float64 no longer resolves a micrometre safely."""
RESOLUTION: Final = 1e-3
"""Metres: landmarks closer together than this are one tree recorded twice; a set narrower than this is a line."""


class LandmarkError(ValueError):
    """Landmarks that cannot be described.

    Attributes:
        code: `bad_shape`, `too_few`, `too_many`, `not_finite`, `out_of_range`, `duplicates`, `collinear`, or
            `bad_diameters`.
        indices: positions of the first offending landmarks; empty if the fault is not that of single landmarks.
    """

    def __init__(self, code: str, message: str, indices: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.code = code
        self.indices = indices

    def __reduce__(self) -> tuple[type["LandmarkError"], tuple[str, str, tuple[int, ...]]]:
        """For pickle, so that an error crosses from one process to another unchanged."""
        return (LandmarkError, (self.code, str(self), self.indices))


def check_landmarks(xy: ArrayLike) -> NDArray[np.float64]:
    """A checked copy of `xy`: (N, 2) float64, metres, in the same frame.

    Raises:
        LandmarkError: the landmarks cannot be used; any code but `bad_diameters`.
    """
    landmarks = _as_points(xy)
    bad, far = first_unusable(landmarks)
    if bad >= 0:
        raise LandmarkError(
            "not_finite", f"landmark {bad} has a coordinate that is not a finite number: drop it", (bad,)
        )
    if far >= 0:
        raise LandmarkError(
            "out_of_range", f"landmark {far} is beyond {COORDINATE_LIMIT:.0e} m: coordinates must be in metres", (far,)
        )
    if len(landmarks) < MINIMUM:
        raise LandmarkError(
            "too_few",
            f"{len(landmarks)} landmarks given, at least {MINIMUM} are needed: send several views in one frame",
        )
    if len(landmarks) > MAXIMUM:
        raise LandmarkError(
            "too_many", f"{len(landmarks)} landmarks given, at most {MAXIMUM} are allowed: cut the map into submaps"
        )
    if smallest_step(landmarks) < RESOLUTION:
        _refuse_duplicates(landmarks)
    if width(landmarks) < RESOLUTION:
        raise LandmarkError("collinear", "all landmarks lie on one line: at least one must lie beside it")
    return landmarks


def check_diameters(diameters: ArrayLike | None, count: int) -> NDArray[np.float32]:
    """A checked copy of `diameters`: (count,) float32, NaN where one is not known; empty if none is known.

    Args:
        diameters: (count,), any unit.
        count: number of landmarks.

    Raises:
        LandmarkError: code `bad_diameters`: not one diameter for each landmark, or one that is not above zero.
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
    """Index of the first landmark (N, 2) that is not finite, and of the first beyond the limit; -1 if there is none."""
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
    """The smallest gap between consecutive x coordinates of landmarks (N, 2), metres.

    No two landmarks are closer together than that, so most sets need no search for duplicates.
    """
    x = np.sort(landmarks[:, 0])
    step = np.inf
    for i in range(len(x) - 1):
        step = min(step, x[i + 1] - x[i])
    return step


@kernel
def width(landmarks: NDArray[np.float64]) -> float:
    """Extent of landmarks (N, 2), metres, across their principal direction."""
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
    """A writable copy (N, 2) float64. For numba, a read-only array is another type, and compiling takes seconds."""
    try:
        points = np.array(xy, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise LandmarkError("bad_shape", "landmarks must be numbers, one pair [x, y] for each landmark") from error
    if points.size == 0:
        points = points.reshape(0, 2)
    if points.ndim != 2 or points.shape[1] != 2:
        raise LandmarkError("bad_shape", f"landmarks must be pairs [x, y], got an array of shape {points.shape}")
    return points


def _refuse_duplicates(landmarks: NDArray[np.float64]) -> None:
    partners = thin(landmarks, RESOLUTION)
    later = np.flatnonzero(partners >= 0)
    if len(later):
        second = int(later[np.argmin(partners[later])])
        first = int(partners[second])
        raise LandmarkError(
            "duplicates",
            f"landmarks {first} and {second} are closer than {RESOLUTION * 1000:g} mm: keep one of each "
            f"({len(later)} of {len(landmarks)} landmarks are as close as that to an earlier one)",
            (first, second),
        )


def thin(points: NDArray[np.float64], distance: float) -> NDArray[np.int64]:
    """Thin out points (N, 2), metres: one is kept unless it lies within `distance` > 0, metres, of an earlier kept one.

    Takes N log N steps, and memory for N points, however many of them share a place.

    Returns:
        (N,) int64: -1 for points that are kept, for others the index of the first kept point within `distance`.
    """
    # A little larger than the distance, so that rounding never puts a neighbour two cells away.
    cells = np.floor(points / (1.001 * distance)).astype(np.int64)
    order = np.lexsort((cells[:, 1], cells[:, 0]))
    ordered = cells[order]
    fresh = np.ones(len(points), np.bool_)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.empty(len(points), np.int64)
    number[order] = np.cumsum(fresh) - 1
    return keep_apart(np.asarray(points, np.float64), np.ascontiguousarray(ordered[fresh]), number, distance)


@kernel
def keep_apart(
    points: NDArray[np.float64], cells: NDArray[np.int64], number: NDArray[np.int64], distance: float
) -> NDArray[np.int64]:
    """The loop of `thin` over points (N, 2), metres.

    `cells`: (C, 2), the square cells that hold points, in ascending order; `number`: (N,), the cell of each point.
    """
    # At most four points that are farther apart than the distance fit into one cell.
    kept, counts = np.empty((len(cells), 4), np.int64), np.zeros(len(cells), np.int64)
    partners = np.full(len(points), -1, np.int64)
    for i in range(len(points)):
        column, row = cells[number[i], 0], cells[number[i], 1]
        for c in range(column - 1, column + 2):
            at, end = 0, len(cells)
            while at < end:
                middle = (at + end) // 2
                if cells[middle, 0] < c or (cells[middle, 0] == c and cells[middle, 1] < row - 1):
                    at = middle + 1
                else:
                    end = middle
            while at < len(cells) and cells[at, 0] == c and cells[at, 1] <= row + 1:
                for k in range(counts[at]):
                    j = kept[at, k]
                    near = math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1]) <= distance
                    if near and (partners[i] < 0 or j < partners[i]):
                        partners[i] = j
                at += 1
        if partners[i] < 0:
            kept[number[i], counts[number[i]]] = i
            counts[number[i]] += 1
    return partners
