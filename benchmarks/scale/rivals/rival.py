"""What a rival has to do, and what all of them share."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from urquhart import Config, Features
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid

CONFIG = Config()
REACHED = CONFIG.reach
"""Metres, the reach of partners in verification."""
TOLERANCE = 2.0 * CONFIG.sigma
"""Metres that a length may be off by, as the method has it."""


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """An observation, ready to be searched for or verified."""

    features: Features
    grid: LandmarkGrid

    @staticmethod
    def of(features: Features) -> "Described":
        """From its features."""
        return Described(features, landmark_grid(features, REACHED))


@dataclass(frozen=True, slots=True, eq=False)
class RivalRanking:
    """The best submaps, the best first, and what the rival needs to propose poses in them."""

    submaps: NDArray[np.int64]
    evidence: Any


class RivalMethod(Protocol):
    """A way to find submaps."""

    refined: int
    """How many of a submap's poses are verified."""

    def add(self, features: Features) -> None:
        """Take the next submap in."""

    def build(self) -> None:
        """Make what is searched, when all are in."""

    def nbytes(self) -> int:
        """Bytes of what is searched, the submaps' own features left out."""

    def rank(self, query: Described, count: int) -> RivalRanking:
        """The best `count` submaps."""

    def poses(self, query: Described, ranking: RivalRanking, at: int, submap: Described) -> NDArray[np.float64]:
        """Poses (H, 3), x, y, yaw of `submap_T_query` between centred frames, in the submap at a place of a ranking."""


def most(votes: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """The `count` submaps with most votes (N,), of those that have any; the first of equals goes first."""
    return np.argsort(-votes, kind="stable")[: min(count, int((votes > 0).sum()))].astype(np.int64)
