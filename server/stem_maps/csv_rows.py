"""A table of text: decoded, and split into rows and fields. Skipped lines are counted."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Final

SEPARATORS: Final = {",": "commas", ";": "semicolons", "\t": "tabs"}


class StemMapError(ValueError):
    """A stem map that cannot be read. The message is one line: `FILE:LINE: what is wrong` or `FILE: what is wrong`."""

    def __init__(self, path: Path, message: str, line: int | None = None) -> None:
        super().__init__(f"{path}: {message}" if line is None else f"{path}:{line}: {message}")
        self.path = path
        self.line = line


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises StemMapError."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise StemMapError(path, "no such file") from None
    except IsADirectoryError:
        raise StemMapError(path, "is a directory: give a CSV file") from None
    except OSError as error:
        raise StemMapError(path, f"cannot be read: {error.strerror or error}") from None


def decode(path: Path, data: bytes) -> str:
    """The text of UTF-8 bytes, without a byte order mark. Raises StemMapError naming the line."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        kind = " but UTF-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ""
        raise StemMapError(path, f"is not UTF-8 text{kind}: save the file as CSV in UTF-8", line) from None


class Rows:
    """The header and the rows of a table, read once from first to last.

    Comments (lines that begin with `#`) may only be above the header: below it, `#13` is a tree's tag. The separator is
    whichever of comma, semicolon and tab is most frequent in the header.
    """

    def __init__(self, path: Path, text: str) -> None:
        self.comments = 0
        self.blanks = 0
        self.line = 0
        """The line, from 1, that the row read last ends on."""
        self.header: list[str] = []
        self.header_line = 0
        self._path = path
        self._lines = self._without_blanks(text)
        first = next(self._lines, None)
        self.separator = "," if first is None else max(SEPARATORS, key=first.count)
        if first is not None:
            self.header_line = self.line
            self._rows = csv.reader(self._from(first), delimiter=self.separator, strict=True)
            self.header = [name.strip() for name in self._next() or []]

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Line number and fields of each row. Raises StemMapError."""
        while (fields := self._next()) is not None:
            yield self.line, fields

    def _next(self) -> list[str] | None:
        try:
            return next(self._rows, None)
        except csv.Error as error:
            kind = "comma" if self.separator == "," else SEPARATORS[self.separator].removesuffix("s")
            raise StemMapError(self._path, f"is not {kind}-separated text: {error}", self.line) from None

    def _from(self, first: str) -> Iterator[str]:
        yield first
        yield from self._lines

    def _without_blanks(self, text: str) -> Iterator[str]:
        above = True
        for self.line, line in enumerate(io.StringIO(text, newline=None), start=1):
            if not line.strip():
                self.blanks += 1
            elif above and line.lstrip().startswith("#"):
                self.comments += 1
            else:
                above = False
                yield line
