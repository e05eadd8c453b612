"""The meaning of a table's columns: by what the caller says, or by well-known names. Nothing is guessed in silence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from server.stem_maps.formats.table import FileTable, StemMapError, short
from server.stem_maps.reading.headers import (
    FAMILY_UNITS,
    NAMES,
    OF_FAMILIES,
    PAIRS,
    STRONG_IDS,
    WEAK_IDS,
    HeaderName,
    family_of,
    header_name,
    names_positions,
)
from server.stem_maps.reading.options import CENTIMETRES, COLUMNS_FILE, METRES, ReadOptions

_SHOWN: Final = 8
"""Most names of columns in a message."""
_OPTION: Final = {"x": "x", "y": "y", "centre_x": "centre-x", "centre_y": "centre-y"}
_OPTIONAL: Final = ("id", "plot", "dbh", "height", "species")
"""Columns that a `columns.toml` may name although one of the files beside it has no such column."""
_MEASURES: Final = (
    *("x", "y", "lx", "ly", "centre_x", "centre_y", "distance"),
    *("dbh", "height", "azimuth", "slope"),
)
"""Meanings of columns whose headers may name a unit."""
_DEGREES: Final = frozenset({"lon", "longitude", "lat", "latitude", "long"})


@dataclass(slots=True)
class Columns:
    """Positions of the columns that are read, by meaning, and the other columns.

    Attributes:
        positions: by `id`, `x`, `y`, `plot`, `dbh`, `height`, `species`, `azimuth`, `distance`, `slope`, `centre_x`,
            `centre_y`, `status`, `quadrat`, `lx` and `ly`; only of the columns that there are.
        names: the header's own names, by the same keys.
        units: units that the header, the caller or the program that wrote the file names, by the same keys.
        family: the program that the names are of; None if it is not known.
        family_unit: whether the unit of diameters is what that program writes, and nobody named it.
    """

    positions: dict[str, int]
    names: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    family: str | None = None
    family_unit: bool = False


def is_header_of(options: ReadOptions) -> Callable[[list[str]], bool]:
    """A function that recognises the names of a header, also by what the caller calls its columns."""
    wanted = {name.strip().lower() for name in options.named().values()}

    def is_header(names: list[str]) -> bool:
        plain = {name.strip().lower() for name in names}
        return wanted <= plain if wanted & {(options.x or "").lower(), (options.azimuth or "").lower()} - {""} else (
            names_positions(names)
        )  # fmt: skip

    return is_header


def find_columns(table: FileTable, options: ReadOptions) -> Columns:
    """The meaning of the columns of `table`.

    Raises:
        StemMapError: a column that is needed is missing, or two could be meant.
    """
    found = _ColumnSearch(table, options)
    found.take_named()
    found.take_positions()
    found.take_id()
    for meaning in ("plot", "dbh", "height", "species", "azimuth", "distance"):
        found.take(meaning)
    found.check()
    return found.columns()


class _ColumnSearch:
    """The columns found so far."""

    def __init__(self, table: FileTable, options: ReadOptions) -> None:
        self.table, self.options = table, options
        self.found: dict[str, int] = {}
        ignored = {name.strip().lower() for name in options.ignore}
        plain = [name.strip().lower() for name in table.names]
        missing = sorted(ignored - set(plain))
        if missing:
            raise self.refuse(f"there is no column {missing[0]!r}, which --ignore names")
        self.names = [
            HeaderName("-", "-", None) if name.strip().lower() in ignored else header_name(name) for name in table.names
        ]
        self.family = family_of(self.names)

    def refuse(self, message: str) -> StemMapError:
        """The error to raise, at the line of the header."""
        return StemMapError(self.table.path, message, self.table.header_line)

    def take_named(self) -> None:
        """Columns that the caller named."""
        plain = [name.strip().lower() for name in self.table.names]
        for meaning, name in self.options.named().items():
            places = [position for position, one in enumerate(plain) if one == name.strip().lower()]
            if not places:
                in_file = meaning in self.options.from_file
                is_dimension = meaning == "id" and self.table.path.suffix.lower() in (".las", ".laz")
                if is_dimension or (in_file and meaning in _OPTIONAL):
                    continue
                option = COLUMNS_FILE if in_file else f"--{_OPTION.get(meaning, meaning)}"
                raise self.refuse(f"there is no column {name!r}, which {option} names: {self.there_are()}")
            if len(places) > 1:
                raise self.refuse(f"{len(places)} columns are called {name!r}: rename all but one")
            self.found[meaning] = places[0]
        for one, other in (("x", "y"), ("y", "x"), ("azimuth", "distance"), ("distance", "azimuth"),
                           ("centre_x", "centre_y"), ("centre_y", "centre_x")):  # fmt: skip
            if one in self.options.named() and other not in self.options.named():
                raise self.refuse(f"--{_OPTION.get(one, one)} is given: give --{_OPTION.get(other, other)}, too")

    def there_are(self) -> str:
        """The names that there are, in words."""
        names = self.table.names
        found = ", ".join(repr(short(name)) for name in names[:_SHOWN])
        return f"it names {found}{f' and {len(names) - _SHOWN} more' if len(names) > _SHOWN else ''}"

    def take_positions(self) -> None:
        """Two columns of positions by their well-known names, unless they are named or the file has geometries."""
        if "x" in self.found or self.table.xy is not None:
            return
        pairs = []
        for pair in PAIRS:
            places = [[i for i, name in enumerate(self.names) if name.base == base] for base in pair]
            for base, several in zip(pair, places, strict=True):
                if len(several) > 1:
                    raise self.refuse(
                        f"two columns are called {base}_m or {base}: keep one, or name the other with --ignore, or "
                        f"name the columns to read with --x and --y"
                    )
            if all(places):
                pairs.append((pair, places[0][0], places[1][0]))
        if len(pairs) > 1:
            both = " and ".join(f"{x!r}, {y!r}" for (x, y), _, _ in pairs[:2])
            raise self.refuse(f"there are two pairs of positions, {both}: name the one to read with --x and --y")
        if pairs:
            _, self.found["x"], self.found["y"] = pairs[0]
        elif all(any(name.base == base for name in self.names) for base in ("quadrat", "lx", "ly")):
            for base in ("quadrat", "lx", "ly"):
                self.take(base)

    def take_id(self) -> None:
        """The column of ids: a strong name, then any, then one of those that must tell all rows apart."""
        if "id" in self.found:
            return
        free = self.free()
        strong = [position for position, name in free if name.plain in STRONG_IDS]
        if self.family == "FORTLS":  # its `id` is that of the plot
            self.found["plot"] = next(position for position, name in free if name.plain == "id")
            strong = [position for position, name in free if name.plain == "tree"]
        if len(strong) > 1:
            raise self.refuse("two columns are called tree_id or id: keep one, or name the other with --ignore")
        for wanted in () if strong else NAMES["id"]:
            places = [position for position, name in free if name.plain == wanted]
            if places and (wanted not in WEAK_IDS or self._tells_apart(places[0])):
                strong = places[:1]
                break
        if strong:
            self.found["id"] = strong[0]

    def _tells_apart(self, position: int) -> bool:
        texts = self.table.texts(position)
        return "" not in texts and len(set(texts)) == len(texts)

    def free(self) -> list[tuple[int, HeaderName]]:
        """Columns that have no meaning yet."""
        taken = set(self.found.values())
        return [(position, name) for position, name in enumerate(self.names) if position not in taken]

    def take(self, meaning: str) -> None:
        """The column of one meaning by its well-known names, unless it is named."""
        if meaning in self.found:
            return
        places = [
            (position, name)
            for position, name in self.free()
            if name.base in NAMES[meaning] and OF_FAMILIES.get(name.base, self.family) == self.family
        ]
        if meaning in ("dbh", "height") and len(places) > 1:
            both = " and ".join(repr(self.table.names[position].strip().lower()) for position, _ in places[:2])
            what = "diameters" if meaning == "dbh" else "heights"
            raise self.refuse(
                f"the columns {both} are both {what}: keep one, name the other with --ignore, or name the one to read "
                f"with --{meaning}"
            )
        if places:
            places.sort(key=lambda place: list(NAMES[meaning]).index(place[1].base))
            self.found[meaning] = places[0][0]

    def check(self) -> None:
        """Raise StemMapError if there are no positions, or a unit is unknown or contradicts the caller."""
        has_polar = {"azimuth", "distance"} <= self.found.keys()
        if self.table.xy is None and not has_polar and "lx" not in self.found and "x" not in self.found:
            raise self.refuse(self._missing())

    def _missing(self) -> str:
        names = {name.base for name in self.names}
        axis = "y" if "x" in names else "x"
        needed = f"column {axis}_m or {axis} is missing"
        if names & _DEGREES:
            return (
                f"{needed}, and longitude and latitude are degrees: name them with --x and --y, their system with "
                "--crs EPSG:4326, and a projected one such as the UTM zone with --project"
            )
        separated = "" if len(self.names) > 1 or not self.table.separator else (
            ", separated by commas, semicolons, tabs or spaces")  # fmt: skip
        if len(self.names) == 1 and "|" in self.table.names[0]:
            return f"{needed}: its columns seem to be separated by |, so write a first line sep=| above the header"
        return (
            f"{needed}: the header must name x_m and y_m{separated}, or --x and --y must name the columns, and "
            f"{self.there_are()}"
        )

    def columns(self) -> Columns:
        """The result, with the units that are named."""
        columns = Columns(
            positions=self.found,
            names={meaning: self.table.names[position] for meaning, position in self.found.items()},
            family=self.family,
        )
        for meaning, position in self.found.items():
            unit = self.names[position].unit
            if unit is not None and meaning in _MEASURES:
                columns.units[meaning] = unit
        self._set_unit(columns, ("x", "y"), self.options.unit, "unit", METRES)
        self._set_unit(columns, ("dbh",), self.options.dbh_unit, "dbh-unit", CENTIMETRES)
        self._set_unit(columns, ("height",), self.options.height_unit, "height-unit", METRES)
        self._set_unit(columns, ("lx", "ly"), self.options.unit, "unit", METRES)
        self._set_unit(columns, ("centre_x", "centre_y"), None, "unit", METRES)
        self._set_unit(columns, ("distance",), None, "unit", METRES)
        self._set_unit(columns, ("azimuth",), self.options.angle, "angle", ("deg", "gon", "rad"))
        self._set_unit(columns, ("slope",), self.options.slope_unit, "slope-unit", ("deg", "gon", "rad", "percent"))
        usual = FAMILY_UNITS.get(self.family or "")
        if "dbh" in columns.positions and "dbh" not in columns.units and usual is not None:
            columns.units["dbh"] = usual
            columns.family_unit = True
        return columns

    def _set_unit(
        self, columns: Columns, meanings: Sequence[str], unit: str | None, option: str, known: object
    ) -> None:
        """Add a unit that the caller named, which must not contradict the header."""
        in_header = {columns.units[meaning] for meaning in meanings if meaning in columns.units}
        if len(in_header) > 1:
            raise self.refuse(f"{' and '.join(meanings)} are in {' and '.join(sorted(in_header))}: use one unit")
        for named in in_header:
            if named not in known:  # type: ignore[operator]
                name = columns.names[meanings[0]]
                raise self.refuse(f"the column {name!r} is in {named!r}, which is not a unit that is read here")
            if unit is not None and named != unit:
                name = columns.names[next(one for one in meanings if one in columns.units)]
                raise self.refuse(f"the column {name!r} names its unit, but --{option} says {unit}: drop one")
        if unit is not None:
            columns.units.update({meaning: unit for meaning in meanings if meaning in columns.positions})
