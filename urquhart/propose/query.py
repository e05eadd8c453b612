"""A query during its search, and the poses that are proposed for it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.submap_collection import FeatureSource
from urquhart.options import Options
from urquhart.propose.submap_cache import SubmapCache
from urquhart.trace import Trace
from urquhart.verify.evidence import PoseEvidence
from urquhart.verify.landmark_grid import LandmarkGrid, landmark_grid

LevelName = Literal["polygons", "quads", "exhaustive", "paper", "given"]
"""The level that proposed a pose; `given` is a pose that the caller gave, or one of the window of a given prior."""

DEFAULT_GATE: Final = Config().gate
READ_TOGETHER: Final = 32
"""Submaps that are read together: far cheaper than one by one, and at most 0.1 s for the largest."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A proposed pose in one submap, verified.

    Attributes:
        key: of the submap.
        level: which search proposed the pose.
        support: number of quads, polygons, or correlation peaks that proposed it, by level.
        verified: the refined pose with its evidence, centred frames.
    """

    key: int
    level: LevelName
    support: int
    verified: PoseEvidence


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """An observation during its search: everything that proposing and deciding need, except the index.

    Attributes:
        features: of the observation.
        grid: its landmarks, prepared for verification.
        config: parameters of the method.
        gate: least log-odds of being right that are `matched`.
        submaps: the submaps in which poses are proposed, read on first use.
        volume: logarithm of the volume of all possible poses; see `log_volume`.
        budget: when the search must end, and whether anybody still waits for it.
        trace: counts and costs of the stages so far.
    """

    features: Features
    grid: LandmarkGrid
    config: Config
    gate: float
    submaps: SubmapCache
    volume: float
    budget: Budget
    trace: Trace

    @property
    def searched_gate(self) -> float:
        """The gate that decides how far the search goes and which rivals it looks for: the default gate at least.

        So a lower gate changes what is reported, and not what is known: neither the pose nor its confidence.
        """
        return max(self.gate, DEFAULT_GATE)

    @property
    def reach(self) -> float:
        """Metres: largest distance of a landmark's partner in verification."""
        return self.config.reach

    def read(self, keys: Iterable[int]) -> None:
        """Read submaps by key into the cache, a few at a time. Raises DeadlinePassed if the deadline passes."""
        wanted = list(keys)
        for begin in range(0, len(wanted), READ_TOGETHER):
            self.budget.check()
            self.submaps.read(wanted[begin : begin + READ_TOGETHER])


def make_query(features: Features, config: Config, source: FeatureSource, searched: int, options: Options) -> Query:
    """Prepare an observation for a search.

    Args:
        features: of the observation.
        config: parameters of the method.
        source: where the features of submaps are read from.
        searched: number of submaps that are searched.
        options: when the search must end, and the gate.

    Raises:
        ValueError: the observation was described with another configuration.
    """
    if features.fingerprint != config.fingerprint():
        raise ValueError(
            f"the features have the fingerprint {features.fingerprint}, but the collection needs "
            f"{config.fingerprint()}: describe the landmarks again"
        )
    grid = landmark_grid(features, config.reach)
    submaps, volume = SubmapCache(source, config.reach), log_volume(searched, grid)
    return Query(features, grid, config, options.gate(config), submaps, volume, options.budget or Budget(), Trace())


def log_volume(submaps: int, query: LandmarkGrid) -> float:
    """Natural logarithm of the volume of all possible poses: x, y and yaw, in square metres times radians.

    It is that of `submaps` footprints as large as the query's, times a full turn.
    """
    return math.log(max(submaps, 1)) + math.log(2.0 * math.pi * query.area)
