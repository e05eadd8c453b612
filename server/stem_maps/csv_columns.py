"""The meaning of a stem map's columns, by their names. Columns that are not understood are named or refused."""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.stem_maps.csv_rows import SEPARATORS, Rows, StemMapError

_ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "tree_id": ("tree_id", "id"),
    "x_m": ("x_m", "x"),
    "y_m": ("y_m", "y"),
    "height_m": ("height_m",),
    "species": ("species",),
}
_OTHER_IDS: Final = ("treeid", "tree", "tag")
"""Names of id columns, used if there is no `tree_id` or `id`, in order of preference."""
DBH_UNITS: Final = {"cm": 1.0, "mm": 0.1, "m": 100.0, "in": 2.54}
"""Centimetres in one unit of diameter."""
PLOT_NAMES: Final = ("plot", "plot_id", "plotid", "plot_no", "plot_nr", "plot_name")
_SHOWN: Final = 8
"""Most names of columns in a message."""
_AZIMUTH: Final = ("azimuth", "azimut", "azi", "bearing", "azimuth_deg", "azimuth_gon")
_DISTANCE: Final = ("distance", "dist", "distance_m", "dist_m", "horizontal_distance")
_FACTORS: Final = {"ft": 0.3048, "feet": 0.3048, "foot": 0.3048, "us_ft": 0.3048006, "usft": 0.3048006, "cm": 0.01,
                   "mm": 0.001, "km": 1000.0, "in": 0.0254, "yd": 0.9144}  # fmt: skip
_OTHER_UNIT: Final = re.compile(rf"[xy]_?({'|'.join(_FACTORS)})")


@dataclass(frozen=True, slots=True)
class Columns:
    """Positions of the columns that are read, by meaning, and the other columns.

    Attributes:
        positions: of `x_m`, `y_m`, and where there are such columns `tree_id`, `dbh`, `height_m`, `species`.
        names: the header's own names, by the same keys.
        dbh_unit: of the diameters; None without such a column.
        dbh_named: whether the header or the caller named that unit.
        plot: position of a column of plots, None without one; `plot_name` is its name.
        polar: names of the columns of azimuth and distance; empty without them.
        unused: names of columns that are not read.
    """

    positions: dict[str, int]
    names: dict[str, str]
    dbh_unit: str | None
    dbh_named: bool
    plot: int | None
    plot_name: str
    polar: tuple[str, ...]
    unused: tuple[str, ...]

    def described(self) -> str:
        """The columns that are read, with their meanings, and those that are not."""
        read = [f"{key} from {self.names[key]!r}" for key in ("tree_id", "x_m", "y_m") if key in self.names]
        if self.dbh_unit is not None:
            guessed = "" if self.dbh_named else ", which names no unit"
            read.append(f"diameters in {self.dbh_unit} from {self.names['dbh']!r}{guessed}")
        read += [f"{key} from {self.names[key]!r}" for key in ("height_m", "species") if key in self.names]
        unused = f"; not used: {', '.join(map(repr, self.unused))}" if self.unused else ""
        return f"read {', '.join(read)}{unused}"


def find_columns(path: Path, rows: Rows, dbh_unit: str | None, ignore: Collection[str]) -> Columns:
    """The meaning of the columns of a header. Columns in `ignore` (lower case) have none.

    Raises:
        StemMapError: a column that is needed is missing, or two could be meant.
    """
    line = rows.header_line
    names = [name.lower() for name in rows.header]
    missing = sorted(set(ignore) - set(names))
    if missing:
        raise StemMapError(path, f"there is no column {missing[0]!r}, which --ignore names", line)
    names = ["" if name in ignore else name for name in names]
    positions: dict[str, int] = {}
    for key, aliases in _ALIASES.items():
        found = [position for position, name in enumerate(names) if name in aliases]
        if len(found) > 1:
            raise StemMapError(
                path, f"two columns are called {' or '.join(aliases)}: keep one, or name the other with --ignore", line
            )
        if found:
            positions[key] = found[0]
    other_ids = [names.index(name) for name in _OTHER_IDS if name in names]
    if "tree_id" not in positions and other_ids:
        positions["tree_id"] = other_ids[0]
    polar = _polar(names)
    for key in ("x_m", "y_m"):
        if key not in positions:
            raise StemMapError(path, _missing(key, names, rows, polar), line)
    unit, named = _diameters(path, names, dbh_unit, line, positions)
    plot = next((position for position, name in enumerate(names) if name in PLOT_NAMES), None)
    return Columns(
        positions=positions,
        names={key: rows.header[position] for key, position in positions.items()},
        dbh_unit=unit,
        dbh_named=named,
        plot=plot,
        plot_name="" if plot is None else rows.header[plot],
        polar=polar,
        unused=tuple(name for position, name in enumerate(rows.header) if position not in positions.values()),
    )


def _diameters(
    path: Path, names: list[str], unit: str | None, line: int, positions: dict[str, int]
) -> tuple[str | None, bool]:
    known = {"dbh": unit or "cm"} | {f"dbh_{one}": one for one in DBH_UNITS}
    found = [(position, name) for position, name in enumerate(names) if name in known]
    if len(found) > 1:
        both = " and ".join(repr(name) for _, name in found[:2])
        raise StemMapError(
            path, f"the columns {both} are both diameters: keep one, or name the other with --ignore", line
        )
    if not found:
        return None, False
    position, name = found[0]
    if name != "dbh" and unit not in (None, known[name]):
        raise StemMapError(path, f"the column {name!r} names its unit, but --dbh-unit says {unit}: drop one", line)
    positions["dbh"] = position
    return known[name], name != "dbh" or unit is not None


def _polar(names: list[str]) -> tuple[str, ...]:
    azimuth = [name for name in names if name in _AZIMUTH]
    distance = [name for name in names if name in _DISTANCE]
    return (azimuth[0], distance[0]) if azimuth and distance else ()


def _missing(key: str, names: list[str], rows: Rows, polar: tuple[str, ...]) -> str:
    if polar:
        return (
            f"the columns {polar[0]!r} and {polar[1]!r} are polar measurements, which are not read: compute each "
            "tree's position, and give it as x_m and y_m"
        )
    needed = f"column {' or '.join(_ALIASES[key])} is missing"
    for name in names:
        unit = _OTHER_UNIT.fullmatch(name)
        if unit is not None:
            factor = _FACTORS[unit[1]]
            return f"{needed}, and {name!r} is not in metres: multiply it by {factor:g} and call it {name[0]}_m"
    if {"lon", "longitude", "lat", "latitude"} & set(names):
        return f"{needed}, and longitude and latitude are degrees: project them, for example to UTM, into x_m and y_m"
    separated = "" if len(names) > 1 else f", separated by {', '.join(SEPARATORS.values())}"
    found = ", ".join(repr(name[:20]) for name in rows.header[:_SHOWN])
    more = f" and {len(rows.header) - _SHOWN} more" if len(rows.header) > _SHOWN else ""
    return f"{needed}: the header must name x_m and y_m{separated}, and it names {found}{more}"
