"""Where plots ought to be: their own coordinates, or a table of positions from GNSS. They are searched there first."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from server.coregistration.season import SeasonPlot
from server.queries.query import KnownPlace
from urquhart import Prior

_SIGMAS: Final = 6.0
"""Standard deviations from its position beyond which a plot around the point 0, 0 has coordinates of its own."""
_APART: Final = 100.0
"""Metres beyond that, from which a plot's coordinates and its position contradict each other, so neither is used."""


@dataclass(frozen=True, slots=True)
class NominalPlaces:
    """What is known of where a season's plots are.

    Attributes:
        frame_id: the map frame that positions are in.
        sigma: metres, standard deviation of each coordinate of a position.
        heading: degrees clockwise from the map's north to the plots' y axes; None if nothing is known of it.
        heading_sigma: degrees, its standard deviation.
        noise: metres, roughly how far trees are off in the map along each axis; None if that is not known.
        positions: metres, in the map, by plot: where the centre of a plot is, or its point 0, 0 if its coordinates are
            about that. Other plots are where their own coordinates say, unless those are local.
    """

    frame_id: str
    sigma: float
    heading: float | None = 0.0
    heading_sigma: float = 5.0
    noise: float | None = None
    positions: tuple[tuple[str, float, float], ...] = ()

    def position(self, plot: SeasonPlot) -> "NominalPosition | None":
        """Where a plot ought to be; None if nothing says it."""
        known: Mapping[str, tuple[float, float]] = {name: (x, y) for name, x, y in self.positions}
        if plot.name not in known:
            return None if plot.is_local else NominalPosition(plot.centre, plot.centre)
        there = known[plot.name]
        low, high = plot.trees.xy.min(axis=0), plot.trees.xy.max(axis=0)
        size = float((high - low).max())
        away, rim = math.dist(plot.centre, there), 0.25 * size
        is_around = bool((low - rim <= 0.0).all() and (high + rim >= 0.0).all())
        if is_around and (plot.is_local or away > _SIGMAS * self.sigma + 0.5 * size):
            return NominalPosition(there, (0.0, 0.0))
        return NominalPosition(there, plot.centre) if away <= _SIGMAS * self.sigma + _APART else None

    def prior(self, plot: SeasonPlot, origin: tuple[float, float]) -> KnownPlace | None:
        """The prior of the plot's query, whose frame has its origin at the plot's centre; None without a position.

        `origin`: what is added to the map's coordinates to get those of its system, metres.
        """
        known = self.position(plot)
        if known is None:
            return None
        turned = math.radians(self.heading_sigma)
        return KnownPlace(
            self.frame_id,
            Prior(
                known.there[0] - origin[0],
                known.there[1] - origin[1],
                np.diag([self.sigma**2, self.sigma**2, turned**2]),
                None if self.heading is None else math.radians(-self.heading),
                (known.about[0] - plot.centre[0], known.about[1] - plot.centre[1]),
                self.noise,
            ),
        )


@dataclass(frozen=True, slots=True)
class NominalPosition:
    """Where one point of a plot ought to be: `there` in the map, `about` in the plot's own coordinates; metres."""

    there: tuple[float, float]
    about: tuple[float, float]
