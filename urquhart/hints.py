"""Why an observation was not found: it would be, if its coordinates were mirrored, or of another unit or scale.

Each search for a changed observation takes as long as one for the observation itself, so this is for callers who ask
for it, and only after a search without a match.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import Budget
from urquhart.config import Config
from urquhart.decide.candidates import Candidate
from urquhart.decide.verdict import Recognition
from urquhart.features.describe import Features, describe
from urquhart.features.landmark_checks import LandmarkError
from urquhart.prior.prior import Prior
from urquhart.se2 import SE2

HintWord = Literal["mirrored", "feet", "metres", "mercator", "scaled"]
"""What is wrong with the coordinates. The words are part of the API."""
FOOT: Final = 0.3048
"""Metres of an international foot. That of the US survey differs by 2 millionths."""


class HintNumbers(NamedTuple):
    """What is tried for a hint. Chosen by hand, not fitted."""

    scales: tuple[float, ...] = (0.97, 1.03, 0.94, 1.06)
    """Factors beside those of units and of projections. Smaller ones match anyway, with a warning; between two of
    these, no tree within 30 m of the middle is off by more than 0.5 m."""
    seconds: float = 10.0
    """Longest time of all searches for changed observations."""


HINTS: Final = HintNumbers()


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the coordinates of an observation.

    Attributes:
        word: what is wrong with them, if the changed observation fits.
        matrix: ((xx, xy), (yx, yy)), by which positions are multiplied.
    """

    word: HintWord
    matrix: tuple[tuple[float, float], tuple[float, float]]

    def points(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (N, 2) after the change."""
        return np.asarray(xy @ np.array(self.matrix).T)

    @property
    def factor(self) -> float:
        """How much longer distances are after the change."""
        (a, b), (c, d) = self.matrix
        return math.sqrt(abs(a * d - b * c))


@dataclass(frozen=True, slots=True)
class Hint:
    """What would make an observation match.

    Attributes:
        word: what is wrong.
        factor: by which the observation's coordinates must be multiplied; 1 if only an axis must be reversed.
        key: the submap that it then matches.
        inliers: number of pairs of trees there.
        sentence: says it for people, and what to do.
    """

    word: HintWord
    factor: float
    key: int
    inliers: int
    sentence: str


def changes(latitude: float | None, *, turned: bool) -> Iterator[Change]:
    """The changes that are tried, in order.

    Args:
        latitude: degrees, of the map; None if it is not known, and then no projection is tried.
        turned: whether the heading is known, so that it matters along which axis an image is mirrored.
    """
    yield Change("mirrored", ((1.0, 0.0), (0.0, -1.0)))
    if turned:
        yield Change("mirrored", ((-1.0, 0.0), (0.0, 1.0)))
        yield Change("mirrored", ((0.0, 1.0), (1.0, 0.0)))
    yield _scaled("feet", FOOT)
    yield _scaled("metres", 1.0 / FOOT)
    if latitude is not None and 5.0 < abs(latitude) < 80.0:
        yield _scaled("mercator", math.cos(math.radians(latitude)))
        yield _scaled("mercator", 1.0 / math.cos(math.radians(latitude)))
    for factor in HINTS.scales:
        yield _scaled("scaled", factor)


def find_hint(
    observation: Features,
    search: Callable[[Features, Change], Recognition],
    tried: Sequence[Change],
    config: Config,
    stored: Callable[[int], Features],
    budget: Budget,
) -> Hint | None:
    """The first change with which an observation matches; None if there is none, or the budget is spent first.

    Args:
        observation: that was not found.
        search: searches a changed observation.
        tried: the changes to try, in order.
        config: that both sides were described with.
        stored: features of a submap, by key.
        budget: of all searches; each is checked before it begins.

    Raises:
        Abandoned: nobody waits for the answer any more.
    """
    diameters = observation.diameters if len(observation.diameters) else None
    for change in tried:
        if budget.is_spent():
            return None
        try:
            changed = describe(change.points(observation.landmarks + observation.origin), config, diameters)
        except LandmarkError:
            continue  # too small or too large to be trees
        found = search(changed, change)
        if found.verdict == "matched":
            best = found.candidates[0]
            factor = change.factor
            if change.word == "scaled":
                factor *= _scale(changed, stored(best.key), best)
            return Hint(change.word, factor, best.key, len(best.residuals), _sentence(change.word, factor, best))
    return None


def _scale(observation: Features, submap: Features, best: Candidate) -> float:
    """The least-squares scale of a submap's trees against those of a changed observation, over their pairs."""
    seen = SE2(0.0, 0.0, best.transform.yaw).apply(observation.landmarks[best.query_indices])
    there = submap.landmarks[best.submap_indices]
    seen, there = seen - seen.mean(axis=0), there - there.mean(axis=0)
    return float((seen * there).sum() / (seen * seen).sum())


def changed_prior(prior: Prior, change: Change) -> Prior:
    """The prior of a changed observation: the known point changes with it."""
    x, y = change.points(np.array([prior.about]))[0].tolist()
    return Prior(prior.x, prior.y, prior.covariance, prior.yaw, (x, y), prior.noise)


def _scaled(word: HintWord, factor: float) -> Change:
    return Change(word, ((factor, 0.0), (0.0, factor)))


def _sentence(word: HintWord, factor: float, best: Candidate) -> str:
    fits = f"with {len(best.residuals)} trees"
    return {
        "mirrored": f"the mirror image fits {fits}: an axis or the direction of angles is reversed, or x and y are "
        "swapped",
        "feet": f"it fits {fits} if its coordinates are in feet (times {FOOT:g}): say so with its unit",
        "metres": f"it fits {fits} if it is {factor:.4g} times as large: the map may be in feet",
        "mercator": f"it fits {fits} at {factor:.4f} times its size, the scale of Web Mercator at this latitude: one "
        "side is in EPSG:3857, whose metres are none; convert it to a projected system such as UTM",
        "scaled": f"it fits {fits} at about {factor:.2f} times its size: a unit, a range calibration or a scale is off",
    }[word]
