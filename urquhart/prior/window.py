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
from urquhart.prior.superposition import Stems, diameter_ratios, rim, superpose, visibility
from urquhart.se2 import SE2, wrap
from urquhart.verify.landmark_grid import LandmarkGrid


class WindowNumbers(NamedTuple):
    """How a window is searched. Chosen by hand, not fitted."""

    wide: float = 3.5
    """Half the side of a window, in standard deviations of the prior."""
    step: float = 0.5
    """Metres between the shifts that are tried, and between trees at the rim of the observation from turn to turn."""
    around: float = 15.0
    """Metres of map about a window from which the density of its trees is measured."""
    one_tree: float = 0.3
    """Metres: trees of several submaps that are closer are one tree."""
    most_poses: int = 3_000_000
    """Most poses of a window: about a minute."""


WINDOW: Final = WindowNumbers()


class WindowTooLarge(ValueError):
    """A prior so vague that its window cannot be searched pose by pose."""


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
        poses: (P, 3), of the window.
        log_prior: (P,), of the poses.
        turned: rotations of the window, radians, under which the prior says that the observation is not.
        budget: when the search must end.
    """

    stems: Stems
    trees: NDArray[np.float64]
    density: NDArray[np.float64]
    ratios: NDArray[np.float64]
    poses: NDArray[np.float64]
    log_prior: NDArray[np.float64]
    turned: tuple[float, ...]
    budget: Budget

    def here(self) -> Window:
        """The window that the prior gives."""
        return Window(self.poses, self.log_prior, self._score(self.stems, self.poses))

    def around(self, poses: NDArray[np.float64], log_prior: NDArray[np.float64]) -> Window:
        """Other poses (P, 3), such as those of a finer grid."""
        return Window(poses, log_prior, self._score(self.stems, poses))

    def decoys(self) -> Iterator[Window]:
        """Windows that surely do not hold the observation: it is mirrored, or turned to where the prior says it is not.

        In a forest that repeats itself, it fits there as well.
        """
        image = self.stems.mirrored()
        for turn in (0.0, *self.turned):
            poses = self.poses + np.array([0.0, 0.0, turn])
            yield Window(poses, self.log_prior, self._score(image, poses))
            if turn:
                yield Window(poses, self.log_prior, self._score(self.stems, poses))

    def _score(self, stems: Stems, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        portions = self.budget.portions(len(poses), 60.0 * len(self.trees))
        return np.concatenate([superpose(stems, self.trees, self.density, self.ratios, poses[p]) for p in portions])


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
        WindowTooLarge: the window has more than `WINDOW.most_poses` poses.
    """
    features, grid = query
    visible = visibility(len(features.landmarks), features.diameters)
    stems = Stems(grid.landmarks, grid.hull, *rim(len(grid.landmarks), grid.hull, grid.area), visible)
    turns, log_turns = _turns(prior, float(np.hypot(*features.landmarks.T).max()))
    shifts, log_shifts = _shifts(prior.sigma, len(turns))
    poses = []
    for yaw in turns.tolist():
        there = SE2(prior.x, prior.y, yaw).apply(features.origin[None])[0] - submap.origin
        poses.append(np.column_stack([shifts + there, np.full(len(shifts), yaw)]))
    log_prior = (log_turns[:, None] + log_shifts[None, :]).ravel()
    span = math.inf if prior.yaw is None else WINDOW.wide * prior.yaw_sigma
    quarters = (0.5 * math.pi, math.pi, 1.5 * math.pi)
    turned = tuple(turn for turn in quarters if abs(wrap(turn)) > 2.0 * span)
    number = (len(features.landmarks), len(submap.landmarks))
    ratios = diameter_ratios(features.diameters, submap.diameters, number)
    density = np.maximum(submap.density.astype(np.float64), 1e-6)
    return WindowSearch(stems, submap.landmarks, density, ratios, np.concatenate(poses), log_prior, turned, budget)


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
    middle, span = np.array([prior.x, prior.y]), float(np.hypot(*query.origin))
    if prior.yaw is not None:
        middle = SE2(prior.x, prior.y, prior.yaw).apply(query.origin[None])[0]
        span *= min(WINDOW.wide * prior.yaw_sigma, math.pi)
    radius = WINDOW.wide * prior.sigma + span + float(np.hypot(*query.landmarks.T).max()) + WINDOW.around
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


def _shifts(sigma: float, turns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shifts (S, 2), metres, of a window, and the logarithms (S,) of their probabilities."""
    radius = WINDOW.wide * sigma
    if turns * (2.0 * radius / WINDOW.step + 1.0) ** 2 > WINDOW.most_poses:
        raise WindowTooLarge(
            f"a position known to {sigma:g} m leaves too many poses to try each: give a smaller sigma or a heading, "
            "or search without a prior"
        )
    line = WINDOW.step * np.arange(-math.ceil(radius / WINDOW.step), math.ceil(radius / WINDOW.step) + 1)
    x, y = np.meshgrid(line, line)
    kept = x * x + y * y <= radius * radius
    shifts = np.column_stack([x[kept], y[kept]])
    log = -0.5 * (shifts**2).sum(axis=1) / sigma**2
    return shifts, log - np.logaddexp.reduce(log)


def _turns(prior: Prior, radius: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (R,), radians, of a window, and the logarithms (R,) of their probabilities.

    `radius`: metres from the middle of the observation to its farthest tree.
    """
    step = 2.0 * WINDOW.step / max(radius, 2.0 * WINDOW.step)
    if prior.yaw is None or WINDOW.wide * prior.yaw_sigma >= math.pi:
        count = math.ceil(2.0 * math.pi / step)
        return 2.0 * math.pi * np.arange(count) / count, np.full(count, -math.log(count))
    steps = math.ceil(WINDOW.wide * prior.yaw_sigma / step)
    offsets = np.linspace(-WINDOW.wide * prior.yaw_sigma, WINDOW.wide * prior.yaw_sigma, 2 * steps + 1)
    log = -0.5 * (offsets / prior.yaw_sigma) ** 2
    return prior.yaw + offsets, log - np.logaddexp.reduce(log)
