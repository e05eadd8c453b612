"""GIS files through GDAL: GeoPackage, Shapefile, FlatGeobuf, GeoJSON, KML and GPX."""

import json
import struct
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.extras import import_extra
from server.stem_maps.formats.table import BadRow, ColumnValues, FileTable, StemMapError, check_width


@dataclass(frozen=True, slots=True)
class VectorFormat:
    """A format that GDAL reads: its driver, its name in a sentence, and what its files begin with."""

    driver: str
    name: str
    beginnings: tuple[bytes, ...]


VECTOR_FORMATS: Final = {
    ".gpkg": VectorFormat("GPKG", "GeoPackage", (b"SQLite format 3",)),
    ".shp": VectorFormat("ESRI Shapefile", "Shapefile", (b"\x00\x00\x27\x0a",)),
    ".fgb": VectorFormat("FlatGeobuf", "FlatGeobuf", (b"fgb",)),
    ".geojson": VectorFormat("GeoJSON", "GeoJSON", (b"{",)),
    ".json": VectorFormat("GeoJSON", "GeoJSON", (b"{",)),
    ".parquet": VectorFormat("Parquet", "GeoParquet", (b"PAR1",)),
    ".kml": VectorFormat("KML", "KML", (b"<",)),
    ".gpx": VectorFormat("GPX", "GPX", (b"<",)),
}
"""By the suffix of the file. A file must begin as its format does, so that GDAL never opens what it was not given."""
_EXACT: Final = 2**53
"""Whole numbers up to this are float64 numbers, too."""
_SHOWN: Final = 12


def read_vector(path: Path, layer: str | None) -> FileTable:
    """The features of one layer: points, and their attributes as columns.

    Raises:
        StemMapError: the file is damaged, has several layers and none is named, or its geometries are not points.
    """
    kind = check_beginning(path)
    gdal = import_extra(path, "gis", "pyogrio")
    raw = import_extra(path, "gis", "pyogrio.raw")
    if kind.driver not in gdal.list_drivers(read=True):
        raise StemMapError(
            path, f"the GDAL of the package pyogrio reads no {kind.name} files: write it as a GeoPackage"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL's hints, such as a measure that is left out
        try:
            chosen = _layer(path, gdal, layer)
            meta, _, geometry, values = raw.read(path, layer=chosen, force_2d=True)
        except StemMapError:
            raise
        except (RuntimeError, ValueError, OSError) as error:
            raise StemMapError(path, _damaged(path, kind)) from error
    table = _table(path, meta, values, {"id"} if kind.driver == "KML" else set())
    if geometry is not None and meta.get("geometry_type") is not None:
        table.xy = points_of(path, geometry, table)
        table.crs = meta.get("crs")
        if kind.driver == "GeoJSON" and table.crs == "EPSG:4326" and not _may_be_degrees(table.xy):
            table.crs = None  # GDAL's answer for a file that names no system, which must be degrees by the standard
            table.notes.append("positions are no degrees, so the system of the file is not known")
    table.notes.append(f"{kind.name}{f', layer {chosen!r}' if layer else ''}")
    return table


def _damaged(path: Path, kind: VectorFormat) -> str:
    """Why GDAL cannot read a file, in one sentence without its own words, which name neither the place nor a remedy."""
    if kind.driver == "GeoJSON":
        try:
            json.loads(path.read_bytes().decode("utf-8-sig"))
        except UnicodeDecodeError:
            return "is not GeoJSON, because it is not text in UTF-8: write it again in UTF-8"
        except (json.JSONDecodeError, RecursionError) as error:
            where = f" from line {error.lineno}, column {error.colno} on" if isinstance(error, ValueError) else ""
            return f"is not JSON{where}: it is cut off or was changed by hand; write it again"
        return "is JSON, but not a collection of features as GeoJSON has: write it again, for instance as a GeoPackage"
    if kind.driver == "ESRI Shapefile":
        beside = [path.with_suffix(end) for end in (".shx", ".dbf")]
        missing = [one.name for one in beside if not one.exists() and not one.with_suffix(one.suffix.upper()).exists()]
        if missing:
            return f"a Shapefile needs {' and '.join(missing)} beside it: copy all files of that name"
    return f"is damaged or cut off, and cannot be read as {kind.name}: copy it again, or write it again"


def check_beginning(path: Path) -> VectorFormat:
    """The format that the suffix of a file says. Raises StemMapError if the file does not begin as that does."""
    kind = VECTOR_FORMATS[path.suffix.lower()]
    with path.open("rb") as file:
        beginning = file.read(512).removeprefix(b"\xef\xbb\xbf").lstrip()
    if not beginning.startswith(kind.beginnings):
        what = "is empty" if not beginning else f"is no {kind.name} file, although its suffix is {path.suffix}"
        raise StemMapError(path, what)
    return kind


def _layer(path: Path, gdal: Any, wanted: str | None) -> str:
    """The name of the layer to read."""
    layers = [(str(name), str(geometry)) for name, geometry in gdal.list_layers(path).tolist()]
    names = [name for name, _ in layers]
    if wanted is not None:
        if wanted not in names:
            raise StemMapError(path, f"has no layer {wanted!r}: there are {_listed(names)}")
        return wanted
    filled = [name for name in names if gdal.read_info(path, layer=name, force_feature_count=True)["features"] > 0]
    if len(filled) > 1:
        raise StemMapError(path, f"has {len(filled)} layers, {_listed(filled)}: choose one with --layer")
    if not names:
        raise StemMapError(path, "has no layer")
    return (filled or names)[0]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(map(repr, names[:_SHOWN])) + more


def _table(path: Path, meta: dict[str, Any], values: Sequence[NDArray[Any]], left_out: set[str]) -> FileTable:
    """The attributes, without those that the driver makes up."""
    check_width(path, len(values))
    fields = [(str(name), one) for name, one in zip(meta["fields"], values, strict=True) if str(name) not in left_out]
    columns = [_column(one) for _, one in fields]
    count = len(columns[0]) if columns else 0
    return FileTable(path, [name for name, _ in fields], columns, np.arange(1, count + 1))


def _column(values: NDArray[Any]) -> ColumnValues:
    if values.dtype.kind in "iu" and (not len(values) or max(-int(values.min()), int(values.max())) <= _EXACT):
        return values.astype(np.float64)
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return ["" if value is None else str(value) for value in values.tolist()]


def points_of(path: Path, geometry: NDArray[Any], table: FileTable) -> NDArray[np.float64]:
    """Positions (N, 2) float64 of well-known binary points; rows without one become `bad_rows`."""
    if len(table.lines) != len(geometry):
        table.lines = np.arange(1, len(geometry) + 1)
    xy = np.full((len(geometry), 2), np.nan)
    for row, shape in enumerate(geometry):
        if shape is None:
            table.bad_rows.append(BadRow(row + 1, "", "the feature has no geometry"))
            continue
        kind, found = _point(shape)
        if kind not in (1, 4):
            raise StemMapError(
                path,
                f"feature {row + 1} is a {_KINDS.get(kind, 'shape')} and not a point: give a point for each tree, such "
                "as the centroid of a crown or the foot of the stem",
                row + 1,
            )
        if found is None:
            table.bad_rows.append(BadRow(row + 1, "", "the feature has not exactly one point"))
        else:
            xy[row] = found
    return xy


def _may_be_degrees(xy: NDArray[np.float64]) -> bool:
    largest = np.abs(xy[np.isfinite(xy).all(axis=1)]).max(axis=0, initial=0.0)
    return bool(largest[0] <= 360.0 and largest[1] <= 90.0)


_KINDS: Final = {2: "line", 3: "polygon", 5: "set of lines", 6: "set of polygons", 7: "collection of shapes"}


def _point(shape: bytes) -> tuple[int, tuple[float, float] | None]:
    """The type number of a shape in well-known binary, and its position if it is one point."""
    order = "<" if shape[0] == 1 else ">"
    kind = struct.unpack_from(f"{order}I", shape, 1)[0] & 0xFF
    if kind == 4:
        if struct.unpack_from(f"{order}I", shape, 5)[0] != 1:
            return kind, None
        return kind, _point(shape[9:])[1]
    if kind != 1:
        return kind, None
    x, y = struct.unpack_from(f"{order}dd", shape, 5)
    return kind, (x, y) if np.isfinite((x, y)).all() else None
