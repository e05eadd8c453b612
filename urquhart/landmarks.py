"""Landmarks as they come in: checked, never mended.

Everything behind this module may rely on: at least three landmarks, all finite, no two at the same place, not all on
one line, coordinates that float64 resolves to well under a millimetre.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

MINIMUM: Final = 3
MAXIMUM: Final = 20_000
COORDINATE_LIMIT: Final = 1e8
"""Metres. Larger than any projected coordinate on Earth; beyond it float64 no longer resolves a micrometre safely."""
RESOLUTION: Final = 1e-3
"""Metres. Landmarks closer than this are one tree recorded twice; a set narrower than this is a line."""


class LandmarkError(ValueError):
    """Landmarks that cannot be described.

    `code` is one of `bad_shape`, `too_few`, `too_many`, `not_finite`, `out_of_range`, `duplicates`, `collinear`;
    `indices` are the positions of the first offending landmarks, where single landmarks are to blame.
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
    if len(landmarks) < MINIMUM:
        raise LandmarkError(
            "too_few", f"{len(landmarks)} landmarks given, at least {MINIMUM} are needed: merge observations first"
        )
    if len(landmarks) > MAXIMUM:
        raise LandmarkError(
            "too_many", f"{len(landmarks)} landmarks given, at most {MAXIMUM} are allowed: cut the map into submaps"
        )
    _refuse_duplicates(landmarks)
    if width(landmarks) < RESOLUTION:
        raise LandmarkError("collinear", "all landmarks lie on one line: a tessellation needs some beside it")
    return landmarks


def width(landmarks: NDArray[np.float64]) -> float:
    """Extent of `landmarks` (N, 2), metres, across their principal direction."""
    centred = landmarks - landmarks.mean(axis=0)
    xx, xy, yy = (centred[:, 0] ** 2).sum(), (centred[:, 0] * centred[:, 1]).sum(), (centred[:, 1] ** 2).sum()
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    across = centred @ np.array([-np.sin(angle), np.cos(angle)])
    return float(np.ptp(across))


def _as_points(xy: ArrayLike) -> NDArray[np.float64]:
    try:
        points = np.ascontiguousarray(xy, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise LandmarkError("bad_shape", "landmarks must be numbers, one pair [x, y] for each landmark") from error
    if points.size == 0:
        points = points.reshape(0, 2)
    if points.ndim != 2 or points.shape[1] != 2:
        raise LandmarkError("bad_shape", f"landmarks must be pairs [x, y], got an array of shape {points.shape}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise LandmarkError(
            "not_finite",
            f"landmark {bad[0]} has a coordinate that is not a finite number: drop it or repair it",
            _first(bad),
        )
    far = np.flatnonzero((np.abs(points) > COORDINATE_LIMIT).any(axis=1))
    if len(far):
        raise LandmarkError(
            "out_of_range",
            f"landmark {far[0]} lies beyond {COORDINATE_LIMIT:.0e} m: coordinates must be metres",
            _first(far),
        )
    return points


def _refuse_duplicates(landmarks: NDArray[np.float64]) -> None:
    # Sorting by x finds every duplicate with numpy alone; the tree is only built for the rare set that has a suspect.
    order = np.argsort(landmarks[:, 0], kind="stable")
    gaps = np.diff(landmarks[order], axis=0)
    if not (gaps[:, 0] < RESOLUTION).any():
        return
    pairs = cKDTree(landmarks).query_pairs(RESOLUTION, output_type="ndarray")
    if len(pairs):
        first, second = sorted(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))[0]].tolist())
        raise LandmarkError(
            "duplicates",
            f"{len(pairs)} pairs of landmarks are closer than {RESOLUTION * 1000:g} mm, the first are landmarks "
            f"{first} and {second}: keep one of each",
            (first, second),
        )


def _first(indices: NDArray[np.intp]) -> tuple[int, ...]:
    return tuple(int(i) for i in indices[:10])
