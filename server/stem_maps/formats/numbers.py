"""Numbers as people write them: decimal points or commas, thousands, and words for a missing value."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.table import BadRow, ColumnValues

MISSING_WORDS: Final = frozenset(
    {"", "na", "n/a", "n.a.", "#n/a", "nan", "null", "none", "nil", "-", "--", ".", "?", "missing", "<na>", "#value!"}
)
"""Words for a value that is not known, in lower case."""
Mark = Literal[".", ","]

_PLAIN: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_UNUSUAL: Final = re.compile(r"[^0-9.eE+\-\n]")
"""What no plain number has. Python's float() takes more, such as 1_000 and nan."""
_GROUPED: Final = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,'’ \u00a0\u202f])\d{3})(?:\1\d{3})*(?:(?!\1)[.,]\d*)?", re.ASCII)
"""Thousands in groups of three, and perhaps decimals."""
_SPACES: Final = "'’ \u00a0\u202f"
"""What separates thousands and is no decimal mark: apostrophes and spaces."""
_INFINITE: Final = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_QUOTED: Final = 40


@dataclass(frozen=True, slots=True)
class NumberFormat:
    """How a file writes numbers: its decimal mark, and whether thousands are grouped."""

    decimal: Mark = "."
    has_thousands: bool = False

    def told(self) -> str:
        """What is worth saying of it; empty for plain decimal points."""
        parts = ["decimals with commas"] if self.decimal == "," else []
        return ", ".join([*parts, "thousands grouped"] if self.has_thousands else parts)


@dataclass(slots=True)
class _Marks:
    """An example (line, column, text) of each way in which the numbers of a file show their decimal mark.

    Attributes:
        shown: the mark has decimals that are no group of three, or stands after groups of the other mark.
        implied: the other mark separates several groups of three.
        unsure: one group of three follows the mark, so it may separate thousands as well.
    """

    shown: dict[Mark, tuple[int, str, str]] = field(default_factory=dict)
    implied: dict[Mark, tuple[int, str, str]] = field(default_factory=dict)
    unsure: dict[Mark, tuple[int, str, str]] = field(default_factory=dict)
    has_spaces: bool = False
    has_groups: bool = False

    def add(self, line: int, name: str, text: str) -> None:
        if "," not in text:
            if "." in self.shown and text.count(".") == 1:
                return  # says nothing new; most numbers of most files are such
            if "." not in text:
                self.has_spaces = self.has_spaces or (not text.isdigit() and _GROUPED.fullmatch(text) is not None)
                return
        if not any(letter.isdigit() for letter in text):
            return
        last: Mark = "," if text.rfind(",") > text.rfind(".") else "."
        other: Mark = "." if last == "," else ","
        is_grouped = _GROUPED.fullmatch(text) is not None
        self.has_spaces = self.has_spaces or (is_grouped and any(space in text for space in _SPACES))
        if other in text:
            self.has_groups = True
            kind, mark = self.shown, last
        elif text.count(last) > 1:
            if not is_grouped:
                return
            kind, mark = self.implied, other
        else:
            kind, mark = (self.unsure if is_grouped and not self.has_spaces else self.shown), last
        kind.setdefault(mark, (line, name, text))


def is_missing(text: str) -> bool:
    """Whether stripped text stands for a value that is not known."""
    return text.lower() in MISSING_WORDS


def number_format(
    columns: Sequence[tuple[str, ColumnValues]], lines: NDArray[np.int64], separator: str, decimal: Mark | None
) -> NumberFormat | BadRow:
    """How the numbers of a file are written, found from all of its numeric columns, each with its name.

    `decimal` is the mark that the caller named. If two numbers contradict each other, or a comma may mean either, the
    row that shows it is returned, because any reading would be a guess.
    """
    marks = _Marks()
    for name, column in columns:
        if not isinstance(column, np.ndarray):
            for line, raw in zip(lines.tolist(), column, strict=True):
                marks.add(line, name, raw.strip())
    chosen = _choose(marks, separator, decimal)
    if isinstance(chosen, BadRow):
        return chosen
    other: Mark = "," if chosen == "." else "."
    has_thousands = marks.has_spaces or marks.has_groups or other in marks.unsure or chosen in marks.implied
    return NumberFormat(chosen, has_thousands)


def _choose(marks: _Marks, separator: str, decimal: Mark | None) -> Mark | BadRow:
    if decimal is not None:
        return decimal
    certain = {**marks.implied, **marks.shown}
    if len(certain) == 2:
        first, last = sorted(certain, key=lambda mark: certain[mark][0])
        line, name, text = certain[last]
        return BadRow(
            line,
            name,
            f"is {_shown(text)}, but line {certain[first][0]} has {first!r} as the decimal mark: use one, and write "
            "numbers without thousands separators",
        )
    chosen: Mark = next(iter(certain), "," if "," in marks.unsure else ".")
    other: Mark = "," if chosen == "." else "."
    is_unsure = other in marks.unsure and chosen not in marks.shown
    if is_unsure or (not certain and chosen == "," and separator == ","):
        line, name, text = marks.unsure[other if is_unsure else ","]
        return BadRow(
            line,
            name,
            f"is {_shown(text)}, whose {'point' if '.' in text else 'comma'} may be a decimal mark or separate "
            "thousands: write numbers without thousands separators, and decimals with a point; or say --decimal comma "
            "or --decimal point",
        )
    return chosen


def to_numbers(
    name: str, column: ColumnValues, lines: NDArray[np.int64], style: NumberFormat, bad_rows: list[BadRow]
) -> NDArray[np.float64]:
    """A column as (N,) float64, NaN where a value is missing. What is no number is added to `bad_rows`, and is NaN."""
    if isinstance(column, np.ndarray):
        bad_rows += [BadRow(line, name, "not a finite number") for line in lines[np.isinf(column)].tolist()]
        return np.where(np.isinf(column), np.nan, column)
    if style.decimal == "." and (plain_numbers := _all_plain(column)) is not None:
        return plain_numbers
    numbers = np.full(len(column), np.nan)
    for row, raw in enumerate(column):
        text = raw.strip()
        plain = text if _PLAIN.fullmatch(text) and style.decimal == "." else _plain(text, style)
        if plain is not None:
            numbers[row] = float(plain)
        if plain is None and not is_missing(text):
            what = "not a finite number" if _INFINITE.fullmatch(text) else "not a number"
            bad_rows.append(BadRow(int(lines[row]), name, f"{what}: {_shown(text)}{_advice(text)}"))
        elif np.isinf(numbers[row]):
            bad_rows.append(BadRow(int(lines[row]), name, f"not a finite number: {_shown(text)}"))
            numbers[row] = np.nan
    return numbers


def _all_plain(column: Sequence[str]) -> NDArray[np.float64] | None:
    """The numbers of a column that holds nothing but plain finite numbers, ten times as fast; None of any other."""
    if _UNUSUAL.search("\n".join(column)):
        return None
    try:
        numbers = np.fromiter(map(float, column), dtype=np.float64, count=len(column))
    except ValueError:  # an empty cell, or a sign in the wrong place
        return None
    return numbers if np.isfinite(numbers).all() else None


def _plain(text: str, style: NumberFormat) -> str | None:
    """A number in the notation of Python; None if it is none."""
    if _GROUPED.fullmatch(text):
        for mark in (*_SPACES, "," if style.decimal == "." else "."):
            text = text.replace(mark, "")
    elif style.decimal == "," and "." in text:
        return None
    if style.decimal == ",":
        text = text.replace(",", ".")
    return text if _PLAIN.fullmatch(text) else None


def _advice(text: str) -> str:
    has_groups = text.count(".") > 1 or text.count(",") > 1 or ("," in text and "." in text)
    return ": write numbers without thousands separators" if has_groups else ""


def _shown(text: str) -> str:
    return repr(text if len(text) <= _QUOTED else text[: _QUOTED - 3] + "...")


def missing_rows(
    name: str, numbers: NDArray[np.float64], lines: NDArray[np.int64], known: Iterable[BadRow]
) -> list[BadRow]:
    """A bad row for each number that is missing where one is needed, and is not reported yet."""
    reported = {row.line for row in known if row.column == name}
    missing = [line for line in lines[np.isnan(numbers)].tolist() if line not in reported]
    return [BadRow(line, name, "has no value, and a tree needs one") for line in missing]
