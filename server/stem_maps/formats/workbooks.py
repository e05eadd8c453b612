"""Spreadsheets (xlsx) through openpyxl: one sheet, whose header may have titles above it."""

import datetime
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from server.stem_maps.formats.extras import import_extra
from server.stem_maps.formats.table import ColumnValues, FileTable, StemMapError, check_width

_MOST_BYTES: Final = 1 << 30
"""Bytes of an unpacked workbook. A million trees with ten columns have a third of it."""
_MOST_RATIO: Final = 200
"""Bytes unpacked for each byte packed. Sheets of numbers have 5 to 20."""
_SMALL: Final = 50_000_000
"""Bytes that may be unpacked at any ratio."""
_TITLES: Final = 50
_PIECE: Final = 1 << 24
"""Bytes of a sheet's text that are searched at once."""
_HEAD: Final = 200
"""Bytes of the beginning of a row, in which its number stands."""
_VALUES: Final = (b"<v>", b"<v ", b"<is>", b"<is ")
"""How the value of a cell begins."""
_ROW: Final = re.compile(rb"<row [^>]*?\br=\"(\d+)\"")
_DAMAGED: Final = (
    *(ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, OSError, RuntimeError, SyntaxError),
    *(TypeError, ValueError, struct.error, zipfile.BadZipFile, zlib.error),
)
"""What reading a damaged workbook may raise: openpyxl has no error of its own for it."""


def read_workbook(path: Path, sheet: str | None, is_header: Callable[[list[str]], bool]) -> FileTable:
    """The table on a sheet; the only one that has a header of trees, or the one that is named.

    Raises:
        StemMapError: the file is no workbook, has a password, unpacks to too much, or several sheets could be meant.
    """
    openpyxl = import_extra(path, "gis", "openpyxl")
    _check_archive(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # openpyxl's hints about styles that it leaves out
        try:
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
            try:
                rows = {
                    name: _rows(book[name], _last_row(path, book[name]))
                    for name in book.sheetnames
                    if hasattr(book[name], "iter_rows")
                }
            finally:
                book.close()
        except _DAMAGED as error:
            raise StemMapError(path, f"is no workbook that can be read: {' '.join(str(error).split())}") from error
    name = _sheet(path, rows, sheet, is_header)
    table = _table(path, rows[name], is_header)
    table.notes.append(f"sheet {name!r}")
    return table


def _check_archive(path: Path) -> None:
    with path.open("rb") as file:
        beginning = file.read(4)
    if beginning == b"\xd0\xcf\x11\xe0":
        raise StemMapError(path, "has a password, or is an old xls file: save it as xlsx without a password")
    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
    except _DAMAGED as error:
        raise StemMapError(path, "is no workbook, or only a part of one: save it as xlsx again") from error
    unpacked, packed = sum(one.file_size for one in parts), sum(one.compress_size for one in parts)
    if unpacked > _MOST_BYTES or (unpacked > _SMALL and unpacked > _MOST_RATIO * max(packed, 1)):
        raise StemMapError(path, f"unpacks to {unpacked / 1e6:.0f} MB, which no table of trees needs: write it as CSV")


def _last_row(path: Path, sheet: Any) -> int | None:
    """The last row of a sheet that has a value; None if its text does not show that.

    Sheets with formats down to row 1,048,576 are frequent. Parsing a million blank rows takes 17 s, this a second.
    """
    inside = getattr(sheet, "_worksheet_path", None)
    if inside is None:
        return None
    latest: bytes | None = None
    found: bytes | None = None
    rest = b""
    with zipfile.ZipFile(path) as archive, archive.open(inside) as text:
        while piece := text.read(_PIECE):
            piece = rest + piece
            end = max(piece.rfind(mark) for mark in _VALUES)
            row = piece.rfind(b"<row ", 0, end) if end >= 0 else -1
            found = (piece[row : row + _HEAD] if row >= 0 else latest) if end >= 0 else found
            row = piece.rfind(b"<row ", 0, max(len(piece) - _HEAD, 0))
            latest = piece[row : row + _HEAD] if row >= 0 else latest
            rest = piece[-_HEAD:]
    if found is None and latest is not None:
        return 1  # only blank rows
    number = None if found is None else _ROW.match(found)
    return None if number is None else int(number[1])


def _rows(sheet: Any, last: int | None) -> list[tuple[int, list[Any]]]:
    """Number and cells of each row up to `last` that is not empty, without empty cells at its end."""
    sheet.reset_dimensions()
    found = []
    for number, cells in enumerate(sheet.iter_rows(values_only=True, max_row=last), start=1):
        row = list(cells)
        while row and row[-1] is None:
            row.pop()
        if row:
            found.append((number, row))
    return found


def _sheet(
    path: Path, rows: dict[str, list[tuple[int, list[Any]]]], wanted: str | None, is_header: Callable[[list[str]], bool]
) -> str:
    names = [name for name, found in rows.items() if found]
    if wanted is not None:
        if wanted not in rows:
            raise StemMapError(path, f"has no sheet {wanted!r}: there are {', '.join(map(repr, rows))}")
        return wanted
    if not names:
        raise StemMapError(path, "the file is empty: a header row with the columns x_m and y_m is needed")
    fitting = [name for name in names if any(is_header(_names(row)) for _, row in rows[name][:_TITLES])]
    if len(fitting) > 1:
        raise StemMapError(
            path, f"has {len(fitting)} sheets of trees, {', '.join(map(repr, fitting))}: choose one with --layer"
        )
    return (fitting or names)[0]


def _names(row: list[Any]) -> list[str]:
    return [_text(cell).strip() for cell in row]


def _table(path: Path, rows: list[tuple[int, list[Any]]], is_header: Callable[[list[str]], bool]) -> FileTable:
    at = next((i for i, (_, row) in enumerate(rows[:_TITLES]) if is_header(_names(row))), 0)
    header_line, names = (rows[at][0], _names(rows[at][1])) if rows else (1, [])
    check_width(path, len(names), header_line)
    width = max([len(names), *(len(row) for _, row in rows[at + 1 :])])
    check_width(path, width)
    names += [""] * (width - len(names))
    body = [row + [None] * (width - len(row)) for _, row in rows[at + 1 :]]
    notes = [f"passed over {at} title rows above the header in row {header_line}"] if at else []
    return FileTable(
        path=path,
        names=names,
        columns=[_column([row[i] for row in body]) for i in range(width)],
        lines=np.asarray([number for number, _ in rows[at + 1 :]], dtype=np.int64),
        header_line=header_line,
        notes=notes,
    )


def _column(cells: list[Any]) -> ColumnValues:
    if all(cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool)) for cell in cells):
        return np.asarray([np.nan if cell is None else float(cell) for cell in cells], dtype=np.float64)
    return [_text(cell) for cell in cells]


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float) and cell.is_integer():
        return f"{cell:.0f}"
    if isinstance(cell, datetime.datetime | datetime.date):
        return cell.isoformat()
    return str(cell)
