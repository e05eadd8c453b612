"""Tables as GeoPackage files, through GDAL."""

import errno
import os
import warnings
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.outputs.extras import import_extra
from server.outputs.tables import ColumnKind, OutputLayer, OutputRows, no_rows, well_known_binary

_ROWS: Final = 50_000
"""Rows that GDAL gets at once. Each time it opens the file and commits: a million rows in batches of 5,000 take 27 s of
processor time, in batches of 50,000 19 s.
"""
_TYPES: Final[dict[ColumnKind, str]] = {"real": "float64", "integer": "int64", "boolean": "bool"}


def write_geopackage(path: Path, layer: OutputLayer, batches: Iterable[OutputRows]) -> int:
    """Write a layer to the file `path`, beside the layers that it has already. Returns the number of rows.

    Raises:
        NotAcceptable: the package that writes the format is not installed.
        OSError: the file cannot be written.
    """
    raw = import_extra("pyogrio.raw", "gis", "GeoPackage")
    # Without it each commit waits for the disk, which took most of the time. The file is new: it is synced once, whole.
    import_extra("pyogrio", "gis", "GeoPackage").set_gdal_config_options({"OGR_SQLITE_SYNCHRONOUS": "OFF"})
    options = {"layer": layer.name, "driver": "GPKG", "geometry_type": layer.shape, "crs": layer.crs.to_wkt()}
    fields = np.array([column.name for column in layer.columns])
    count = 0
    is_first = True
    for rows in _or_none(layer, _gathered(batches)):
        shapes = np.array(well_known_binary(layer, rows), dtype=object)
        columns = [_column(column.kind, values) for column, values in zip(layer.columns, rows.values, strict=True)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GDAL's hints, such as a local system without a code
            try:
                raw.write(
                    str(path),
                    shapes,
                    [values for values, _ in columns],
                    fields,
                    field_mask=[mask for _, mask in columns],
                    append=not is_first or path.exists(),
                    **options,
                )
            except RuntimeError as error:  # pyogrio's own errors are of this class
                told = " ".join(str(error).split())
                raise OSError(errno.ENOSPC if "full" in told else errno.EIO, told, str(path)) from error
        count += len(rows)
        is_first = False
    with path.open("rb") as file:
        os.fsync(file.fileno())
    return count


def _gathered(batches: Iterable[OutputRows]) -> Iterable[OutputRows]:
    """The same rows in large batches."""
    waiting: list[OutputRows] = []
    count = 0
    for rows in batches:
        waiting.append(rows)
        count += len(rows)
        if count >= _ROWS:
            yield OutputRows.joined(waiting)
            waiting, count = [], 0
    if waiting:
        yield OutputRows.joined(waiting)


def _or_none(layer: OutputLayer, batches: Iterable[OutputRows]) -> Iterable[OutputRows]:
    """The batches, or one without rows, so that the layer is there."""
    is_empty = True
    for rows in batches:
        is_empty = False
        yield rows
    if is_empty:
        yield no_rows(layer)


def _column(kind: ColumnKind, values: Any) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """The values as an array that GDAL takes, and which of them are missing, unless the array says so itself."""
    if kind == "text":
        return np.array(list(values), dtype=object), None
    if kind == "time":
        return np.array([None if value is None else _utc(value) for value in values], dtype="datetime64[ms]"), None
    missing = np.array([value is None for value in values], dtype=bool)
    filled = [0 if value is None else value for value in values]
    return np.array(filled, dtype=_TYPES[kind]), missing


def _utc(value: datetime) -> datetime:
    return value.astimezone(UTC).replace(tzinfo=None)
