"""Tables as GeoJSON (RFC 7946): features in longitude and latitude."""

from collections.abc import Iterable, Iterator
from datetime import datetime
from functools import lru_cache
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from server.outputs.tables import LONGITUDE_LATITUDE, OutputLayer, OutputRows, ShapeKind, written_time

_DECIMALS: Final = 9
"""Of degrees: a tenth of a millimetre."""


def geojson_pieces(layer: OutputLayer, batches: Iterable[OutputRows]) -> Iterator[bytes]:
    """A FeatureCollection. Its features have no geometry in a local frame, and `no_geometry` says why."""
    yield b'{"type":"FeatureCollection","name":' + orjson.dumps(layer.name) + b',"features":['
    separator = b""
    for rows in batches:
        features = features_of(layer, rows)
        if features:
            yield separator + b",\n".join(map(orjson.dumps, features))
            separator = b",\n"
    yield b"]}\n"


def features_of(layer: OutputLayer, rows: OutputRows) -> list[dict[str, Any]]:
    """The rows as GeoJSON features without `id`."""
    names = [column.name for column in layer.columns]
    geometries = _geometries(layer, rows)
    columns = [[_plain(value) for value in values] for values in rows.values]
    features = []
    reasons = rows.why or [_why(layer)] * len(rows)
    for geometry, values, why in zip(geometries, zip(*columns, strict=True), reasons, strict=True):
        properties = dict(zip(names, values, strict=True))
        if geometry is None:
            properties["no_geometry"] = why
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    return features


def _why(layer: OutputLayer) -> str:
    frame = layer.system.frame_id
    if layer.system.crs is None:
        return f"the map frame {frame!r} has no crs: set it in the collection" if frame else "it has no map_pose"
    return "it has no place in its map frame"


def _geometries(layer: OutputLayer, rows: OutputRows) -> list[dict[str, Any] | None]:
    if layer.system.crs is None:
        return [None] * len(rows)
    if layer.shape == "Point":
        degrees = _degrees(layer.system.crs, rows.xy)
        finite = np.asarray(np.isfinite(degrees).all(axis=1), dtype=np.bool_).tolist()
        pairs = zip(degrees.tolist(), finite, strict=True)
        return [{"type": "Point", "coordinates": pair} if here else None for pair, here in pairs]
    return [None if path is None else _path(layer.system.crs, layer.shape, path) for path in rows.paths]


def _path(crs: CRS, shape: ShapeKind, path: NDArray[np.float64]) -> dict[str, Any] | None:
    degrees = _degrees(crs, path)
    if not np.isfinite(degrees).all():
        return None
    if shape == "LineString":
        return {"type": shape, "coordinates": degrees.tolist()}
    x, y = degrees.T
    is_clockwise = float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0
    ring = (degrees[::-1] if is_clockwise else degrees).tolist()
    return {"type": shape, "coordinates": [[*ring, ring[0]]]}


def _degrees(crs: CRS, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longitude and latitude (N, 2), rounded; not finite where a point has none."""
    if not len(xy):
        return xy
    return np.round(np.column_stack(_transformer(crs).transform(xy[:, 0], xy[:, 1])), _DECIMALS)


@lru_cache(maxsize=16)
def _transformer(crs: CRS) -> Transformer:
    return Transformer.from_crs(crs, LONGITUDE_LATITUDE, always_xy=True)


def _plain(value: Any) -> Any:
    if isinstance(value, datetime):
        return written_time(value)
    return None if isinstance(value, float) and not np.isfinite(value) else value
