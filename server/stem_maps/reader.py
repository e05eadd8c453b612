"""Stem maps and observations as CSV files: read whole, checked line by line, never mended.

The columns, in any order, by the names of a header line (upper or lower case):

    tree_id or id   optional; text, unique in the file (default: the tree's position in the file, from 1)
    x_m or x        required; metres
    y_m or y        required; metres
    dbh_cm or dbh   optional; diameter at breast height, centimetres; may be empty
    height_m        optional; metres; may be empty
    species         optional; text; may be empty

Separated by commas, UTF-8 with or without a byte order mark. Other columns, blank lines and lines that start with `#`
are passed over.
"""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.store.codec import digest

ALIASES: Final = {
    "tree_id": ("tree_id", "id"),
    "x_m": ("x_m", "x"),
    "y_m": ("y_m", "y"),
    "dbh_cm": ("dbh_cm", "dbh"),
    "height_m": ("height_m",),
    "species": ("species",),
}
COORDINATE_LIMIT: Final = 1e8
"""Metres. No projected coordinate on Earth is larger; what is larger is in other units."""


class StemMapError(ValueError):
    """A stem map that cannot be read; the message is one line, `FILE:LINE: what is wrong` or `FILE: what is wrong`."""

    def __init__(self, path: Path, message: str, line: int | None = None) -> None:
        super().__init__(f"{path}: {message}" if line is None else f"{path}:{line}: {message}")
        self.path = path
        self.line = line


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
    """

    name: str
    ids: tuple[str, ...]
    xy: NDArray[np.float64]
    dbh_cm: NDArray[np.float64] | None = None
    height_m: NDArray[np.float64] | None = None
    species: tuple[str, ...] | None = None
    source_hash: str = ""

    def __len__(self) -> int:
        return len(self.ids)


def read_stem_map(path: Path, *, allow_empty: bool = False) -> StemMap:
    """Read the CSV file `path`.

    With `allow_empty` a file of a header and no tree is fine: an observation may see nothing.

    Raises:
        StemMapError: naming the file, and the line where there is one.
    """
    data = _bytes(path)
    rows = _rows(path, _text(path, data))
    try:
        header_line, header = next(rows)
    except StopIteration:
        raise StemMapError(path, "the file is empty: a header line with the columns x_m and y_m is needed") from None
    columns = _columns(path, header_line, header)
    table = _Table(path, columns, len(header))
    for line, fields in rows:
        table.add(line, fields)
    if not table.ids and not allow_empty:
        raise StemMapError(path, "the file has a header and no trees")
    return table.stem_map(digest(data))


class _Table:
    """The rows read so far, column by column."""

    def __init__(self, path: Path, columns: dict[str, int], width: int) -> None:
        self.path = path
        self.columns = columns
        self.width = width
        self.ids: dict[str, int] = {}
        self.numbers: dict[str, list[float]] = {
            name: [] for name in ("x_m", "y_m", "dbh_cm", "height_m") if name in columns
        }
        self.species: list[str] = []

    def add(self, line: int, fields: list[str]) -> None:
        if len(fields) != self.width:
            raise StemMapError(self.path, f"{len(fields)} fields where the header has {self.width}", line)
        for name, values in self.numbers.items():
            values.append(self._number(name, fields[self.columns[name]].strip(), line))
        if "species" in self.columns:
            self.species.append(fields[self.columns["species"]].strip())
        tree_id = str(len(self.ids) + 1)
        if "tree_id" in self.columns:
            tree_id = fields[self.columns["tree_id"]].strip()
            if not tree_id:
                raise StemMapError(self.path, "the tree's id is empty", line)
            if tree_id in self.ids:
                raise StemMapError(
                    self.path, f"tree id {_quoted(tree_id)} is used before, on line {self.ids[tree_id]}", line
                )
        self.ids[tree_id] = line

    def _number(self, name: str, text: str, line: int) -> float:
        required = name in ("x_m", "y_m")
        if not text and not required:
            return float("nan")
        try:
            if "_" in text:  # float() reads 1_000; no other program does
                raise ValueError(text)
            number = float(text)
        except ValueError:
            raise StemMapError(self.path, f"{name} is not a number: {_quoted(text)}", line) from None
        if not np.isfinite(number):
            raise StemMapError(self.path, f"{name} is not a finite number: {_quoted(text)}", line)
        if required and abs(number) > COORDINATE_LIMIT:
            raise StemMapError(self.path, f"{name} is {number:g}: coordinates must be in metres", line)
        if not required and number <= 0:
            raise StemMapError(self.path, f"{name} must be more than 0, or empty: {_quoted(text)}", line)
        return number

    def stem_map(self, source_hash: str) -> StemMap:
        arrays = {name: np.asarray(values, dtype=np.float64) for name, values in self.numbers.items()}
        return StemMap(
            name=self.path.stem,
            ids=tuple(self.ids),
            xy=np.column_stack([arrays["x_m"], arrays["y_m"]]),
            dbh_cm=arrays.get("dbh_cm"),
            height_m=arrays.get("height_m"),
            species=tuple(self.species) if "species" in self.columns else None,
            source_hash=source_hash,
        )


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise StemMapError(path, "no such file") from None
    except IsADirectoryError:
        raise StemMapError(path, "is a directory, a CSV file is needed") from None
    except OSError as error:
        raise StemMapError(path, f"cannot be read: {error.strerror or error}") from None


def _text(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise StemMapError(path, "is not UTF-8 text: save the file as CSV in UTF-8", line) from None


def _rows(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line number (from 1) and fields of every line that is neither blank nor a comment."""
    number = 0

    def lines() -> Iterator[str]:
        nonlocal number
        for number, line in enumerate(io.StringIO(text, newline=None), start=1):  # noqa: B007 (read by the loop below)
            if line.strip() and not line.lstrip().startswith("#"):
                yield line

    try:
        for fields in csv.reader(lines(), strict=True):
            yield number, fields
    except csv.Error as error:
        raise StemMapError(path, f"is not comma-separated text: {error}", number) from None


def _columns(path: Path, line: int, header: list[str]) -> dict[str, int]:
    names = [name.strip().lower() for name in header]
    columns: dict[str, int] = {}
    for name, aliases in ALIASES.items():
        found = [position for position, given in enumerate(names) if given in aliases]
        if len(found) > 1:
            raise StemMapError(path, f"two columns are called {' or '.join(aliases)}: keep one", line)
        if found:
            columns[name] = found[0]
    for name in ("x_m", "y_m"):
        if name not in columns:
            hint = "" if len(names) > 1 else ", separated by commas"
            raise StemMapError(
                path, f"column {' or '.join(ALIASES[name])} is missing: the header must name x_m and y_m{hint}", line
            )
    return columns


def _quoted(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
