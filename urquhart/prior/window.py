"""Poses proposed by a prior: all of its window, on a grid, with the evidence for each."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart.budget import UNBOUNDED, Budget
from urquhart.features.describe import Features
from urquhart.prior.prior import Prior
from urquhart.prior.region import Region, window_extent
from urquhart.prior.superposition import SUPERPOSITION, Stems, diameter_ratios, rim, superpose, trial_noise, visibility
from urquhart.se2 import SE2
from urquhart.verify.landmark_grid import LandmarkGrid


class WindowNumbers(NamedTuple):
    """How the trees about a window are gathered. Chosen by hand, not fitted."""

    around: float = 15.0
    """Metres of map about a window from which the density of its trees is measured."""
    one_tree: float = 0.3
    """Metres: trees of several submaps that are closer are one tree."""


WINDOW: Final = WindowNumbers()
_STEPS: Final = 5_000.0
"""Steps of a budget that one pose takes: about as much work as reading so many landmarks."""


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """The poses of a window.

    Attributes:
        poses: (P, 3) float64: x, y, yaw of `map_T_query` between centred frames, metres and radians.
        log_prior: (P,) float64, logarithm of the prior probability of each; the probabilities add up to 1.
        evidence: (P,) float64, log-likelihood ratio of each against chance; see `superposition`.
    """

    poses: NDArray[np.float64]
    log_prior: NDArray[np.float64]
    evidence: NDArray[np.float64]

    @property
    def posterior(self) -> NDArray[np.float64]:
        """Logarithm (P,) of prior times likelihood ratio."""
        return self.log_prior + self.evidence


@dataclass(frozen=True, slots=True, eq=False)
class WindowSearch:
    """The search of a prior's window for an observation, in the trees of a map.

    Attributes:
        stems: the observation.
        trees: (T, 2) float64, metres, centred map frame.
        density: (T,) float64, trees per square metre around each.
        ratios: likelihood ratios of diameters, as `diameter_ratios` returns them.
        region: what the prior says of poses.
        poses: (P, 3), of the window.
        log_prior: (P,), of the poses.
        moves: what takes the window to where the prior says that the observation is not: x, y and yaw of each, metres
            and radians.
        budget: when the search must end.
    """

    stems: Stems
    trees: NDArray[np.float64]
    density: NDArray[np.float64]
    ratios: NDArray[np.float64]
    region: Region
    poses: NDArray[np.float64]
    log_prior: NDArray[np.float64]
    moves: tuple[tuple[float, float, float], ...]
    budget: Budget

    def here(self) -> Window:
        """The window that the prior gives."""
        return Window(self.poses, self.log_prior, self._score(self.stems, self.poses))

    def around(self, poses: NDArray[np.float64]) -> Window:
        """Other poses (P, 3), such as those of a finer grid, outside of the window as well; no constant is added to the
        logarithm of their prior."""
        return Window(poses, self.region.free_density(poses), self._score(self.stems, poses))

    def decoys(self) -> Iterator[Window]:
        """Windows that surely do not hold the observation: its mirror image in the window that the prior gives, and
        windows beside that one, or turned away from it. In a forest that repeats itself, the observation fits there as
        well.
        """
        yield Window(self.poses, self.log_prior, self._score(self.stems.mirrored(), self.poses))
        for move in self.moves:
            poses = self.poses + np.array(move)
            yield Window(poses, self.log_prior, self._score(self.stems, poses))

    def _score(self, stems: Stems, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        reach = float(np.hypot(*stems.hull.T).max()) + stems.margin + SUPERPOSITION.far * float(stems.noise[0])
        usual, scored = float(self.density.mean()), [np.empty(0)]
        for portion in self.budget.portions(len(poses), _STEPS):
            some = poses[portion]
            low, high = some[:, :2].min(axis=0) - reach, some[:, :2].max(axis=0) + reach
            near = ((self.trees >= low) & (self.trees <= high)).all(axis=1)
            ratios = self.ratios[:, near] if len(self.ratios) else self.ratios
            scored.append(superpose(stems, self.trees[near], self.density[near], usual, ratios, some))
        return np.concatenate(scored)


def search_window(
    query: tuple[Features, LandmarkGrid],
    submap: Features,
    prior: Prior,
    budget: Budget = UNBOUNDED,
) -> WindowSearch:
    """Prepare the search of a window.

    Args:
        query: features of the observation, and its landmarks prepared for verification.
        submap: features of the map's trees about the prior.
        prior: of `map_T_query`, in the frames as posted.

    Raises:
        WindowTooLarge: the window has too many poses.
    """
    features, grid = query
    visible = visibility(len(features.landmarks), features.diameters)
    margin, area = rim(len(grid.landmarks), grid.hull, grid.area)
    stems = Stems(grid.landmarks, grid.hull, margin, area, visible, trial_noise(prior.noise))
    region = Region.of(prior, features, submap.origin)
    poses, log_prior = region.grid(float(np.hypot(*features.landmarks.T).max()))
    turns = [(0.0, 0.0, turn) for turn in (0.5 * math.pi, math.pi) if turn > 2.0 * region.half_turn]
    x, y = region.beside.tolist()
    moves = ((x, y, 0.0), (-x, -y, 0.0), *turns)
    number = (len(features.landmarks), len(submap.landmarks))
    ratios = diameter_ratios(features.diameters, submap.diameters, number)
    density = np.maximum(submap.density.astype(np.float64), 1e-6)
    return WindowSearch(stems, submap.landmarks, density, ratios, region, poses, log_prior, moves, budget)


def trees_about(
    query: Features, prior: Prior, submaps: Mapping[int, Features], places: Mapping[int, SE2]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """The trees of several submaps in which a window is searched, each once.

    Args:
        query: features of the observation.
        submaps: features by key.
        places: `map_T_submap` of each, in the frames as posted.

    Returns:
        Positions (T, 2) float64, metres, map frame; and diameters (T,) float64, NaN where not known, or None.
    """
    middle, radius = window_extent(prior, query)
    radius += WINDOW.around
    xy, thick = np.empty((0, 2)), np.empty(0)
    for key, place in places.items():
        one = submaps[key]
        there = place.apply(one.landmarks + one.origin)
        measured = one.diameters if len(one.diameters) else np.full(len(there), np.nan)
        new = np.hypot(*(there - middle).T) <= radius
        if len(xy):
            # A tree is known if it and a known one are nearest to each other: tops seen from the air may be very close.
            away, known = cKDTree(xy).query(there)
            mutual = cKDTree(there).query(xy[known])[1] == np.arange(len(there))
            new &= ~(mutual & (away <= WINDOW.one_tree))
        xy, thick = np.concatenate([xy, there[new]]), np.concatenate([thick, measured[new].astype(np.float64)])
    return xy, None if np.isnan(thick).all() else thick
