"""An observation under look-up, and the poses that are proposed for it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.collection import FeatureSource
from urquhart.propose.submap_cache import SubmapCache
from urquhart.trace import Trace
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid

LevelName = Literal["polygons", "quads", "exhaustive", "paper", "given"]
"""Which search proposed a pose."""

READ_TOGETHER: Final = 32
"""Submaps that are read together: far cheaper than one by one, and 0.1 s at most for the largest."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A verified pose in one submap: the submap's key, what proposed it, and how much supports it."""

    key: int
    level: LevelName
    support: int
    verified: PoseEvidence


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """An observation under look-up, with all that proposing and deciding need but the index.

    Attributes:
        features: what is known of the observation.
        grid: its landmarks, ready for verification.
        config: of the method.
        submaps: features of the submaps that poses are proposed in, read when they are first asked for.
        volume: logarithm of the volume of all poses there are to choose from; see `log_volume`.
        budget: when the look-up must end, and whether anybody still waits for it.
        trace: what each stage of the look-up found and cost.
    """

    features: Features
    grid: LandmarkGrid
    config: Config
    submaps: SubmapCache
    volume: float
    budget: Budget
    trace: Trace

    @property
    def reach(self) -> float:
        """Metres that a partner may be away in verification."""
        return self.config.reach

    def read(self, keys: Iterable[int]) -> None:
        """Read submaps, a few at a time. Raises OutOfTime where the deadline passes meanwhile."""
        wanted = list(keys)
        for begin in range(0, len(wanted), READ_TOGETHER):
            self.budget.check()
            self.submaps.read(wanted[begin : begin + READ_TOGETHER])


def make_query(
    features: Features, config: Config, source: FeatureSource, searched: int, budget: Budget | None = None
) -> Query:
    """Make an observation ready to be looked up among `searched` submaps.

    Args:
        features: of the observation.
        source: where the features of submaps are kept.

    Raises:
        ValueError: the observation was described with another configuration.
    """
    if features.fingerprint != config.fingerprint():
        raise ValueError(f"features of {features.fingerprint}, this collection's are of {config.fingerprint()}")
    grid = landmark_grid(features, config.reach)
    submaps, volume = SubmapCache(source, config.reach), log_volume(searched, grid)
    return Query(features, grid, config, submaps, volume, budget or Budget(), Trace())


def log_volume(submaps: int, query: LandmarkGrid) -> float:
    """Logarithm of the volume of all poses, square metres times radians, in `submaps` footprints like the query's."""
    return math.log(max(submaps, 1)) + math.log(2.0 * math.pi * query.area)
