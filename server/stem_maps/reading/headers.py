"""Well-known names of columns, of the programs that forest surveys use, and what each means."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

PAIRS: Final[Sequence[tuple[str, str]]] = (
    ("x", "y"),
    ("gx", "gy"),
    ("point_x", "point_y"),
    ("treelocationx", "treelocationy"),
    ("easting", "northing"),
    ("east", "north"),
    ("x_coord", "y_coord"),
    ("xcoord", "ycoord"),
    ("coord_x", "coord_y"),
    ("utm_x", "utm_y"),
    ("x_utm", "y_utm"),
    ("location_x", "location_y"),
    ("rechtswert", "hochwert"),
)
"""Names of the two columns of positions, in lower case. Each may end in a unit: `x_m`, `easting_ft`."""
NAMES: Final[Mapping[str, Sequence[str]]] = {
    "id": ("tree_id", "id", "treeid", "tree", "tag", "treetag", "tree_tag", "tree_no", "tree_nr", "treeno", "baum",
           "baum_nr", "baumnr", "arbre", "stem_id", "stemid", "stem", "objectid", "fid", "fid_1", "name", ""),
    "plot": ("plot", "plot_id", "plotid", "plot_no", "plot_nr", "plot_name", "plotname"),
    "dbh": ("dbh", "bhd", "dap", "dhp", "d130", "dbhqsm", "radius"),
    "height": ("height", "tree_height", "treeheight", "höhe", "hoehe", "hauteur", "ht", "hgt", "th", "h"),
    "species": ("species", "sp", "spp", "species_code", "baumart", "essence"),
    "azimuth": ("azimuth", "azimut", "azi", "azim", "bearing"),
    "distance": ("distance", "dist", "horizontal_distance", "hdist", "distanz", "entfernung"),
    "quadrat": ("quadrat",),
    "lx": ("lx",),
    "ly": ("ly",),
}  # fmt: skip
"""Names by meaning, in lower case and in order of preference. The empty name is that of R's row names."""
STATUSES: Final = frozenset({"status", "dfstatus", "tree_status", "alive", "dead", "vitality", "mortality"})
"""Names of columns that say whether a tree is alive. None is read unless the caller names it and what to keep."""
WEAK_IDS: Final = ("stem_id", "stemid", "stem", "objectid", "fid", "fid_1", "name", "")
"""Names of ids that are used only if every row has a value of its own."""
OF_FAMILIES: Final[Mapping[str, str]] = {"h": "TreeLS", "th": "3DFin", "radius": "TreeLS"}
"""Names that mean something only in the tables of one program."""
STRONG_IDS: Final = ("tree_id", "id")
"""Names of ids of which there may be one: two of them are refused."""
FAMILIES: Final[Mapping[str, frozenset[str]]] = {
    "ForestGEO": frozenset({"gx", "gy"}),
    "ForestGEO quadrats": frozenset({"quadrat", "lx", "ly"}),
    "LiDAR360": frozenset({"treelocationx", "treelocationy"}),
    "TreeLS": frozenset({"x", "y", "radius", "error"}),
    "3DFin": frozenset({"th", "dbh", "x", "y"}),
    "FORTLS": frozenset({"id", "tree", "h_dist"}),
    "TreeQSM": frozenset({"dbhqsm"}),
}
"""Programs by the names that only their tables have together."""
FAMILY_UNITS: Final[Mapping[str, str]] = {
    "ForestGEO": "mm",
    "ForestGEO quadrats": "mm",
    "LiDAR360": "m",
    "TreeLS": "m",
    "3DFin": "m",
    "FORTLS": "cm",
    "TreeQSM": "m",
}
"""The unit of diameters (of TreeLS: of radii) that a program writes."""
_UNITS: Final = {
    "m": "m", "metre": "m", "meter": "m", "metres": "m", "meters": "m", "ft": "ft", "feet": "ft", "foot": "ft",
    "us_ft": "us-ft", "usft": "us-ft", "us_survey_ft": "us-ft", "cm": "cm", "mm": "mm", "km": "km", "in": "in",
    "inch": "in", "yd": "yd",
}  # fmt: skip
_ANGLES: Final = {
    "deg": "deg", "degrees": "deg", "gon": "gon", "grad": "gon", "rad": "rad", "percent": "percent", "pct": "percent",
}  # fmt: skip
_UNIT: Final = "|".join(sorted((*_UNITS, *_ANGLES), key=len, reverse=True))


@dataclass(frozen=True, slots=True)
class HeaderName:
    """One name of a header: in lower case with `_` for anything but letters and digits, and split from its unit."""

    plain: str
    base: str
    unit: str | None


def header_name(text: str) -> HeaderName:
    """`DBH (cm)`, `dbh_cm` and `Dbh [cm]` are all `dbh` in `cm`."""
    plain = re.sub(r"[\W_]+", "_", text.strip().lower()).strip("_")
    split = re.fullmatch(rf"(.+?)_?({_UNIT})", plain)
    is_glued = split is not None and not plain.endswith(f"_{split[2]}")
    if split is None or plain in KNOWN_BASES or (is_glued and split[1] not in _GLUED):
        return HeaderName(plain, plain, None)
    return HeaderName(plain, split[1], _UNITS.get(split[2]) or _ANGLES[split[2]])


_GLUED: Final = ("x", "y", "gx", "gy", "dbh", "bhd")
"""Names that a unit may follow without a mark between, as in `xft`."""
KNOWN_BASES: Final = frozenset(name for pair in PAIRS for name in pair) | {
    name for names in NAMES.values() for name in names
}


def family_of(names: Sequence[HeaderName]) -> str | None:
    """The program whose names a header has; None if it is none that is known."""
    there = {name.base for name in names} | {name.plain for name in names}
    return next((family for family, wanted in FAMILIES.items() if wanted <= there), None)


def names_positions(names: Sequence[str]) -> bool:
    """Whether a header names positions in a way that is known: as two coordinates, polar, or within quadrats."""
    bases = {header_name(name).base for name in names}
    if any({x, y} <= bases for x, y in PAIRS) or {"quadrat", "lx", "ly"} <= bases:
        return True
    return all(bases & set(NAMES[meaning]) for meaning in ("azimuth", "distance"))
