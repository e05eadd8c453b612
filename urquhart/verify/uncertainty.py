"""The uncertainty of a verified pose, from its residuals, the configuration, and distortions of either side."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.pose_covariance import PoseUncertainty, least_squares
from urquhart.se2 import SE2
from urquhart.verify.distortion import find_distortion


class NoiseNumbers(NamedTuple):
    """Numbers of the noise in a covariance. Chosen by hand, not fitted."""

    least: float = 0.02
    """Metres: least noise of a tree's position in a covariance, however well a few trees happen to agree."""


NOISE: Final = NoiseNumbers()


def pose_uncertainty(
    seen: NDArray[np.float64],
    stored: NDArray[np.float64],
    transform: SE2,
    residuals: NDArray[np.float64],
    config: Config,
    *,
    distorted: bool,
) -> tuple[PoseUncertainty, tuple[str, ...]]:
    """The uncertainty of a pose about the middle of its inliers, and warnings, words of `distortion.WARNINGS`.

    Args:
        seen, stored: (K, 2) float64, metres, the inliers of the query and of the submap, as posted.
        transform: `submap_T_query`, in the frames as posted.
        residuals: (K,) float64, metres, of the inliers.
        config: scale and floors of covariances.
        distorted: whether to look for distortions.
    """
    degrees = max(2 * len(seen) - 3, 1)
    variance = max(float((residuals**2).sum()) / degrees, NOISE.least**2)
    known = least_squares(seen, transform, variance * config.covariance_scale)
    more = np.diag([config.covariance_floor, config.covariance_floor, config.covariance_floor_yaw]) ** 2
    words: tuple[str, ...] = ()
    if distorted:
        found = find_distortion(seen, stored, transform)
        more, words = more + found.covariance, found.words
    if more.any():
        known = known.widened(transform, more)
    return known, (*words, "far_origin") if known.is_far(transform) else words
