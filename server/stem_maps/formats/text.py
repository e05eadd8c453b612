"""Tables of text: CSV with any separator, title rows and comments above the header, and R's row names."""

import csv
import io
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from server.outputs.formulas import unguarded
from server.stem_maps.formats.decoding import decode
from server.stem_maps.formats.table import BadRow, FileTable, StemMapError, check_width

SEPARATORS: Final = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}
_DECIMAL: Final = re.compile(r"\s*[-+]?\d*[.,]\d+\s*")
_TITLES: Final = 50
"""Lines, from the first, among which the header is looked for."""


@dataclass(frozen=True, slots=True)
class _Header:
    """The header of a table: its line, its names, and what separates them. Lines before `start` are above the rows."""

    line: int
    names: list[str]
    separator: str
    titles: int
    comments: int


def read_text(path: Path, data: bytes, is_header: Callable[[list[str]], bool]) -> FileTable:
    """The table in `data`, the content of `path`. `is_header` recognises the names of a header.

    Rows whose number of fields differs from that of the header become `bad_rows`.

    Raises:
        StemMapError: there is no header, or the rows are not separated as the header is.
    """
    text, encoding = decode(path, data)
    lines = [*io.StringIO(text, newline=None)]
    header = _find_header(path, lines, is_header)
    rows = _Rows(path, lines, header)
    table = rows.table(path)
    if encoding:
        table.notes.append(f"read as {encoding}")
    if header.separator != ",":
        table.notes.append(f"columns separated by {SEPARATORS.get(header.separator, repr(header.separator))}")
    if header.titles:
        table.notes.append(f"passed over {header.titles} title rows above the header on line {header.line}")
    if header.comments or rows.blanks:
        table.notes.append(f"passed over {header.comments} comments above the header and {rows.blanks} blank lines")
    if rows.is_shifted:
        table.notes.append("the first value of each row has no name, as R writes its row names")
    return table


def _find_header(path: Path, lines: list[str], is_header: Callable[[list[str]], bool]) -> _Header:
    """The first line that names columns of trees; the first that is no comment if none does. Raises StemMapError."""
    named, first, titles, comments = "", None, 0, 0
    for number, line in enumerate(lines[:_TITLES], start=1):
        stripped = line.strip()
        if not stripped:
            continue
        if number == 1 and stripped.lower().startswith("sep=") and len(line.strip("\r\n")) > 4:
            named = line.strip("\r\n")[4]
            continue
        if stripped.startswith("#"):
            comments += 1
            continue
        separator, names = _split(stripped.removeprefix("//"), named)
        check_width(path, len(names), number)  # before a million names are looked at
        found = _Header(number, names, separator, titles, comments)
        if is_header(names):
            return found
        titles += 1
        first = first or found
    if first is None:
        raise StemMapError(path, "the file is empty: a header line with the columns x_m and y_m is needed")
    return first


def _split(line: str, named: str) -> tuple[str, list[str]]:
    """The separator of a line, whichever is most frequent, and its fields. No separator is a space."""
    separator = named or max((",", ";", "\t"), key=line.count)
    if separator not in line and len(line.split()) > 1 and not named:
        separator = " "
    try:
        fields = next(csv.reader([line], delimiter=separator, skipinitialspace=separator == " "), [])
    except (csv.Error, TypeError, ValueError):  # one field is too long, or the line names an impossible separator
        return ",", [line]
    return separator, [field.strip() for field in fields]


class _Rows:
    """The rows below a header, read once."""

    def __init__(self, path: Path, lines: list[str], header: _Header) -> None:
        self.blanks = sum(not line.strip() for line in lines[: header.line])
        self.is_shifted = False
        self._header = header
        self._line = header.line
        self._rows: list[list[str]] = []
        self._numbers: list[int] = []
        reader = csv.reader(
            self._below(lines), delimiter=header.separator, strict=True, skipinitialspace=header.separator == " "
        )
        try:
            for fields in reader:
                if any(fields):
                    self._rows.append(fields)
                    self._numbers.append(self._line)
                else:
                    self.blanks += 1
        except csv.Error as error:
            kind = SEPARATORS.get(header.separator, "others").removesuffix("s")
            raise StemMapError(path, f"is not {kind}-separated text: {error}", self._line) from None

    def _below(self, lines: list[str]) -> Iterator[str]:
        with_spaces = self._header.separator == " "
        for number, line in enumerate(lines[self._header.line :], start=self._header.line + 1):
            self._line = number
            if line.strip():
                yield line.strip() + "\n" if with_spaces else line
            else:
                self.blanks += 1

    def table(self, path: Path) -> FileTable:
        """The rows as columns."""
        names, width = self._header.names, len(self._header.names)
        bad_rows: list[BadRow] = []
        if self._has_row_names(width):
            self.is_shifted = True
            names, width = ["", *names], width + 1
        kept: list[list[str]] = []
        numbers: list[int] = []
        for number, row in zip(self._numbers, self._rows, strict=True):
            if len(row) > width and not any(field.strip() for field in row[width:]):
                row = row[:width]  # spreadsheets write separators up to their last used column
            if len(row) == width:
                kept.append(row)
                numbers.append(number)
            else:
                comment = ": a comment may only stand above the header" if row[0].lstrip().startswith("#") else ""
                bad_rows.append(BadRow(number, "", f"{len(row)} fields where the header has {width}{comment}"))
        columns = list(zip(*kept, strict=True)) if kept else [()] * width
        # Written so by exports, so that a spreadsheet does not take a tag for a formula.
        columns = [
            tuple(map(unguarded, values)) if any(one.startswith("'") for one in values) else values
            for values in columns
        ]
        return FileTable(
            path=path,
            names=list(names),
            columns=list(columns),
            lines=np.asarray(numbers, dtype=np.int64),
            header_line=self._header.line,
            separator=self._header.separator,
            bad_rows=bad_rows,
        )

    def _has_row_names(self, width: int) -> bool:
        """Whether each row begins with a value of its own that has no name in the header, as R writes its row names."""
        if self._header.separator not in " \t" or not all(len(row) == width + 1 for row in self._rows):
            return False
        firsts = {row[0] for row in self._rows}
        is_name = len(firsts) == len(self._rows) > 0 and not any(map(_DECIMAL.fullmatch, firsts))
        return is_name and all(row[-1].strip() for row in self._rows)
