"""The options of one search."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypedDict

import numpy as np

from urquhart.budget import Budget
from urquhart.config import Config

Method = Literal["robust", "paper"]
"""`robust` is this project's search, `paper` the matching of Nardari et al. 2020."""

Effort = Literal["fast", "full"]
"""`fast` searches by quads, and by polygons only for rivals of a pose that beats chance, so a place that is not stored
takes 1.5 to 3 times as long as one that is. `full` goes on with polygons and with trials of every rotation and
shift: then it takes 10 to 20 times as long, in small collections 1.4 to 1.6 times. If only one submap is searched, both
begin with those trials."""


class Promise(NamedTuple):
    """Up to where a search without a match says that the place is not stored.

    Attributes:
        sigma: metres, noise of each coordinate of the query.
        detection: share of the trees that the query sees.
        landmarks: fewest trees of the query.
    """

    sigma: float
    detection: float
    landmarks: int


FAST_PROMISE: Final = Promise(0.4, 0.8, 60)
"""What `fast` finds in the paper's forest: measured, 400 of 400 places among 10,000 submaps and 297 of 300 among
100,000; no command repeats it. With fewer trees, more is missed: 2 of 50 places of which 50 to 59 trees are seen, and 8
of 96 with 30 to 39. Rows of trees and stands with neighbours nearer than 3 m need `full`."""


EFFORTS: Final[Mapping[Effort, str]] = {
    "fast": "a place that is not stored takes 1.5 to 3 times as long as one that is; finds places seen with up to "
    f"{100 * FAST_PROMISE.sigma:.0f} cm of noise and at least {100 * FAST_PROMISE.detection:.0f} % of the trees, and "
    "tries an only submap at every shift",
    "full": "a place that is not stored takes 10 to 20 times as long as one that is, in small collections 1.4 to 1.6 "
    "times; finds places seen with more noise and fewer trees, where neighbours are nearer than 3 m, and in rows of "
    "trees, too",
}
"""A sentence for each effort."""


class SearchOptions(TypedDict, total=False):
    """The keyword arguments of `Recognizer.recognize`: the members of `Options`, which explains each."""

    limit: int
    method: Method
    effort: Effort
    min_confidence: float | None
    exclude: Collection[int]
    only: Collection[int] | None
    rng: np.random.Generator | None
    budget: Budget | None


@dataclass(frozen=True, slots=True, eq=False)
class Options:
    """How one search is done.

    Attributes:
        limit: most candidates in the answer.
        method: the search, or the paper's.
        effort: how far the search goes if it finds nothing; see `Effort`.
        min_confidence: least confidence that is `matched`, above 0.5 and below 1; by default that of `Config.gate`.
        exclude: keys of submaps that are not searched.
        only: keys of the submaps that are searched; all by default.
        rng: source of randomness for `paper` (sampling, RANSAC); a fixed seed by default.
        budget: when the search must end; by default never. At the deadline the answer is `no_match` with the reason
            `deadline` and the candidates found so far, because rivals may be missing.
    """

    limit: int = 5
    method: Method = "robust"
    effort: Effort = "full"
    min_confidence: float | None = None
    exclude: Collection[int] = ()
    only: Collection[int] | None = None
    rng: np.random.Generator | None = None
    budget: Budget | None = None

    def __post_init__(self) -> None:
        if self.min_confidence is not None and not 0.5 < self.min_confidence < 1.0:
            raise ValueError(f"min_confidence must be above 0.5 and below 1, not {self.min_confidence:g}")

    def gate(self, config: Config) -> float:
        """Least log-odds of being right that are `matched`."""
        if self.min_confidence is None:
            return config.gate
        return math.log(self.min_confidence / (1.0 - self.min_confidence))

    @property
    def is_cut_short(self) -> bool:
        """Whether a search that finds nothing ends before it has tried everything."""
        return self.method == "robust" and self.effort == "fast"
