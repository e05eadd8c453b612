"""Coordinate reference systems: map poses to longitude and latitude, as RFC 7946 wants them."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from server.errors import InvalidField, NotAcceptable
from server.store.submaps import Place
from server.store.tables import CollectionRow
from urquhart import SE2

_DECIMALS = 8  # about a millimetre


def check_crs(name: str) -> None:
    """Raise InvalidField unless `name` is a projected coordinate reference system in metres."""
    try:
        crs = CRS.from_user_input(name)
    except CRSError as error:
        raise InvalidField(
            "is not a coordinate reference system that is known; give an authority code such as 'EPSG:32633'",
            code="crs",
            pointer="/crs",
        ) from error
    if not crs.is_projected or any(axis.unit_conversion_factor != 1.0 for axis in crs.axis_info[:2]):
        raise InvalidField(
            f"must be a projected system in metres, as map poses are; {crs.name} is not. "
            "Take the UTM zone or the national grid.",
            code="crs",
            pointer="/crs",
        )


class Georeference:
    """From a collection's submap frames to longitude and latitude."""

    def __init__(self, collection: CollectionRow, otherwise: Sequence[str]) -> None:
        """`otherwise` are the media types that do without. Raises NotAcceptable for a collection without CRS."""
        self._otherwise = otherwise
        if collection.crs is None:
            raise NotAcceptable(
                f"The collection {collection.id!r} has no crs, so its submaps have no longitude and latitude. "
                "Set one by PATCH, or ask for application/json.",
                otherwise,
            )
        self._to_wgs84 = _transformer(collection.crs)
        self._origin = np.array([collection.origin_x or 0.0, collection.origin_y or 0.0])

    def lonlat(self, place: Place, xy: NDArray[np.float64]) -> list[list[float]]:
        """Longitude and latitude in degrees of points (N, 2) float64, metres, submap frame."""
        east_north = SE2(place.map_x, place.map_y, place.map_yaw).apply(xy) + self._origin
        lon, lat = self._to_wgs84.transform(east_north[:, 0], east_north[:, 1])
        if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
            raise NotAcceptable(
                "Some submaps lie outside what the collection's crs covers; check crs, origin and map poses, "
                "or ask for application/json.",
                self._otherwise,
            )
        return [[round(float(x), _DECIMALS), round(float(y), _DECIMALS)] for x, y in zip(lon, lat, strict=True)]

    def footprint(self, place: Place, xy: NDArray[np.float64]) -> dict[str, Any]:
        """GeoJSON polygon: the convex hull of the landmarks (N, 2) float64, metres, submap frame."""
        from scipy.spatial import ConvexHull

        return polygon(self.lonlat(place, xy[ConvexHull(xy).vertices]))


def polygon(ring: list[list[float]]) -> dict[str, Any]:
    """GeoJSON polygon of an open ring; its outside is wound counter-clockwise."""
    doubled_area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True))
    ring = ring if doubled_area >= 0 else ring[::-1]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


@lru_cache(maxsize=64)
def _transformer(crs: str) -> Transformer:
    return Transformer.from_crs(crs, "OGC:CRS84", always_xy=True)
