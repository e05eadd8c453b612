"""No search at all: the query tried on every submap, under every rotation and shift."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.scale.rivals.rival import REACHED, Described, RivalRanking
from urquhart import Features
from urquhart.propose.correlation import correlate
from urquhart.verify.landmark_grid import GRID, LandmarkGrid
from urquhart.verify.pairing import refine

_PEAKS = 8


class ExhaustiveRival:
    """Every submap, ready to be tried."""

    refined = 2

    def __init__(self) -> None:
        self._grids: list[LandmarkGrid] = []

    def add(self, features: Features) -> None:
        """Take the next submap in."""
        self._grids.append(Described.of(features).grid)

    def build(self) -> None:
        """Nothing is made."""

    def nbytes(self) -> int:
        """Nothing is kept beside the submaps."""
        return 0

    def rank(self, query: Described, count: int) -> RivalRanking:
        """By what stands out most in each."""
        peaks = [correlate(query.grid, submap, _PEAKS) for submap in self._grids]
        scores = np.array([found[0, 3] if len(found) else 0.0 for found in peaks])
        chosen = np.argsort(-scores, kind="stable")[:count].astype(np.int64)
        return RivalRanking(chosen, [peaks[k] for k in chosen.tolist()])

    def poses(self, query: Described, ranking: RivalRanking, at: int, submap: Described) -> NDArray[np.float64]:
        """The peaks, refined with partners farther away."""
        found: NDArray[np.float64] = ranking.evidence[at]
        landmarks = query.features.landmarks
        return np.array([refine(landmarks, submap.grid, x, y, yaw, GRID.loose * REACHED) for x, y, yaw, _ in found])
