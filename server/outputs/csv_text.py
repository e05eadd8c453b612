"""Tables as CSV: a header, then a line for each row, with x, y and the name of their system."""

import csv
import io
from collections.abc import Iterable, Iterator
from datetime import datetime
from typing import Any, Final

from server.outputs.formulas import guarded
from server.outputs.tables import OutputLayer, OutputRows, written_time

_DECIMALS: Final = 4
"""A tenth of a millimetre, if the unit is the metre or the foot. The reader takes x and y as they are written."""


def csv_pieces(layer: OutputLayer, batches: Iterable[OutputRows]) -> Iterator[bytes]:
    """UTF-8 text, RFC 4180. `crs` names the system of `x` and `y` in each row; it is empty in a local frame.

    Text that a spreadsheet would run as a formula has an apostrophe before it.
    """
    names = [column.name for column in layer.columns]
    lead = layer.leading
    yield _lines([[*names[:lead], "x", "y", *names[lead:], "crs"]])
    system = (layer.system.name or "") if layer.system.crs is not None else ""
    for rows in batches:
        columns = [list(map(_cell, values)) for values in rows.values]
        x, y = ([_position(value) for value in rows.xy[:, axis].tolist()] for axis in (0, 1))
        systems = [system if one else "" for one in x]
        yield _lines(zip(*columns[:lead], x, y, *columns[lead:], systems, strict=True))


def _lines(rows: Iterable[Iterable[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()


def _position(value: float) -> str:
    return "" if value != value else f"{value:.{_DECIMALS}f}"


def _cell(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case float():
            return "" if value != value else repr(value)
        case datetime():
            return written_time(value)
        case str():
            return guarded(value)
        case _:
            return str(value)
