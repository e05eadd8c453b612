"""What the caller says about a file of trees: options of the command line, or a `columns.toml` beside the file."""

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Literal

from server.stem_maps.formats.table import StemMapError

LengthUnit = Literal["m", "ft", "us-ft", "cm", "km"]
StemUnit = Literal["cm", "mm", "m", "in"]
AngleUnit = Literal["deg", "gon", "rad"]
SlopeUnit = Literal["deg", "gon", "rad", "percent"]
DecimalMark = Literal["point", "comma"]
METRES: Final = {
    "m": 1.0, "ft": 0.3048, "us-ft": 1200 / 3937, "cm": 0.01, "km": 1000.0, "mm": 0.001, "in": 0.0254, "yd": 0.9144,
}  # fmt: skip
"""Metres in one unit of length."""
CENTIMETRES: Final = {"cm": 1.0, "mm": 0.1, "m": 100.0, "in": 2.54}
"""Centimetres in one unit of diameter."""
COLUMNS_FILE: Final = "columns.toml"


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What is known of a file beforehand. None leaves it to the header, or to the file itself.

    Attributes:
        x, y: names of the columns of positions.
        id, plot, dbh, height, species: names of those columns. `plot` also makes each plot a submap of its own.
        only: the one plot to read.
        unit: of the positions.
        dbh_unit, height_unit: of diameters and heights.
        crs: the coordinate reference system of the positions, such as `EPSG:25832`.
        project: a system to convert positions to, which the file gives in another one, for instance in degrees.
        layer: the layer or sheet to read.
        decimal: the decimal mark.
        status: name of the column that says whether a tree is alive; `keep` are its values of trees to read.
        azimuth, distance, slope: names of the columns of polar measurements. Azimuths run clockwise from north.
        angle, slope_unit: units of azimuths and slopes.
        declination: degrees to add to azimuths, positive where magnetic north is east of grid north.
        centre_x, centre_y: names of the columns of the plot's centre that a row was measured from.
        centres: a file of those centres, with the columns plot, x and y.
        quadrat_size: metres; side of the quadrats that `lx` and `ly` are measured in.
        ignore: names of columns that are not used.
        skip_bad: whether rows that cannot be used are left out and counted, instead of refusing the file.
        each_plot: whether a column of plots that nobody named makes each plot a submap of its own, too.
        from_file: members that a `columns.toml` gave, and not the caller.
    """

    x: str | None = None
    y: str | None = None
    id: str | None = None
    plot: str | None = None
    only: str | None = None
    dbh: str | None = None
    dbh_unit: StemUnit | None = None
    height: str | None = None
    height_unit: LengthUnit | None = None
    species: str | None = None
    unit: LengthUnit | None = None
    crs: str | None = None
    project: str | None = None
    layer: str | None = None
    decimal: DecimalMark | None = None
    status: str | None = None
    keep: tuple[str, ...] = ()
    azimuth: str | None = None
    distance: str | None = None
    angle: AngleUnit | None = None
    declination: float | None = None
    slope: str | None = None
    slope_unit: SlopeUnit | None = None
    centre_x: str | None = None
    centre_y: str | None = None
    centres: Path | None = None
    quadrat_size: float | None = None
    ignore: tuple[str, ...] = ()
    skip_bad: bool = False
    each_plot: bool = field(default=False, metadata={"internal": True})
    from_file: tuple[str, ...] = field(default=(), metadata={"internal": True})

    def named(self) -> dict[str, str]:
        """Names of columns that the caller gave, by their meanings."""
        members = ("x", "y", "id", "plot", "dbh", "height", "species", "status", "azimuth", "distance", "slope",
                   "centre_x", "centre_y")  # fmt: skip
        return {member: name for member in members if (name := getattr(self, member)) is not None}


KEYS: Final = tuple(one.name for one in fields(ReadOptions) if not one.metadata)
"""The members that a caller may give, in the order of the documentation."""
CHOICES: Final[Mapping[str, tuple[str, ...]]] = {
    "unit": LengthUnit.__args__,  # type: ignore[attr-defined]
    "dbh_unit": StemUnit.__args__,  # type: ignore[attr-defined]
    "height_unit": LengthUnit.__args__,  # type: ignore[attr-defined]
    "decimal": DecimalMark.__args__,  # type: ignore[attr-defined]
    "angle": AngleUnit.__args__,  # type: ignore[attr-defined]
    "slope_unit": SlopeUnit.__args__,  # type: ignore[attr-defined]
}
"""The values of members that have a few."""


def with_columns_file(path: Path, options: ReadOptions) -> ReadOptions:
    """`options`, and for what they do not say the `columns.toml` beside the file `path`, if there is one.

    Raises:
        StemMapError: that file is not as it must be.
    """
    beside = path.parent / COLUMNS_FILE
    if not beside.is_file():
        return options
    try:
        members = tomllib.loads(beside.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise StemMapError(beside, f"is no TOML file that can be read: {error}") from error
    found = {key.replace("-", "_"): value for key, value in members.items()}
    checked = {key: _checked(beside, key, value) for key, value in found.items()}
    missing = {key: value for key, value in checked.items() if not getattr(options, key) and value is not None}
    return replace(options, **missing, from_file=tuple(missing)) if missing else options


def _checked(path: Path, key: str, value: Any) -> Any:
    """The value of one member, as `ReadOptions` has it. Raises StemMapError."""
    if key not in KEYS:
        near = difflib.get_close_matches(key, KEYS, n=1)
        meant = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(KEYS)}"
        raise StemMapError(path, f"the key {key!r} is not known{meant}")
    if key in ("keep", "ignore") and isinstance(value, list) and all(isinstance(one, str) for one in value):
        return tuple(value)
    if key in ("declination", "quadrat_size"):
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
    elif key == "skip_bad":
        if isinstance(value, bool):
            return value
    elif isinstance(value, str) and key not in ("keep", "ignore"):
        if key in CHOICES and value not in CHOICES[key]:
            raise StemMapError(path, f"{key} is {value!r}, and must be one of {', '.join(CHOICES[key])}")
        return path.parent / value if key == "centres" else value
    raise StemMapError(path, f"{key} is {value!r}, which is not what it must be: see docs/files.md")
