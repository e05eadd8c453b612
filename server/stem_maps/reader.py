"""Stem maps and observations as CSV files: read whole, checked line by line, never mended.

The columns, in any order, by the names of a header line (upper or lower case):

    tree_id or id   optional; text (default: the tree's position in the file, from 1); also treeid, tree or tag
    x_m or x        required; metres
    y_m or y        required; metres
    dbh_cm          optional; diameter at breast height; may be empty. Also dbh_mm, dbh_m, dbh_in, or dbh with a unit
                    that the caller names; dbh alone is taken as centimetres where that can be
    height_m        optional; metres; may be empty
    species         optional; text; may be empty

UTF-8, with or without a byte order mark. Columns are separated by commas, semicolons or tabs; with the latter two,
decimals may have commas. Rows with the same id at the same place are stems of one tree: the thickest stays. Blank
lines, and comments above the header that begin with `#`, are passed over. `StemMap.understood` tells all of this.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.schemas.landmarks import STEMS_CM, TALLEST_M
from server.stem_maps.csv_columns import DBH_UNITS, Columns, find_columns
from server.stem_maps.csv_rows import SEPARATORS, Rows, StemMapError, decode, read_bytes
from server.stem_maps.plausibility import check_centres, check_cut_decimals, check_diameters, check_plots
from server.store.codec import digest

__all__ = ["StemMap", "StemMapError", "read_stem_map"]

COORDINATE_LIMIT: Final = 1e8
"""Metres. No projected coordinate on Earth is larger, so a larger one is in another unit."""
SAME_PLACE: Final = 0.01
"""Metres. Stems of one tree that are closer than this have one position."""


@dataclass(frozen=True, slots=True, eq=False)
class StemMap:
    """The trees of one file, in its order.

    Attributes:
        name: the file's name without its suffix; the map's `frame_id`.
        ids: N unique tree ids.
        xy: (N, 2) float64, metres, in the file's frame.
        dbh_cm: (N,) float64, centimetres, NaN where the file has none; None without the column.
        height_m: (N,) float64, metres, NaN where the file has none; None without the column.
        species: N names, empty where the file has none; None without the column.
        source_hash: digest of the file's bytes; empty for a map that came from no file.
        understood: one line: what was read as what, what is not used, and what was passed over.
    """

    name: str
    ids: tuple[str, ...]
    xy: NDArray[np.float64]
    dbh_cm: NDArray[np.float64] | None = None
    height_m: NDArray[np.float64] | None = None
    species: tuple[str, ...] | None = None
    source_hash: str = ""
    understood: str = ""

    def __len__(self) -> int:
        return len(self.ids)


def read_stem_map(
    path: Path, *, allow_empty: bool = False, dbh_unit: str | None = None, ignore: Collection[str] = ()
) -> StemMap:
    """Read the CSV file `path`.

    With `allow_empty`, a file with a header and no trees is valid: an observation may contain nothing. `dbh_unit`
    (`cm`, `mm`, `m` or `in`) is that of a column `dbh`. Columns in `ignore` are ignored.

    Raises:
        StemMapError: naming the file, and the line where there is one.
    """
    data = read_bytes(path)
    rows = Rows(path, decode(path, data))
    if not rows.header:
        raise StemMapError(path, "the file is empty: a header line with the columns x_m and y_m is needed")
    columns = find_columns(path, rows, dbh_unit, {name.strip().lower() for name in ignore})
    trees = _Trees(path, columns, rows)
    for line, fields in rows:
        trees.add(line, fields)
    if not trees.ids and not allow_empty:
        raise StemMapError(path, "the file has a header but no trees")
    return trees.stem_map(digest(data))


class _Trees:
    """The trees read so far, column by column."""

    def __init__(self, path: Path, columns: Columns, rows: Rows) -> None:
        self.path = path
        self.columns = columns
        self.rows = rows
        self.ids: dict[tuple[str, str], int] = {}
        self.lines: list[int] = []
        self.numbers: dict[str, list[float]] = {
            key: [] for key in ("x_m", "y_m", "dbh", "height_m") if key in columns.positions
        }
        self.species: list[str] = []
        self.further_stems = 0
        self.ids_of_plots = False
        self.whole = True
        self.decimal_mark: tuple[str, int] | None = None

    def add(self, line: int, fields: list[str]) -> None:
        """Add one row. Raises StemMapError."""
        width = len(self.rows.header)
        if len(fields) != width:
            comment = ": a comment may only stand above the header" if fields[0].lstrip().startswith("#") else ""
            raise StemMapError(self.path, f"{len(fields)} fields where the header has {width}{comment}", line)
        positions = self.columns.positions
        values = {key: self._number(key, fields[positions[key]].strip(), line) for key in self.numbers}
        tree_id = str(len(self.lines) + 1)
        if "tree_id" in positions:
            tree_id = fields[positions["tree_id"]].strip()
            if not tree_id:
                raise StemMapError(self.path, "the tree's id is empty", line)
        plot = "" if self.columns.plot is None else fields[self.columns.plot].strip()
        index = self.ids.setdefault((plot, tree_id), len(self.lines))
        if index < len(self.lines):
            self._further_stem(tree_id, index, values, line)
            return
        self.lines.append(line)
        for key, value in values.items():
            self.numbers[key].append(value)
        if "species" in positions:
            self.species.append(fields[positions["species"]].strip())

    def _further_stem(self, tree_id: str, index: int, values: dict[str, float], line: int) -> None:
        """Add a row with a known id: another stem of the same tree, if it has the same position."""
        apart = np.hypot(values["x_m"] - self.numbers["x_m"][index], values["y_m"] - self.numbers["y_m"][index])
        if apart > SAME_PLACE:
            used = f"tree id {_quoted(tree_id)} is used before, on line {self.lines[index]}, {apart:.3g} m away"
            raise StemMapError(self.path, used, line)
        self.further_stems += 1
        if "dbh" in values and not self.numbers["dbh"][index] >= values["dbh"] and np.isfinite(values["dbh"]):
            for key, value in values.items():
                self.numbers[key][index] = value

    def _number(self, key: str, text: str, line: int) -> float:
        required = key in ("x_m", "y_m")
        name = f"dbh_{self.columns.dbh_unit}" if key == "dbh" else key
        if not text and not required:
            return float("nan")
        pointed = self._with_point(name, text, line)
        try:
            if "_" in text:  # float() accepts 1_000, unlike other programs
                raise ValueError(text)
            number = float(pointed)
        except ValueError:
            thousands = ": write numbers without thousands separators" if text.count(".") > 1 else ""
            raise StemMapError(self.path, f"{name} is not a number: {_quoted(text)}{thousands}", line) from None
        if not np.isfinite(number):
            raise StemMapError(self.path, f"{name} is not a finite number: {_quoted(text)}", line)
        if required and abs(number) > COORDINATE_LIMIT:
            raise StemMapError(self.path, f"{name} is {number:g}: coordinates must be in metres", line)
        if not required and number <= 0:
            raise StemMapError(self.path, f"{name} must be more than 0, or empty: {_quoted(text)}", line)
        if key == "dbh" and not STEMS_CM[0] <= number * DBH_UNITS[self.columns.dbh_unit or "cm"] <= STEMS_CM[1]:
            raise StemMapError(
                self.path,
                f"{name} is {number:g}, but stems are {STEMS_CM[0]:g} to {STEMS_CM[1]:g} cm thick: give the unit in "
                "the column's name (dbh_cm, dbh_mm, dbh_m, dbh_in) or with --dbh-unit",
                line,
            )
        if key == "height_m" and number > TALLEST_M:
            raise StemMapError(self.path, f"height_m is {number:g}: heights must be in metres", line)
        if required and self.whole:
            self.whole = text.lstrip("+-").isdigit()
        return number

    def _with_point(self, name: str, text: str, line: int) -> str:
        """A number with a point for decimals, from a file that may have commas. Raises StemMapError."""
        mark = "," if "," in text else "." if "." in text else None
        if mark is None:
            return text
        if mark == "," and (self.rows.separator == "," or "." in text or text.count(",") > 1):
            raise StemMapError(
                self.path,
                f"{name} is not a number: {_quoted(text)}: write numbers without thousands separators, and decimals "
                "with a point, or with a comma where semicolons or tabs separate the columns",
                line,
            )
        if self.rows.separator != "," and self.decimal_mark is None:
            self.decimal_mark = (mark, line)
        if self.decimal_mark is not None and self.decimal_mark[0] != mark:
            other, where = self.decimal_mark
            raise StemMapError(
                self.path,
                f"{name} is {_quoted(text)}, but line {where} has {other!r} as the decimal mark: use one",
                line,
            )
        return text.replace(",", ".")

    def stem_map(self, source_hash: str) -> StemMap:
        """The stem map. Raises StemMapError if it is not plausible."""
        arrays = {key: np.asarray(values, dtype=np.float64) for key, values in self.numbers.items()}
        xy = np.column_stack([arrays["x_m"], arrays["y_m"]])
        dbh_cm = None
        if self.columns.dbh_unit is not None:
            factor = DBH_UNITS[self.columns.dbh_unit]
            # By division, which is exact: 211 mm are 21.1 cm, but 211 * 0.1 is slightly more.
            dbh_cm = arrays["dbh"] * factor if factor >= 1.0 else arrays["dbh"] / round(1.0 / factor)
        check_centres(self.path, self.columns, xy)
        check_plots(self.path, self.columns, [plot for plot, _ in self.ids], xy)
        if dbh_cm is not None:
            check_diameters(self.path, self.columns, dbh_cm)
        if self.whole and self.rows.separator == ",":
            check_cut_decimals(self.path, xy)
        return StemMap(
            name=self.path.stem,
            ids=self._unique_ids(),
            xy=xy,
            dbh_cm=dbh_cm,
            height_m=arrays.get("height_m"),
            species=tuple(self.species) if "species" in self.columns.positions else None,
            source_hash=source_hash,
            understood=self._told(),
        )

    def _unique_ids(self) -> tuple[str, ...]:
        """The trees' ids, prefixed with the name of their plot if plots number their trees separately."""
        ids = tuple(tree_id for _, tree_id in self.ids)
        self.ids_of_plots = len(set(ids)) < len(ids)
        return tuple(f"{plot}-{tree_id}" for plot, tree_id in self.ids) if self.ids_of_plots else ids

    def _told(self) -> str:
        parts = [self.columns.described()]
        if self.rows.separator != ",":
            decimals = ", decimals with commas" if self.decimal_mark and self.decimal_mark[0] == "," else ""
            parts.append(f"columns separated by {SEPARATORS[self.rows.separator]}{decimals}")
        if self.rows.comments or self.rows.blanks:
            parts.append(
                f"passed over {self.rows.comments} comments above the header and {self.rows.blanks} blank lines"
            )
        if self.further_stems:
            parts.append(f"{self.further_stems} rows are further stems of a tree: the thickest stays")
        if self.ids_of_plots:
            parts.append(f"ids repeat between plots, so each begins with its {self.columns.plot_name!r}")
        return "; ".join(parts)


def _quoted(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
