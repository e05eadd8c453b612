"""GeoParquet through pyarrow: points as well-known binary or as x and y, and their columns."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.extras import import_extra
from server.stem_maps.formats.table import ColumnValues, FileTable, StemMapError, check_width
from server.stem_maps.formats.vector_files import check_beginning, points_of

PARQUET_SUFFIX: Final = ".parquet"
_MOST_ROWS: Final = 20_000_000
"""Rows of a file. A small file may unpack to any number of them."""
_EXACT: Final = 2**53
"""Whole numbers up to this are float64 numbers, too."""


def read_parquet(path: Path, layer: str | None) -> FileTable:
    """The rows of a GeoParquet file, or of a Parquet file without geometry.

    Raises:
        StemMapError: the file is damaged, its metadata are not those of GeoParquet, or its geometries are not points.
    """
    check_beginning(path)
    if layer is not None:
        raise StemMapError(path, f"has no layers, but --layer names {layer!r}: drop it")
    parquet = import_extra(path, "parquet", "pyarrow.parquet")
    try:
        with parquet.ParquetFile(str(path)) as file:
            check_width(path, len(file.schema_arrow.names))
            if file.metadata.num_rows > _MOST_ROWS:
                raise StemMapError(path, f"has {file.metadata.num_rows} rows, and at most {_MOST_ROWS} are read")
            metadata = dict(file.metadata.metadata or {})
            table = file.read()
    except StemMapError:
        raise
    except (OSError, ValueError) as error:  # pyarrow's own errors are of these classes
        raise StemMapError(path, f"is no Parquet file that can be read: {' '.join(str(error).split())}") from error
    geo = _geo(path, metadata.get(b"geo"))
    primary = None if geo is None else str(geo.get("primary_column", "geometry"))
    names = [name for name in table.column_names if name != primary]
    columns = [_column(table.column(name)) for name in names]
    found = FileTable(path, names, columns, np.arange(1, table.num_rows + 1))
    if geo is not None and primary is not None:
        if primary not in table.column_names:
            raise StemMapError(path, f"its metadata name the geometry {primary!r}, which is no column of it")
        about = _about(path, geo, primary)
        found.xy = _positions(path, about, table.column(primary), found)
        found.crs = _system(about)
    found.notes.append("GeoParquet" if geo is not None else "Parquet without geometry")
    return found


def _geo(path: Path, text: bytes | None) -> Mapping[str, Any] | None:
    if text is None:
        return None
    try:
        geo = json.loads(text)
    except ValueError as error:
        raise StemMapError(path, f"its metadata `geo` are no JSON: {error}") from error
    if not isinstance(geo, dict) or not isinstance(geo.get("columns"), dict):
        raise StemMapError(path, "its metadata `geo` are not those of GeoParquet: `columns` is missing")
    return geo


def _about(path: Path, geo: Mapping[str, Any], primary: str) -> Mapping[str, Any]:
    about = geo["columns"].get(primary)
    if not isinstance(about, dict):
        raise StemMapError(path, f"its metadata say nothing of its geometry {primary!r}")
    return about


def _positions(path: Path, about: Mapping[str, Any], column: Any, table: FileTable) -> NDArray[np.float64]:
    encoding = about.get("encoding")
    if encoding == "WKB":
        shapes = np.empty(len(table), dtype=object)
        shapes[:] = column.to_pylist()
        return points_of(path, shapes, table)
    if encoding == "point":
        pairs = [(math.nan, math.nan) if one is None else (one["x"], one["y"]) for one in column.to_pylist()]
        return np.array(pairs, dtype=np.float64).reshape(-1, 2)
    raise StemMapError(
        path,
        f"its geometry is encoded as {encoding!r}: give a point for each tree, as WKB, such as the foot of the stem",
    )


def _system(about: Mapping[str, Any]) -> str | None:
    """The system as PROJJSON; longitude and latitude if nothing is said, and none if it is null."""
    if "crs" not in about:
        return "OGC:CRS84"
    return None if about["crs"] is None else json.dumps(about["crs"])


def _column(values: Any) -> ColumnValues:
    if str(values.type).startswith(("int", "uint", "float", "double", "halffloat")):
        numbers = [math.nan if value is None else value for value in values.to_pylist()]
        if all(value != value or abs(value) <= _EXACT for value in numbers):
            return np.array(numbers, dtype=np.float64)
    return ["" if value is None else str(value) for value in values.to_pylist()]
