"""What every format becomes: a table of columns, with the place of each row in its file."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

MOST_COLUMNS: Final = 2000
"""Columns of a table. Tables of trees have fewer than a hundred; a file with more has lost its line breaks."""
_SHOWN: Final = 60
"""Most characters of a name in a message."""

ColumnValues = Sequence[str] | NDArray[np.float64]
"""Text, in which an empty string is a missing value, or float64 numbers, in which NaN is one."""


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that cannot be used: where it is, its column (empty if it is the row as a whole), and what is wrong."""

    line: int
    column: str
    what: str

    def described(self, path: Path) -> str:
        """`file:line: column: what`."""
        column = f"{short(self.column)}: " if self.column else ""
        return f"{path}:{self.line}: {column}{self.what}"


class StemMapError(ValueError):
    """A file that cannot be read as a stem map.

    The message is one line: `FILE:LINE: what is wrong` or `FILE: what is wrong`.

    Attributes:
        path: the file.
        line: its line, row or feature, from 1; None if the error is not about one.
        bad_rows: all rows that cannot be used; empty if the error is not about rows.
    """

    def __init__(self, path: Path, message: str, line: int | None = None, bad_rows: Sequence[BadRow] = ()) -> None:
        super().__init__(f"{path}: {message}" if line is None else f"{path}:{line}: {message}")
        self.path = path
        self.line = line
        self.bad_rows = tuple(bad_rows)


def refusal(path: Path, bad_rows: Sequence[BadRow]) -> StemMapError:
    """The error that reports `bad_rows`, of which there is at least one: the first in words, the others in number."""
    ordered = sorted(bad_rows, key=lambda row: row.line)
    first, others = ordered[0], len(ordered) - 1
    column = f"{short(first.column)}: " if first.column else ""
    more = f" ({others} more bad rows: `urquhart check` lists all)" if others else ""
    return StemMapError(path, f"{column}{first.what}{more}", first.line, ordered)


@dataclass(slots=True)
class FileTable:
    """The rows of one file.

    Attributes:
        path: the file.
        names: the header's names of the columns, stripped of white space.
        columns: the values, in the order of `names`; all of the same length.
        lines: (N,) int64, the line, row or feature of each row, from 1.
        header_line: the line of the header; None for files whose columns are named otherwise.
        separator: what separates the columns of text; empty for other formats.
        xy: (N, 2) float64 from a geometry, in the unit of the file's system; NaN where a row has none. None if the
            file has no geometry.
        crs: the coordinate reference system that the file names; None if it names none.
        notes: what was understood and passed over, for the one line that is told.
        bad_rows: rows that were left out because they are not rows of this table.
    """

    path: Path
    names: list[str]
    columns: list[ColumnValues]
    lines: NDArray[np.int64]
    header_line: int | None = None
    separator: str = ""
    xy: NDArray[np.float64] | None = None
    crs: str | None = None
    notes: list[str] = field(default_factory=list)
    bad_rows: list[BadRow] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.lines)

    def where(self, chosen: NDArray[np.bool_]) -> "FileTable":
        """The rows of `chosen` (N,)."""
        rows = np.flatnonzero(chosen).tolist()
        columns: list[ColumnValues] = [
            column[chosen] if isinstance(column, np.ndarray) else [column[row] for row in rows]
            for column in self.columns
        ]
        xy = None if self.xy is None else self.xy[chosen]
        return replace(self, columns=columns, lines=self.lines[chosen], xy=xy)

    def texts(self, position: int) -> list[str]:
        """A column as stripped text; whole numbers without a decimal point, missing values empty."""
        column = self.columns[position]
        if isinstance(column, np.ndarray):
            return ["" if np.isnan(value) else f"{value:.0f}" if value.is_integer() else repr(value) for value in
                    column.tolist()]  # fmt: skip
        return [text.strip() for text in column]


def short(text: str) -> str:
    """A name cut to what fits in a message."""
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def check_width(path: Path, count: int, line: int | None = None) -> None:
    """Raise StemMapError if a table has more columns than any table of trees."""
    if count > MOST_COLUMNS:
        raise StemMapError(
            path,
            f"has {count} columns, and a table of trees has at most {MOST_COLUMNS}: give one line to each tree",
            line,
        )
