"""Outlines of landmarks."""

import numpy as np
from numpy.typing import NDArray


def hull_of(xy: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The corners (K, 2) of the convex hull of points (N, 2), counter-clockwise; None if they span no area."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(xy[ConvexHull(xy).vertices])
    except (QhullError, ValueError):
        return None
