"""Which rows of a table are read: those of living trees, or of one plot, if the caller says so."""

from collections import Counter
from typing import Final

import numpy as np

from server.stem_maps.formats.table import FileTable, StemMapError
from server.stem_maps.reading.columns import Columns
from server.stem_maps.reading.options import ReadOptions

_SHOWN: Final = 6
"""Most values of a column in a message."""


def only_chosen(table: FileTable, columns: Columns, options: ReadOptions, notes: list[str]) -> FileTable:
    """The rows of trees whose status, and of the plot, that the caller chose. Raises StemMapError."""
    for option, key, kept in (("keep", "status", options.keep), ("only", "plot", (options.only,))):
        chosen = {value.strip() for value in kept if value is not None}
        if key not in columns.positions:
            if chosen:
                raise StemMapError(table.path, f"--{option} is given: name the column with --{key}, too")
            continue
        if key == "plot" and not chosen:
            continue
        values = table.texts(columns.positions[key])
        name, count = columns.names[key], Counter(values)
        there = ", ".join(f"{value!r} ({number})" for value, number in count.most_common(_SHOWN))
        if not chosen:
            raise StemMapError(
                table.path, f"the column {name!r} has the values {there}: name those of trees to read with --keep"
            )
        chosen, missing = _spelled(chosen, count, distinct=key == "plot")
        if key == "plot" and len(chosen) > 1:
            both = " and ".join(repr(value) for value in sorted(chosen)[:2])
            raise StemMapError(table.path, f"--only fits the plots {both}: name one as the file writes it")
        mask = np.array([value in chosen for value in values], dtype=bool)
        if missing and len(values):
            raise StemMapError(
                table.path, f"no row has the {key} {sorted(missing)[0]!r}, which --{option} names: there are {there}"
            )
        notes.append(f"left out {int((~mask).sum())} of {len(mask)} rows by their {name!r}")
        table = table.where(mask)
    return table


def _spelled(chosen: set[str], count: Counter[str], *, distinct: bool) -> tuple[set[str], set[str]]:
    """The values of a column that are meant by `chosen`, and the choices that fit none; upper and lower case are one.

    Args:
        count: rows by value.
        distinct: whether values that differ in their case only are different things, as plots `A` and `a` are: then a
            choice that is written like a value means that one only.
    """
    found, missing = set[str](), set[str]()
    for one in chosen:
        alike = {value for value in count if value.lower() == one.lower()}
        found |= {one} if distinct and one in alike else alike
        if not alike:
            missing.add(one)
    return found, missing
