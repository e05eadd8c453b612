"""Where plots ought to be: their own coordinates, or a table of positions from GNSS. They are searched there first."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from server.collections.frame_systems import FrameSystem
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
        heading: degrees clockwise from north, of the plots' system if it is known and else of the map's, to the plots'
            y axes; None if nothing is known of it.
        heading_sigma: degrees, its standard deviation.
        noise: metres, roughly how far trees are off in the map along each axis; None if that is not known.
        positions: metres, in the map, by plot: where the centre of a plot is, or its point 0, 0 if its coordinates are
            about that. Other plots are where their own coordinates say, unless those are local. Coordinates of another
            system than the map's are converted.
    """

    frame_id: str
    sigma: float
    heading: float | None = 0.0
    heading_sigma: float = 5.0
    noise: float | None = None
    positions: tuple[tuple[str, float, float], ...] = ()

    def position(self, plot: SeasonPlot, system: FrameSystem) -> "NominalPosition | None":
        """Where a plot ought to be in the map, whose system is given; None if nothing says it."""
        known = self._of(plot, system)
        return known if isinstance(known, NominalPosition) else None

    def unused(self, plot: SeasonPlot, system: FrameSystem) -> str:
        """Why what is known of the plot's place cannot be used, in a sentence; empty if it can, or nothing is known."""
        known = self._of(plot, system)
        return known if isinstance(known, str) else ""

    def _of(self, plot: SeasonPlot, system: FrameSystem) -> "NominalPosition | str | None":
        known: Mapping[str, tuple[float, float]] = {name: (x, y) for name, x, y in self.positions}
        there = known.get(plot.name)
        if there is None and plot.is_local:
            return None
        low, high = plot.trees.xy.min(axis=0), plot.trees.xy.max(axis=0)
        size = float((high - low).max())
        rim = 0.25 * size
        is_around = bool((low - rim <= 0.0).all() and (high + rim >= 0.0).all())
        own = system.point_of(plot.trees.crs, plot.centre)
        if there is not None and is_around:
            away = math.inf if own is None else math.dist(own[0], there)
            if plot.is_local or away > _SIGMAS * self.sigma + 0.5 * size:
                return NominalPosition(there, (0.0, 0.0))
        if own is None:
            return (
                f"its coordinates are in {plot.trees.crs} and cannot be converted to {system.name}, the map's system, "
                "so it was searched everywhere: convert them with --project"
            )
        centre, turn = own
        if there is None:
            return NominalPosition(centre, plot.centre, turn)
        away = math.dist(centre, there)
        if away <= _SIGMAS * self.sigma + _APART:
            return NominalPosition(there, plot.centre, turn)
        return (
            f"its position is {away:,.0f} m from its own coordinates, so neither was used and it was searched "
            "everywhere: check both, and their systems"
        )

    def prior(self, plot: SeasonPlot, system: FrameSystem) -> KnownPlace | None:
        """The prior of the plot's query, whose frame has its origin at the plot's centre; None without a position.

        `system` is that of the map frame that positions are in.
        """
        known = self.position(plot, system)
        if known is None:
            return None
        turned = math.radians(self.heading_sigma)
        return KnownPlace(
            self.frame_id,
            Prior(
                known.there[0] - system.origin[0],
                known.there[1] - system.origin[1],
                np.diag([self.sigma**2, self.sigma**2, turned**2]),
                None if self.heading is None else known.turn - math.radians(self.heading),
                (known.about[0] - plot.centre[0], known.about[1] - plot.centre[1]),
                self.noise,
            ),
        )


@dataclass(frozen=True, slots=True)
class NominalPosition:
    """Where one point of a plot ought to be: `there` in the map, `about` in the plot's own coordinates; metres.

    `turn` is the rotation from north of the plot's system to that of the map's, radians, counter-clockwise.
    """

    there: tuple[float, float]
    about: tuple[float, float]
    turn: float = 0.0
