"""What coregistration finds for one plot: a record that is written as JSON, line by line, and read again."""

from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

import orjson

from server.collections.frame_systems import metres_per_unit_of

Outcome = Literal["matched", "ambiguous", "no_match", "not_read", "failed"]
"""The verdict of a query; or `not_read`, if the plot cannot be read, or `failed`, if it cannot be looked up."""


@dataclass(frozen=True, slots=True)
class PlotPose:
    """Where a plot lies in the map. Lengths in metres, also in a system of feet; angles in degrees.

    Attributes:
        frame_id: of the map.
        crs: the map's coordinate reference system; None if it is not known.
        e, n: the plot's centre in the map.
        shift_e, shift_n: that, less where the plot ought to be, or the centre in its own coordinates, converted to the
            map's system; None if they cannot be.
        turn_cw: rotation from the plot's axes to the map's, clockwise, after the plot's coordinates are converted to
            the map's system, as for the shift.
        nominal_e, nominal_n: where that centre ought to be by what is known of the plot; None if nothing is.
        sigma_e, sigma_n, sigma_turn: one standard deviation of centre and rotation; None if not known.
        matrix: (4, 4), row by row: homogeneous coordinates of the plot to those of the map; heights stay.
    """

    frame_id: str
    crs: str | None
    e: float
    n: float
    shift_e: float | None
    shift_n: float | None
    turn_cw: float
    nominal_e: float | None
    nominal_n: float | None
    sigma_e: float | None
    sigma_n: float | None
    sigma_turn: float | None
    matrix: list[list[float]]

    @property
    def in_system(self) -> tuple[float, float]:
        """`e` and `n` in the unit of the map's system, as people write them; metres without one."""
        return in_unit((self.e, self.n), self.crs)


def in_unit(point: tuple[float, float], crs: str | None) -> tuple[float, float]:
    """A point, metres, in the unit of the projected system `crs`; metres without one."""
    unit = metres_per_unit_of(crs)
    return point[0] / unit, point[1] / unit


@dataclass(frozen=True, slots=True)
class PossiblePlace:
    """One of the places that an ambiguous plot fits: its centre in the map, metres, and its turn, degrees clockwise.

    `crs` is the map's coordinate reference system; None if it is not known.
    """

    frame_id: str
    submap_id: str
    e: float
    n: float
    turn_cw: float
    trees: int
    crs: str | None = None

    @property
    def in_system(self) -> tuple[float, float]:
        """`e` and `n` in the unit of the map's system, as people write them; metres without one."""
        return in_unit((self.e, self.n), self.crs)


@dataclass(frozen=True, slots=True)
class PlotTree:
    """A tree of a plot: in its own coordinates, and in the map with its partner there, if the plot is placed.

    Attributes:
        x, y, e, n: metres.
        dbh_cm, partner_dbh_cm: centimetres.
        partner: id of the same tree in the map; None if it has no partner.
        residual: metres between the two in the map.
    """

    id: str
    x: float
    y: float
    dbh_cm: float | None
    e: float | None = None
    n: float | None = None
    partner: str | None = None
    partner_dbh_cm: float | None = None
    residual: float | None = None


@dataclass(frozen=True, slots=True)
class MapTree:
    """A tree of the map: its place, metres; `dbh_cm`; whether it is paired, and whether it lies inside the plot."""

    id: str
    e: float
    n: float
    dbh_cm: float | None
    paired: bool
    inside: bool


@dataclass(frozen=True, slots=True)
class PlotResult:
    """What was found for one plot.

    Attributes:
        name: of the plot; `file` is where it was read from, and `system` its coordinate reference system, if known.
        key: digest of everything that the result depends on.
        outcome, reason: the verdict, and why, as stable words; `sentence` says it for people.
        centre: x and y of the plot's centre in its own coordinates, metres; None if the plot was not read.
        is_local: whether the plot's coordinates are about a point of its own, so that a shift says nothing.
        radius: metres from there to the farthest tree.
        pose: where the plot is, only if it is matched.
        inliers: trees with a partner in the map.
        share: inliers divided by the plot's trees.
        rms: root mean square of the residuals, metres.
        scale: factor by which the map is larger than the plot.
        confidence: calibrated probability that the pose is right.
        places: the places that fit, if the plot is ambiguous: the best one first.
        warnings: what is wrong with coordinates, as stable words.
        trees, map_trees: of the plot, and of the map around it if it is matched.
        notes: sentences about what was known of the plot and could not be used.
        searched: `near` if it was found where it ought to be, `everywhere` if not; empty if nothing was searched.
        seconds: that the search took.
    """

    name: str
    file: str
    key: str
    outcome: Outcome
    reason: str
    sentence: str
    system: str | None = None
    centre: tuple[float, float] | None = None
    is_local: bool = False
    radius: float = 0.0
    pose: PlotPose | None = None
    inliers: int = 0
    share: float | None = None
    rms: float | None = None
    scale: float | None = None
    confidence: float | None = None
    places: list[PossiblePlace] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    trees: list[PlotTree] = field(default_factory=list)
    map_trees: list[MapTree] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    searched: Literal["", "near", "everywhere"] = ""
    seconds: float = 0.0

    def to_json(self) -> bytes:
        """The record as one line of JSON."""
        return orjson.dumps(asdict(self))


_PARTS: dict[str, Any] = {"places": PossiblePlace, "trees": PlotTree, "map_trees": MapTree}


def from_json(line: bytes) -> PlotResult:
    """The record that `PlotResult.to_json` wrote. Raises ValueError if it is another one, or cut off."""
    members = orjson.loads(line)
    if not isinstance(members, dict) or members.keys() != {one.name for one in fields(PlotResult)}:
        raise ValueError("not a result of this version")
    try:
        for name, kind in _PARTS.items():
            members[name] = [kind(**one) for one in members[name]]
        if members["pose"] is not None:
            members["pose"] = PlotPose(**members["pose"])
        if members["centre"] is not None:
            x, y = members["centre"]
            members["centre"] = (x, y)
        return PlotResult(**members)
    except TypeError as error:
        raise ValueError("not a result of this version") from error
