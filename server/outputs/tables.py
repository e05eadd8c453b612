"""What the writers write: columns, places, and the coordinate reference system that these are in."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import chain
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from server.collections.frame_systems import FrameSystem, frame_system

ColumnKind = Literal["text", "real", "integer", "boolean", "time"]
ShapeKind = Literal["Point", "Polygon", "LineString"]

LONGITUDE_LATITUDE: Final = "OGC:CRS84"
"""The system of GeoJSON: longitude first, in degrees."""


@dataclass(frozen=True, slots=True)
class OutputColumn:
    """A column: text, float64, int64, a truth value, or a time in UTC. Each may lack values."""

    name: str
    kind: ColumnKind


@dataclass(frozen=True, slots=True)
class OutputLayer:
    """A table of one kind of shape, all in one coordinate reference system.

    Attributes:
        name: of the layer, and of the system if it is a local one.
        columns: in the order in which they are written.
        system: of the positions. Without a CRS, positions are metres in a local frame, which becomes an engineering
            CRS with the frame's name.
        shape: what lies at each row.
        leading: number of columns that CSV has before x and y.
    """

    name: str
    columns: tuple[OutputColumn, ...]
    system: FrameSystem
    shape: ShapeKind = "Point"
    leading: int = 1

    @property
    def crs(self) -> CRS:
        """The system of the positions: east first, in its own unit; an engineering CRS for a local frame."""
        return local_system(self.system.frame_id) if self.system.crs is None else self.system.crs


@dataclass(frozen=True, slots=True)
class OutputRows:
    """Some rows of a layer.

    Attributes:
        values: for each column of the layer, in its order, N values (str, float, int, bool or datetime), None if
            missing.
        xy: (N, 2) float64, full coordinates of the layer's system, x (east) first: the points, or a point in each
            shape. NaN where a row has no place.
        paths: for lines and polygons, the vertices of each, (K, 2) float64, in the same coordinates; polygons are not
            closed. None where a row has no place.
        why: for each row without a place, why it has none, in words; empty if all rows have one.
    """

    values: Sequence[Sequence[Any]]
    xy: NDArray[np.float64]
    paths: Sequence[NDArray[np.float64] | None] = field(default_factory=tuple)
    why: Sequence[str] = field(default_factory=tuple)

    def __len__(self) -> int:
        return len(self.xy)

    @staticmethod
    def joined(batches: "Sequence[OutputRows]") -> "OutputRows":
        """The rows of several batches of one layer, at least one."""
        if len(batches) == 1:
            return batches[0]
        values = [list(chain.from_iterable(columns)) for columns in zip(*(one.values for one in batches), strict=True)]
        paths = [path for one in batches for path in one.paths]
        has_reasons = any(one.why for one in batches)
        why = [text for one in batches for text in (one.why or [""] * len(one))] if has_reasons else ()
        return OutputRows(values, np.concatenate([one.xy for one in batches]), paths, why)


def no_rows(layer: OutputLayer) -> OutputRows:
    """A batch without rows, with which a writer creates a layer that will stay empty."""
    return OutputRows([[] for _ in layer.columns], np.empty((0, 2)))


def local_system(frame_id: str) -> CRS:
    """An engineering CRS for a frame that nobody has placed on Earth: metres, x and y, named after the frame."""
    name = (frame_id or "submap").replace('"', '""')
    return CRS.from_wkt(
        f'ENGCRS["{name} (local frame)",EDATUM["{name}"],CS[Cartesian,2],AXIS["x",unspecified,ORDER[1]],'
        'AXIS["y",unspecified,ORDER[2]],LENGTHUNIT["metre",1]]'
    )


def known_system(crs: str | None, frame_id: str = "map") -> FrameSystem:
    """The system of positions in `crs`, such as `EPSG:25832`, or of a local frame with this name."""
    return frame_system(frame_id, crs)


def well_known_binary(layer: OutputLayer, rows: OutputRows) -> list[bytes | None]:
    """The shapes as well-known binary, little-endian; None where a row has no place."""
    if layer.shape == "Point":
        finite = np.asarray(np.isfinite(rows.xy).all(axis=1), dtype=np.bool_).tolist()
        return [
            struct.pack("<BIdd", 1, 1, x, y) if here else None
            for (x, y), here in zip(rows.xy.tolist(), finite, strict=True)
        ]
    return [None if path is None else _path_binary(layer.shape, path) for path in rows.paths]


def _path_binary(shape: ShapeKind, path: NDArray[np.float64]) -> bytes:
    """A line or a polygon with one ring, which is closed here."""
    if shape == "LineString":
        return struct.pack("<BII", 1, 2, len(path)) + np.ascontiguousarray(path, "<f8").tobytes()
    ring = np.ascontiguousarray(np.vstack([path, path[:1]]), "<f8")
    return struct.pack("<BIII", 1, 3, 1, len(ring)) + ring.tobytes()


def bounds_of(layer: OutputLayer, rows: OutputRows) -> NDArray[np.float64]:
    """The box (4,) of the shapes: min x, min y, max x, max y; infinite the other way round if there are none."""
    paths = [path for path in rows.paths if path is not None]
    points = rows.xy if layer.shape == "Point" else np.vstack(paths) if paths else np.empty((0, 2))
    known = points[np.isfinite(points).all(axis=1)]
    if not len(known):
        return np.array([np.inf, np.inf, -np.inf, -np.inf])
    return np.concatenate([known.min(axis=0), known.max(axis=0)])


def written_time(value: datetime) -> str:
    """A time as text: RFC 3339 in UTC."""
    return value.isoformat().replace("+00:00", "Z")
