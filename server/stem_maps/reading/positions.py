"""Where the trees of a file are: from its geometries, two columns, polar measurements, or positions within quadrats."""

from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from server.stem_maps.formats.table import BadRow, FileTable, StemMapError
from server.stem_maps.reading.centres import Centres
from server.stem_maps.reading.columns import Columns
from server.stem_maps.reading.options import METRES, ReadOptions
from server.stem_maps.reading.polar import RADIANS, check_angles, horizontal, offsets, within_quadrats
from server.stem_maps.reading.systems import (
    agreed_system,
    check_system,
    describe_system,
    is_close,
    is_metric,
    metres_per_unit,
    projected,
    system_of,
)

_POLAR: Final = ("angle", "declination", "slope", "slope_unit", "centre_x", "centre_y")
"""Options that mean nothing without azimuth and distance."""
_TOLD_FEET: Final = 0.01
"""Metres: so much or more between two kinds of feet is told."""
_DISTINCT: Final = 0.98
"""Share of rows, from which different positions are those of trees, a few of which have several stems."""
_REPEATED: Final = 0.5
"""Share of rows, below which different positions are those of plots' centres."""


@dataclass(slots=True, eq=False)
class Positions:
    """How positions are found, and after `compute` what is told of them.

    Attributes:
        table, columns, options: as read.
        centres: centres of plots from a file of their own; None if there is no such file.
        source: where positions come from.
        used: the columns, by meaning, that they are computed from.
        unit: their unit in the file.
        unit_named: whether the header, the caller or a coordinate reference system names that unit.
        told: the columns and units, in words.
        centres_xy: (N, 2) float64, metres, after `compute`: the centre that each row was measured from; None unless
            positions are polar.
        assumed_azimuths: (N,) float64, degrees, after `compute`: azimuths that were taken for degrees because nobody
            named their unit; else None.
        crs: the system of the result, by code or name; None if it is not known.
        assumed_feet: whether, after `compute`, feet were taken for international ones, and that may matter.
    """

    table: FileTable
    columns: Columns
    options: ReadOptions
    centres: Centres | None
    source: Literal["geometry", "columns", "polar", "quadrats"]
    used: tuple[str, ...]
    unit: str = "m"
    unit_named: bool = False
    told: str = ""
    crs: str | None = None
    assumed_feet: bool = False
    centres_xy: NDArray[np.float64] | None = None
    assumed_azimuths: NDArray[np.float64] | None = None
    factor: float = field(default=1.0, repr=False)

    @property
    def is_read(self) -> bool:
        """Whether positions stand in two columns as they are."""
        return self.source == "columns"

    def compute(self, numbers: dict[str, NDArray[np.float64]], bad_rows: list[BadRow]) -> NDArray[np.float64]:
        """Positions (N, 2) in metres, NaN where a row has none, from the columns `used`. Raises StemMapError."""
        system = agreed_system(self.table.path, self.table.crs, self.options.crs)
        is_placed = self.centres is not None and self.centres.crs is not None
        if system is None and not is_placed and self.options.project and "project" not in self.options.from_file:
            raise StemMapError(self.table.path, "--project is given: name the system of the positions with --crs, too")
        self._set_unit(system)
        if self.source == "geometry" and self.table.xy is not None:
            xy = self.table.xy * self.factor
            self.told = f"positions from the {'points' if self.table.crs or not self.columns.positions else 'geometry'}"
        elif self.source == "columns":
            xy = np.column_stack([numbers["x"], numbers["y"]]) * self.factor
            self.told = f"x_m from {self.columns.names['x']!r}, y_m from {self.columns.names['y']!r}"
        elif self.source == "quadrats":
            xy, told = within_quadrats(
                self.table.path,
                self.table.texts(self.columns.positions["quadrat"]),
                np.column_stack([numbers["lx"], numbers["ly"]]),
                self.options.quadrat_size,
                self.unit,
            )
            xy *= self.factor
            self.told = f"positions from 'quadrat', 'lx' and 'ly': {told}"
        else:
            centre, offset = self._polar(numbers, bad_rows)
            self.centres_xy = centre
            if is_placed:
                self._take_system_of_centres(system)
                return centre + offset
            if system is not None and system.is_geographic:
                # Offsets are metres, so centres in degrees are projected first.
                self.centres_xy = self._on_earth(centre, system)
                return self.centres_xy + offset
            xy = centre + offset
        self.told += "" if self.factor == 1.0 else f", converted from {self.unit} to metres"
        if system is None:
            self._tell_feet(xy)
            return xy
        if self.centres_xy is None:
            return self._on_earth(xy, system)
        both = self._on_earth(np.concatenate([xy, self.centres_xy]), system)
        self.centres_xy = both[len(xy) :]
        return both[: len(xy)]

    def _set_unit(self, system: CRS | None) -> None:
        named = ("lx",) if self.source == "quadrats" else ("centre_x", "x")
        unit = next((self.columns.units[key] for key in named if key in self.columns.units), self.options.unit)
        self.unit_named = unit is not None or (system is not None and system.is_projected)
        if system is not None and not system.is_geographic:
            own = metres_per_unit(system)
            if self._is_any_foot(unit) and is_close(METRES["us-ft"], own):
                unit = "us-ft"
            if unit is not None and not is_close(METRES[unit], own):
                raise StemMapError(
                    self.table.path,
                    f"{describe_system(system)} has a unit of {own:g} m, but positions are said to be in {unit}: drop "
                    "one",
                )
            self.factor = own
            self.unit = unit or ("m" if is_metric(system) else system.axis_info[0].unit_name)
        elif unit is not None:
            self.factor, self.unit = METRES[unit], unit

    def _is_any_foot(self, unit: str | None) -> bool:
        """Whether a unit is the `ft` of a header, which people also write for US survey feet."""
        return unit == "ft" and self.options.unit is None

    def _tell_feet(self, xy: NDArray[np.float64]) -> None:
        """Tell by how much positions (N, 2), metres, of no known system would be off in US survey feet."""
        if not self._is_any_foot(self.unit):
            return
        far = float(np.abs(xy[np.isfinite(xy)]).max(initial=0.0)) * (METRES["us-ft"] / METRES["ft"] - 1.0)
        if far >= _TOLD_FEET:
            self.assumed_feet = True
            self.told += (
                f", taken for international feet: if they are US survey feet, they are off by {far:.2f} m, so say "
                "--unit us-ft, or ft to keep them"
            )

    def _take_system_of_centres(self, own: CRS | None) -> None:
        """Positions are in the system of their centres, which were converted when read. Raises StemMapError."""
        assert self.centres is not None
        crs = self.centres.crs
        if own is not None and self.options.project is None and describe_system(own) != crs:
            raise StemMapError(
                self.table.path,
                f"is in {describe_system(own)}, but the centres in {self.centres.path.name} are in {crs}: convert both "
                f"with --project {crs}",
            )
        self.crs, self.unit, self.unit_named = crs, "m", True
        self.told += f", in {crs}"

    def _on_earth(self, xy: NDArray[np.float64], system: CRS) -> NDArray[np.float64]:
        """Positions in metres, checked against their system, or converted to the one that the caller wants."""
        path = self.table.path
        in_units = xy / self.factor
        known = in_units[np.isfinite(in_units).all(axis=1)]
        if self.options.project is not None:
            target = system_of(path, self.options.project, "--project")
            there = np.full_like(xy, np.nan)
            there[np.isfinite(xy).all(axis=1)] = projected(path, known, system, target)
            self.factor, self.crs = metres_per_unit(target), describe_system(target)
            self.told += f", converted from {describe_system(system)} to {self.crs}"
            check_system(path, there[np.isfinite(there).all(axis=1)], target, "--project")
            self.unit, self.unit_named = "m", True
            return np.asarray(there * self.factor)
        check_system(path, known, system, "its system" if self.options.crs is None else "--crs")
        self.crs = describe_system(system)
        self.told += f", in {self.crs}"
        return xy

    def _polar(
        self, numbers: dict[str, NDArray[np.float64]], bad_rows: list[BadRow]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres (N, 2), in the system of the file, and offsets from them (N, 2), metres, of polar measurements.

        A row without azimuth or distance has none.
        """
        path, names = self.table.path, self.columns.names
        unit = check_angles(path, numbers["azimuth"], self.columns.units.get("azimuth"), names["azimuth"])
        self.assumed_azimuths = None if "azimuth" in self.columns.units else numbers["azimuth"]
        length = self.columns.units.get("distance") or self.options.unit or "m"
        distance = numbers["distance"] * METRES[length]
        bad_rows += [BadRow(line, names["distance"], "is negative") for line in self.table.lines[distance < 0].tolist()]
        guessed = "" if "azimuth" in self.columns.units else ", which names no unit,"
        told = [f"positions from azimuths in {unit} of {names['azimuth']!r}{guessed} and distances in {length} of "
                f"{names['distance']!r}"]  # fmt: skip
        if "slope" in numbers:
            slope_unit = self.columns.units.get("slope", "deg")
            distance = horizontal(path, distance, numbers["slope"], slope_unit)
            told.append(f"made horizontal with slopes in {slope_unit} of {names['slope']!r}")
        declination = np.radians(self.options.declination or 0.0)
        if declination:
            told.append(f"{self.options.declination:g} deg added to azimuths")
        centre, whose = self._centre(numbers)
        self.told = ", ".join([*told, whose])
        return centre, offsets(numbers["azimuth"] * RADIANS[unit] + declination, distance)

    def _centre(self, numbers: dict[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], str]:
        """The centre (N, 2) of each row's plot, metres, and where it comes from. Raises StemMapError."""
        names = self.columns.names
        if self.centres is not None:
            if "plot" not in self.columns.positions:
                raise StemMapError(self.table.path, "--centres is given: name the column of plots with --plot, too")
            plots = self.table.texts(self.columns.positions["plot"])
            places = self.centres.places
            missing = sorted(set(plots) - places.keys())
            if missing:
                raise StemMapError(self.table.path, f"--centres has no centre of the plot {missing[0]!r}")
            return np.array([places[plot] for plot in plots]).reshape(-1, 2), "from the centres of --centres"
        for x, y in (("centre_x", "centre_y"), ("x", "y")):
            if x in numbers:
                told = f"from centres in {names[x]!r} and {names[y]!r}"
                return np.column_stack([numbers[x], numbers[y]]) * self.factor, told
        if self.table.xy is not None and self.source == "polar":
            return self.table.xy * self.factor, "from centres in the geometry"
        return np.zeros((len(self.table), 2)), "from a centre at 0, 0"


def find_positions(table: FileTable, columns: Columns, options: ReadOptions, centres: Centres | None) -> Positions:
    """How the positions of a file are found.

    Azimuth and distance are used if the caller names them, if there is nothing else, or if positions repeat, as those
    of plots' centres do.
    """
    there = columns.positions.keys()
    polar = tuple(key for key in ("azimuth", "distance", "slope") if key in there)
    is_named = options.azimuth is not None or centres is not None
    if {"azimuth", "distance"} <= there and (is_named or _are_centres(table, columns)):
        pairs: tuple[tuple[str, ...], ...] = (("centre_x", "centre_y"), ("x", "y"))
        centre: tuple[str, ...] = next((pair for pair in pairs if set(pair) <= there), ())
        return Positions(table, columns, options, centres, "polar", (*polar, *(() if centres else centre)))
    if centres is not None:
        raise StemMapError(table.path, "--centres is given: name the columns with --azimuth and --distance, too")
    for option in _POLAR:
        if getattr(options, option) is not None and option not in options.from_file:
            name = option.replace("_", "-")
            raise StemMapError(
                table.path, f"--{name} is for polar measurements, and the file's positions are not: drop it, or name "
                "the columns with --azimuth and --distance"
            )  # fmt: skip
    if "x" in there:
        return Positions(table, columns, options, centres, "columns", ("x", "y"))
    if table.xy is not None:
        return Positions(table, columns, options, centres, "geometry", ())
    return Positions(table, columns, options, centres, "quadrats", ("quadrat", "lx", "ly"))


def _are_centres(table: FileTable, columns: Columns) -> bool:
    """Whether rows have no positions, or share them, as rows that were measured from one centre do."""
    if "x" in columns.positions:
        places = set(zip(*(table.texts(columns.positions[key]) for key in "xy"), strict=True))
    elif table.xy is not None:
        places = set(map(tuple, table.xy.tolist()))
    else:
        return "lx" not in columns.positions
    if len(table) >= 3 and _REPEATED * len(table) <= len(places) < _DISTINCT * len(table):
        raise StemMapError(
            table.path,
            f"{len(table)} rows have {len(places)} positions, beside an azimuth and a distance: say whether those are "
            "to be used, with --azimuth and --distance, or not, with --ignore",
        )
    return len(table) >= 3 and len(places) < _REPEATED * len(table)
