"""Landmarks in files: CSV as the `urquhart` command reads it, or the JSON body of a request.

CSV in its plain form is read as `urquhart index` reads it; a test gives the same files to both. The client has no
libraries for numbers, maps or other formats, so whatever needs the options of that command (other units, formats and
encodings, plots, polar measurements, several stems of a tree) is refused here: `urquhart index` reads it.
"""

import csv
import heapq
import io
import json
import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from statistics import median
from typing import Any, Final

_ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "id": ("tree_id", "id"),
    "x": ("x_m", "x"),
    "y": ("y_m", "y"),
    "dbh_cm": ("dbh", "dbh_cm", "dbh_mm", "dbh_m", "dbh_in"),
    "height_m": ("height_m",),
    "species": ("species",),
}
_OTHER_IDS: Final = ("treeid", "tree", "tag")
_PLOTS: Final = ("plot", "plot_id", "plotid", "plot_no", "plot_nr", "plot_name")
_CENTIMETRES: Final = {"dbh": 1.0, "dbh_cm": 1.0, "dbh_mm": 0.1, "dbh_m": 100.0, "dbh_in": 2.54}
_MOST_MEDIAN: Final = {"dbh": 60.0}
"""Centimetres. A larger median means millimetres, unless the column's name has the unit."""
_OTHER_POSITIONS: Final = ("easting", "northing", "east", "north", "gx", "gy", "point_x", "point_y", "lon", "lat")
"""Names of positions in another system, which would make x and y a guess."""
_DENSEST: Final = 10_000.0
_SPARSEST: Final = 30.0
"""Trees on a hectare beyond which positions are hardly metres, as for `urquhart index`."""
_THINNEST_BASAL: Final = 4.0
"""Square metres of stems on a hectare, below which the same holds where diameters are known."""
_NEIGHBOURS: Final = 6
_SAMPLE: Final = 100
_COORDINATE_LIMIT: Final = 1e8
_FEW: Final = 20
"""Rows from which a pattern in all of them is no accident; most names of columns in a message."""


class FileError(ValueError):
    """A file that cannot be read. The message is one line that begins with the file's name."""


def read_csv(path: Path) -> dict[str, Any]:
    """The trees of a CSV file as `{"landmarks": [...]}`: x, y and height_m in metres. Raises FileError."""
    try:
        table = _Table(path, path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: not UTF-8 text: save the file as CSV in utf-8") from error
    landmarks = [table.landmark(line, fields) for line, fields in table.rows]
    table.check(landmarks)
    return {"landmarks": landmarks}


def read_body(path: Path, members: Collection[str]) -> dict[str, Any]:
    """The members of a JSON object, which must be among `members`. Raises FileError."""
    try:
        body = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_once_each, parse_constant=_no_number)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    if not isinstance(body, dict):
        raise FileError(f"{path}: not a JSON object")
    unknown = sorted(set(body) - set(members))
    if unknown:
        raise FileError(f"{path}: the member {unknown[0]!r} is not known here; known are {', '.join(sorted(members))}")
    return body


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the member {twice!r} is there twice: keep one")
    return members


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number in JSON: leave such trees out")


class _Table:
    """A CSV file: the meaning of its columns, and its rows."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.line = path, 0
        lines = self._lines(text)
        first = next(lines, "")
        self.header_line = self.line
        self.separator = max(",;\t", key=first.count)
        self.header = [name.strip().lower() for name in next(csv.reader([first], delimiter=self.separator), [])]
        self.columns = self._columns()
        self.rows = self._rows(lines)
        self.mark: str | None = None
        self.ids: dict[str, int] = {}
        self.plot = next((name for name in self.header if name in _PLOTS), None)
        self.plots: set[str] = set()

    def _lines(self, text: str) -> Iterator[str]:
        above = True
        for self.line, line in enumerate(io.StringIO(text, newline=None), start=1):
            if line.strip() and not (above and line.lstrip().startswith("#")):
                above = False
                yield line

    def _rows(self, lines: Iterator[str]) -> Iterator[tuple[int, list[str]]]:
        try:
            for fields in csv.reader(lines, delimiter=self.separator, strict=True):
                if len(fields) != len(self.header):
                    raise self.refuse(f"{len(fields)} fields where the header has {len(self.header)}", self.line)
                yield self.line, fields
        except csv.Error as error:
            raise self.refuse(f"not a table: {error}", self.line) from error

    def _columns(self) -> dict[str, int]:
        columns = {}
        for key, aliases in _ALIASES.items():
            found = [position for position, name in enumerate(self.header) if name in aliases]
            if len(found) > 1:
                names = " and ".join(self.header[position] for position in found[:2])
                raise self.refuse(f"the columns {names} mean the same: keep one of them", self.header_line)
            if found:
                columns[key] = found[0]
        other = next((name for name in self.header if name in _OTHER_POSITIONS), None)
        if other is not None and "x" in columns:
            raise self.refuse(f"there are positions in x and y, and in {other}: keep one of them", self.header_line)
        others = [self.header.index(name) for name in _OTHER_IDS if name in self.header]
        if "id" not in columns and others:
            columns["id"] = others[0]
        if "x" not in columns or "y" not in columns:
            names = ", ".join(repr(name[:20]) for name in self.header[:_FEW])
            raise self.refuse(
                f"the first line must name the columns x and y, or x_m and y_m, which are metres; it names {names}"
            )
        return columns

    def landmark(self, line: int, fields: list[str]) -> dict[str, Any]:
        """One tree. Raises FileError."""
        if self.plot is not None:
            self.plots.add(fields[self.header.index(self.plot)].strip())
        found: dict[str, Any] = {"id": self._id(line, fields)}
        for key in ("x", "y", "dbh_cm", "height_m"):
            if key in self.columns and (text := fields[self.columns[key]].strip()):
                found[key] = self._number(key, text, line)
            elif key in ("x", "y"):
                raise self.refuse(f"the column {self.header[self.columns[key]]} is empty: give a number", line)
        if "species" in self.columns and (name := fields[self.columns["species"]].strip()):
            found["species"] = name
        return found

    def _id(self, line: int, fields: list[str]) -> str:
        name = fields[self.columns["id"]].strip() if "id" in self.columns else str(len(self.ids) + 1)
        if not name:
            raise self.refuse("the tree's id is empty", line)
        if name in self.ids:
            raise self.refuse(f"tree id {name[:40]!r} is used before, on line {self.ids[name]}: one row a tree", line)
        self.ids[name] = line
        return name

    def _number(self, key: str, text: str, line: int) -> float:
        column, shown = self.header[self.columns[key]], repr(text[:40])
        try:
            value = math.nan if "_" in text else float(self._with_point(column, text, line))
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.refuse(f"{column} is not a number: {shown}", line)
        if key in ("x", "y") and abs(value) > _COORDINATE_LIMIT:
            raise self.refuse(f"{column} is {value:g}: coordinates must be in metres", line)
        if key in ("dbh_cm", "height_m") and value <= 0.0:
            raise self.refuse(f"{column} must be more than 0, or empty: {shown}", line)
        return value

    def _with_point(self, column: str, text: str, line: int) -> str:
        """A number with a point for decimals. Commas are decimal marks if semicolons or tabs separate the columns."""
        mark = "," if "," in text else "." if "." in text else None
        if self.separator == "," or mark is None:
            return text
        if text.count(",") > 1 or ("," in text and "." in text) or self.mark not in (None, mark):
            raise self.refuse(f"{column} is {text[:40]!r}: write all decimals with one mark, no thousands", line)
        self.mark = mark
        return text.replace(",", ".")

    def check(self, landmarks: list[dict[str, Any]]) -> None:
        """Bring diameters into centimetres. Raises FileError for what the columns can hardly mean."""
        places = [(tree["x"], tree["y"]) for tree in landmarks]
        if len(places) >= 3 and 2 * len(set(places)) < len(places):
            raise self.refuse(
                f"{len(places)} trees have only {len(set(places))} different positions: give each tree its own"
            )
        whole = self.separator == "," and all(float(value).is_integer() for place in places for value in place)
        if len(places) >= _FEW and whole:
            for values in zip(*places, strict=True):
                if min(values) >= 0 and max(values) <= 9:
                    raise self.refuse("decimal commas were probably read as separators: write a point for decimals")
        self._check_plots()
        self._check_diameters([tree for tree in landmarks if "dbh_cm" in tree])
        self._check_places(places)
        self._check_density(places, [tree["dbh_cm"] for tree in landmarks if "dbh_cm" in tree])

    def _check_plots(self) -> None:
        if len(self.plots) > 1:
            raise self.refuse(f"the column {self.plot} has {len(self.plots)} values: write a file for each plot")

    def _check_places(self, places: list[tuple[float, float]]) -> None:
        """Refuse degrees, positions in a line, and positions that are rounded until trees share them."""
        extents = [max(values) - min(values) for values in zip(*places, strict=True)]
        if len(places) >= 3 and self._has_no_unit():
            is_on_earth = all(abs(x) <= 180.0 and abs(y) <= 90.0 for x, y in places)
            if is_on_earth and 0.0 < max(extents) < 0.1:
                raise self.refuse("the positions look like degrees: project them to metres, for example to UTM")
        if len(places) < _FEW:
            return
        if min(extents) == 0.0:
            raise self.refuse("all trees have the same x or the same y: is it the right column?")
        is_whole = all(x.is_integer() and y.is_integer() for x, y in places)
        if is_whole and len(set(places)) < 0.9 * len(places):
            raise self.refuse("positions are whole metres that trees share: give at least decimetres")

    def _has_no_unit(self) -> bool:
        return self.header[self.columns["x"]] == "x" or self.header[self.columns["y"]] == "y"

    def _check_density(self, places: list[tuple[float, float]], diameters: list[float]) -> None:
        """Refuse trees that stand closer, or further apart, than in any forest, where the header names no unit."""
        if len(places) < _FEW or not self._has_no_unit():
            return
        squares = [
            heapq.nsmallest(_NEIGHBOURS + 1, ((x - a) ** 2 + (y - b) ** 2 for x, y in places))[-1]
            for a, b in places[:: max(1, len(places) // _SAMPLE)]
        ]
        middle = median(squares)
        density = 1e4 * (_NEIGHBOURS - 1 / 3) / (math.pi * middle) if middle > 0.0 else math.inf
        has_few = density < _SPARSEST
        if 2 * len(diameters) > len(places):
            area = math.pi / 4.0 * sum((dbh_cm / 100.0) ** 2 for dbh_cm in diameters) / len(diameters)
            has_few = density * area < _THINNEST_BASAL
        if density > _DENSEST or has_few:
            raise self.refuse(
                f"there would be {density:.0f} trees on a hectare: if positions are in metres, call the columns x_m "
                "and y_m; if they are in feet or another unit, convert them"
            )

    def _check_diameters(self, measured: list[dict[str, Any]]) -> None:
        if not measured:
            return
        column = self.header[self.columns["dbh_cm"]]
        factor = _CENTIMETRES[column]
        for tree in measured:
            # By division, which is exact: 211 mm are 21.1 cm, but 211 * 0.1 is slightly more.
            tree["dbh_cm"] = tree["dbh_cm"] * factor if factor >= 1.0 else tree["dbh_cm"] / round(1.0 / factor)
        middle = median(tree["dbh_cm"] for tree in measured)
        if not 1.0 <= middle <= _MOST_MEDIAN.get(column, 300.0):
            raise self.refuse(
                f"the median of the column {column} would be {middle:.3g} cm, which no stand has: name the unit, as "
                "dbh_cm, dbh_mm, dbh_m or dbh_in"
            )

    def refuse(self, what: str, line: int | None = None) -> FileError:
        """The error to raise."""
        return FileError(f"{self.path}: {what}" if line is None else f"{self.path}, line {line}: {what}")
