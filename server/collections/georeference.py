"""Coordinate reference systems: from map frames to longitude and latitude, as in RFC 7946."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Proj, Transformer
from pyproj.enums import TransformDirection
from pyproj.exceptions import CRSError, ProjError

from server.collections.hulls import hull_of
from server.errors import InvalidField
from server.store.records import FrameReference
from server.store.submap_records import Place
from urquhart import SE2

_DECIMALS: Final = 8  # about a millimetre
_TOLERANCE: Final = 1.0
"""Degrees that a place may be outside of a system's area of use, because maps do not end at the border of a UTM
zone.
"""
_DISTORTION: Final = 1.1
"""Largest scale, or its inverse, of a system for submaps, whose metres are metres on the ground.

National grids stay within 1.05 in their area of use; Web Mercator (EPSG:3857) reaches 1.41 at 45 degrees north.
"""
_THERE_AND_BACK: Final = 1.0
"""Metres within which a place must convert back to its coordinates, if the system has no known area of use."""
_DATUM: Final = 5.0
"""Accuracy in metres that is assumed for a conversion between two systems if none is known."""
_AHEAD: Final = 100.0
"""Distance in metres to a second point, which shows how two systems are rotated against each other."""


def check_crs(name: str, pointer: str = "/crs") -> None:
    """Raise InvalidField unless the system `name` is projected, in metres, and true to scale in its area of use."""
    try:
        crs = _crs(name)
    except CRSError as error:
        raise InvalidField(
            "is not a known coordinate reference system; give an authority code such as 'EPSG:32633'",
            code="crs",
            pointer=pointer,
        ) from error
    fault = _fault(crs)
    if fault is not None:
        raise InvalidField(
            f"must be a projected system in metres, like map poses; {crs.name} {fault}. Use the UTM zone of the place, "
            "such as 'EPSG:32633', or the national grid.",
            code="crs",
            pointer=pointer,
        )


def _fault(crs: CRS) -> str | None:
    """Why map poses cannot be given in a system; None if they can."""
    if crs.is_geographic:
        return "gives degrees"
    if not crs.is_projected:
        return "is not projected"
    units = sorted({axis.unit_name for axis in crs.axis_info if axis.unit_conversion_factor != 1.0})
    if units:
        return f"is in {' and '.join(units)}"
    if {axis.direction.lower() for axis in crs.axis_info} != {"east", "north"}:
        directions = " and ".join(axis.direction for axis in crs.axis_info)
        return f"has axes that point {directions}, where x is east and y north"
    scale = _largest_scale(crs)
    if scale > _DISTORTION:
        return f"is not true to scale: within its area of use a metre on the ground becomes up to {scale:.3g} m"
    return None


def _largest_scale(crs: CRS) -> float:
    """The largest scale error in the area of use, as a factor of 1 or more; 1 if it is unknown."""
    area = crs.area_of_use
    if area is None:
        return 1.0
    width = (area.east - area.west) % 360.0 or 360.0
    middle = (area.south + area.north) / 2
    largest = 1.0
    for lon in (area.west, area.west + width / 2, area.west + width):
        for lat in (area.south, (area.south + middle) / 2, middle, (middle + area.north) / 2, area.north):
            largest = max(largest, _scale_at(crs, lon, lat))
    return largest


def _scale_at(crs: CRS, lon: float, lat: float) -> float:
    try:
        factors = Proj(crs).get_factors((lon + 180.0) % 360.0 - 180.0, lat)
    except ProjError:
        return 1.0  # a corner of the box may be outside of the system
    scales = np.array([factors.meridional_scale, factors.parallel_scale])
    if not np.isfinite(scales).all() or (scales <= 0).any():
        return 1.0
    return float(np.maximum(scales, 1.0 / scales).max())


@dataclass(frozen=True, slots=True)
class Crossing:
    """The transform between two map frames, valid near one point.

    Attributes:
        transform: frame_T_other, rigid, metres and radians.
        sigma: of the step between the systems, metres: 0 where both have the same datum.
    """

    transform: SE2
    sigma: float


class Georeference:
    """The conversion from one map frame to longitude and latitude."""

    def __init__(self, reference: FrameReference) -> None:
        self._name = reference.crs
        self.crs = _crs(reference.crs)
        self._to_wgs84 = _transformer(reference.crs, "OGC:CRS84")
        self._origin = np.array(reference.origin or (0.0, 0.0))

    def lonlat(self, place: Place, xy: NDArray[np.float64]) -> list[list[float]] | None:
        """Longitude and latitude in degrees of points (N, 2) float64, metres, submap frame.

        None if they are outside of the system's area of use.
        """
        map_xy = SE2(place.map_x, place.map_y, place.map_yaw).apply(xy)
        degrees = self._degrees(map_xy)
        if not self._reaches(map_xy, degrees):
            return None
        return [[round(lon, _DECIMALS), round(lat, _DECIMALS)] for lon, lat in degrees.tolist()]

    def footprint(self, place: Place, xy: NDArray[np.float64]) -> dict[str, Any] | None:
        """GeoJSON polygon of the convex hull of the landmarks (N, 2) float64, metres, submap frame.

        A line or point if they span no area, the frame's origin if there are none; None if they are outside of the
        system's area of use.
        """
        xy = xy if len(xy) else np.zeros((1, 2))
        hull = hull_of(xy)
        if hull is None:
            points = self.lonlat(place, xy)
            return {"type": "MultiPoint", "coordinates": points} if points else None
        ring = self.lonlat(place, hull)
        return polygon(ring) if ring else None

    def latitude(self, x: float, y: float) -> float | None:
        """Latitude in degrees of a point of the map frame, metres; None if it has none."""
        degrees = float(self._degrees(np.array([[x, y]]))[0, 1])
        return degrees if np.isfinite(degrees) else None

    def fault(self, x: float, y: float) -> str | None:
        """What is wrong with a point of the map frame, metres; None if it is inside of the system's area."""
        map_xy = np.array([[x, y]])
        degrees = self._degrees(map_xy)
        area, reaches = self.crs.area_of_use, self._reaches(map_xy, degrees)
        if not np.isfinite(degrees).all() or (area is None and not reaches):
            return f"nowhere on Earth in {self.crs.name}"
        lon, lat = degrees[0].tolist()
        where = f"{abs(lon):.2f} {'E' if lon >= 0 else 'W'}, {abs(lat):.2f} {'N' if lat >= 0 else 'S'}"
        if area is not None and not reaches:
            return (
                f"at {where}, outside the area of use of {self.crs.name} "
                f"({area.west:g} to {area.east:g} degrees east, {area.south:g} to {area.north:g} north)"
            )
        scale = _scale_at(self.crs, lon, lat)
        if scale > _DISTORTION:
            return f"at {where}, where a metre on the ground is off by a factor of {scale:.3g} in {self.crs.name}"
        return None

    def crossing(self, other: "Georeference", x: float, y: float) -> Crossing | None:
        """The transform from another map frame to this one about its point (`x`, `y`); None if this one does not reach
        there.

        The metres of the two systems may differ by a fraction of a thousandth, and their north by some degrees.
        """
        transformer = _transformer(other._name, self._name)
        ends = np.array([[x, y], [x + _AHEAD, y]])
        east, north = (ends + other._origin).T
        here, ahead = np.column_stack(transformer.transform(east, north)) - self._origin
        if not np.isfinite([here, ahead]).all():
            return None
        turn = SE2(0.0, 0.0, math.atan2(*(ahead - here)[::-1].tolist()))
        frame_T_other = SE2.shift(here) @ turn @ SE2(-x, -y, 0.0)
        return Crossing(frame_T_other, transformer.accuracy if transformer.accuracy >= 0 else _DATUM)

    def _degrees(self, map_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        east, north = (map_xy + self._origin).T
        return np.column_stack(self._to_wgs84.transform(east, north))

    def _reaches(self, map_xy: NDArray[np.float64], degrees: NDArray[np.float64]) -> bool:
        """Whether all points (N, 2), metres, map frame, at these degrees (N, 2), are inside of the system's area."""
        if not np.isfinite(degrees).all():
            return False
        area = self.crs.area_of_use
        if area is None:  # a place is then valid if it converts back to its coordinates
            back = self._to_wgs84.transform(degrees[:, 0], degrees[:, 1], direction=TransformDirection.INVERSE)
            return bool(np.all(np.hypot(*(np.column_stack(back) - map_xy - self._origin).T) <= _THERE_AND_BACK))
        width = (area.east - area.west) % 360.0 or 360.0
        east_of_west = (degrees[:, 0] - area.west + _TOLERANCE) % 360.0
        north_of_south = degrees[:, 1] - area.south + _TOLERANCE
        height = area.north - area.south + 2 * _TOLERANCE
        inside = (east_of_west <= width + 2 * _TOLERANCE) & (north_of_south >= 0.0) & (north_of_south <= height)
        return bool(inside.all())


def check_place(place: Place | None, reference: FrameReference | None) -> None:
    """Raise InvalidField if a map pose puts a submap outside of the area of the map frame's system."""
    if place is None or reference is None:
        return
    fault = Georeference(reference).fault(*centre(place))
    if fault is not None:
        raise InvalidField(
            f"puts the submap of the map frame {place.map_frame_id!r} {fault}; check the pose, and the frame's crs and "
            "origin. If poses are in full coordinates of the system, leave out the origin.",
            code="map_pose",
            pointer="/map_pose",
        )


def centre(place: Place) -> tuple[float, float]:
    """The middle of a submap's footprint, metres, map frame."""
    return (place.map_min_x + place.map_max_x) / 2, (place.map_min_y + place.map_max_y) / 2


def polygon(ring: list[list[float]]) -> dict[str, Any]:
    """GeoJSON polygon of an open ring. Its outline is counter-clockwise."""
    doubled_area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True))
    ring = ring if doubled_area >= 0 else ring[::-1]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


@lru_cache(maxsize=64)
def _crs(name: str) -> CRS:
    """The horizontal part of a system. Heights do not matter for a map, and a compound system has no area of use."""
    return CRS.from_user_input(name).to_2d()


@lru_cache(maxsize=64)
def _transformer(source: str, target: str) -> Transformer:
    return Transformer.from_crs(_crs(source), _crs(target), always_xy=True)
