"""Rows of a table made trees: numbers, units, positions, ids and stems, each checked."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.schemas.landmarks import STEMS_CM, TALLEST_M
from server.stem_maps.formats.numbers import is_missing, missing_rows, number_format, to_numbers
from server.stem_maps.formats.table import BadRow, FileTable, StemMapError, refusal
from server.stem_maps.reading.centres import Centres
from server.stem_maps.reading.columns import Columns
from server.stem_maps.reading.headers import STATUSES, header_name
from server.stem_maps.reading.options import CENTIMETRES, METRES, ReadOptions
from server.stem_maps.reading.positions import find_positions
from server.stem_maps.reading.selection import only_chosen
from server.stem_maps.reading.trees import TreeRows, join_stems

COORDINATE_LIMIT: Final = 1e8
"""Metres. No projected coordinate on Earth is larger, so a larger one is in another unit."""
_THINNEST_MM: Final = 10.0
"""Millimetres. ForestGEO measures stems from this on, so thinner ones are in another unit."""


def read_rows(table: FileTable, columns: Columns, options: ReadOptions, centres: Centres | None) -> TreeRows:
    """The trees of `table`; `centres` are those of its plots. Rows at fault are in `bad_rows`.

    Raises:
        StemMapError: the file as a whole cannot be understood.
    """
    notes = list(table.notes)
    table = only_chosen(table, columns, options, notes)
    positions = find_positions(table, columns, options, centres)
    rest = {key: columns.positions[key] for key in ("dbh", "height") if key in columns.positions}
    read = {key: columns.positions[key] for key in positions.used if key in columns.positions}
    style = number_format(
        [(table.names[at], table.columns[at]) for at in (read | rest).values()],
        table.lines,
        table.separator,
        None if options.decimal is None else ("." if options.decimal == "point" else ","),
    )
    if isinstance(style, BadRow):
        raise refusal(table.path, [style])
    bad_rows = list(table.bad_rows)

    def number(key: str) -> NDArray[np.float64]:
        at = columns.positions[key]
        return to_numbers(table.names[at], table.columns[at], table.lines, style, bad_rows)

    xy = positions.compute({key: number(key) for key in read}, bad_rows)
    trees = TreeRows(table.path, columns, options, table.lines, [], xy, positions, bad_rows=bad_rows, notes=notes)
    trees.centres, trees.assumed_azimuths = positions.centres_xy, positions.assumed_azimuths
    trees.notes += [style.told()] if style.told() else []
    _check_coordinates(trees, table)
    if "dbh" in rest:
        trees.dbh_cm = _diameters(trees, number("dbh"))
    if "height" in rest:
        trees.height_m = _heights(trees, number("height"))
    _set_names(trees, table)
    taken = {at for key, at in columns.positions.items() if key in {*positions.used, *rest, *_NAMES}}
    trees.unused = tuple(name for at, name in enumerate(table.names) if at not in taken and name)
    trees.notes += [
        f"{name!r} is not used, so dead trees may be among these: --status and --keep leave them out"
        for name in trees.unused
        if header_name(name).base in STATUSES
    ]
    trees.whole = table.separator == "," and _is_whole(table, columns)
    join_stems(trees)
    return trees


_NAMES: Final = ("id", "species", "plot", "status")


def _check_coordinates(trees: TreeRows, table: FileTable) -> None:
    """Report positions that are missing or too large."""
    reported = {row.line for row in trees.bad_rows}
    for axis, key in enumerate("xy"):
        name = trees.columns.names.get(key, key)
        values = trees.xy[:, axis]
        if trees.positions.is_read:
            trees.bad_rows += missing_rows(name, values, table.lines, trees.bad_rows)
        else:
            missing = [line for line in table.lines[np.isnan(values)].tolist() if line not in reported]
            trees.bad_rows += [BadRow(line, "", "has no position") for line in missing]
            reported |= set(missing)
        for row in np.flatnonzero(np.abs(values) > COORDINATE_LIMIT).tolist():
            trees.bad_rows.append(
                BadRow(int(table.lines[row]), name, f"is {values[row]:g}: coordinates must be in metres")
            )


def _diameters(trees: TreeRows, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Diameters (N,) in centimetres, of diameters or radii in the column's unit; rows at fault are reported."""
    name, unit = trees.columns.names["dbh"], trees.columns.units.get("dbh", "cm")
    if "dbh" not in trees.columns.units and trees.positions.unit in ("ft", "us-ft", "yd", "in"):
        raise StemMapError(
            trees.path, f"positions are in {trees.positions.unit}, and {name!r} names no unit: name it with --dbh-unit"
        )
    if name.strip().lower() == "radius":
        values = 2.0 * values
    factor = CENTIMETRES[unit]
    # By division, which is exact: 211 mm are 21.1 cm, but 211 * 0.1 is slightly more.
    dbh_cm = values * factor if factor >= 1.0 else values / round(1.0 / factor)
    _report(trees, name, values <= 0, values, "must be more than 0, or empty: {value:g}")
    outside = (values > 0) & ((dbh_cm < STEMS_CM[0]) | (dbh_cm > STEMS_CM[1]))
    known = values[values > 0]
    if trees.columns.family_unit and unit == "mm" and len(known) and known.min() < _THINNEST_MM:
        raise StemMapError(
            trees.path,
            f"{trees.columns.family} writes diameters in mm from {_THINNEST_MM:g} on, and the column {name!r} has "
            f"{known.min():g}: name the unit with --dbh-unit",
        )
    if 2 * int(outside.sum()) > len(known):
        raise wrong_unit(trees, float(np.median(dbh_cm[values > 0])))
    advice = (
        f"is {{value:g}} {unit}, but stems are {STEMS_CM[0]:g} to {STEMS_CM[1]:g} cm thick: give the unit in the "
        "column's name (dbh_cm, dbh_mm, dbh_m, dbh_in) or with --dbh-unit"
    )
    _report(trees, name, outside, values, advice)
    return dbh_cm


def wrong_unit(trees: TreeRows, median: float) -> StemMapError:
    """The error for diameters whose `median`, in centimetres, no stand has."""
    name, unit = trees.columns.names["dbh"], trees.columns.units.get("dbh", "cm")
    return StemMapError(
        trees.path,
        f"read in {unit}, the median of the column {name!r} is {median:.3g} cm, which no stand has: give the unit in "
        "the column's name (dbh_cm, dbh_mm, dbh_m, dbh_in) or with --dbh-unit",
    )


def _report(trees: TreeRows, name: str, at_fault: NDArray[np.bool_], values: NDArray[np.float64], what: str) -> None:
    """Report the rows `at_fault` (N,), with their values in place of `{value}`."""
    trees.bad_rows += [
        BadRow(int(trees.lines[row]), name, what.format(value=values[row])) for row in np.flatnonzero(at_fault).tolist()
    ]


def _heights(trees: TreeRows, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights (N,) in metres; rows at fault are reported. Raises StemMapError if their unit must be named."""
    name, unit = trees.columns.names["height"], trees.columns.units.get("height")
    if unit is None and trees.positions.unit != "m":
        raise StemMapError(
            trees.path,
            f"positions are in {trees.positions.unit}, and {name!r} names no unit: name it with --height-unit",
        )
    height_m = values * METRES[unit or "m"]
    _report(trees, name, values <= 0, values, "must be more than 0, or empty: {value:g}")
    advice = f"is {{value:g}} {unit or 'm'}: no tree is so high; name the unit with --height-unit"
    _report(trees, name, height_m > TALLEST_M, values, advice)
    return height_m


def _set_names(trees: TreeRows, table: FileTable) -> None:
    """Ids, plots and species."""
    places = trees.columns.positions
    if "id" in places:
        trees.ids = table.texts(places["id"])
        for line, tree_id in zip(table.lines.tolist(), trees.ids, strict=True):
            if is_missing(tree_id):
                trees.bad_rows.append(BadRow(line, "", "the tree's id is empty"))
    else:
        trees.ids = [str(number) for number in range(1, len(table) + 1)]
    if "species" in places:
        trees.species = ["" if is_missing(name) else name for name in table.texts(places["species"])]
    if "plot" in places:
        trees.plots = table.texts(places["plot"])
        trees.by_plot = trees.options.plot is not None or trees.options.each_plot
        for line, plot in zip(table.lines.tolist(), trees.plots, strict=True):
            if trees.by_plot and is_missing(plot):
                trees.bad_rows.append(
                    BadRow(line, trees.columns.names["plot"], "has no value, and a tree needs its plot")
                )


def _is_whole(table: FileTable, columns: Columns) -> bool:
    return all(
        text.strip().lstrip("+-").isdigit()
        for key in ("x", "y")
        if key in columns.positions
        for text in table.columns[columns.positions[key]]
        if isinstance(text, str)
    )
