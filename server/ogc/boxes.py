"""Boxes of longitude and latitude, and which part of a map frame may lie in one."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj.enums import TransformDirection

from server.collections.frame_systems import FrameSystem
from server.errors import InvalidField
from server.exports.selection import to_degrees
from server.store.records import FrameExtent

_MARGIN: Final = 0.01
"""Share of its size by which a box is enlarged when it becomes one of a map frame, whose axes are curved there. The
rows themselves are compared with the box that was asked for."""
_METRE: Final = 1.0


@dataclass(frozen=True, slots=True)
class DegreeBox:
    """Degrees. `west` is larger than `east` for a box that crosses 180 degrees."""

    west: float
    south: float
    east: float
    north: float

    def contains(self, degrees: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of the points (N, 2), longitude first, lie inside, (N,); those that are not finite do not."""
        longitude, latitude = degrees.T
        if self.west <= self.east:
            beside = (longitude >= self.west) & (longitude <= self.east)
        else:
            beside = (longitude >= self.west) | (longitude <= self.east)
        return np.asarray(beside & (latitude >= self.south) & (latitude <= self.north))

    def touches(self, outline: NDArray[np.float64]) -> bool:
        """Whether a convex polygon (K, 2), longitude first, has a point in common with the box."""
        return any(_overlap(outline, part) for part in self.parts())

    def parts(self) -> list[tuple[float, float, float, float]]:
        """The box as west, south, east, north; as two of these if it crosses 180 degrees."""
        if self.west <= self.east:
            return [(self.west, self.south, self.east, self.north)]
        return [(self.west, self.south, 180.0, self.north), (-180.0, self.south, self.east, self.north)]


def read_box(text: str | None) -> DegreeBox | None:
    """The box of the parameter `bbox`: four numbers, or six with heights, which do not count. Raises InvalidField."""
    if text is None:
        return None
    try:
        values = () if "_" in text else tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) == 6:
        values = (values[0], values[1], values[3], values[4])
    is_box = len(values) == 4 and bool(np.isfinite(values).all())
    if not is_box or not -90.0 <= values[1] <= values[3] <= 90.0 or max(abs(values[0]), abs(values[2])) > 180.0:
        raise InvalidField(
            "must be min longitude,min latitude,max longitude,max latitude in degrees, latitudes in order and from -90 "
            "to 90, longitudes from -180 to 180",
            code="bbox",
            parameter="bbox",
        )
    return DegreeBox(*values)


def degrees_of(system: FrameSystem, extent: FrameExtent) -> tuple[float, float, float, float] | None:
    """What a map frame covers, as west, south, east, north; None if that is not known."""
    if system.crs is None:
        return None
    (min_x, min_y), (max_x, max_y) = system.full(
        np.array([[extent.min_x, extent.min_y], [extent.max_x, extent.max_y]])
    ).tolist()
    found = to_degrees(system.crs).transform_bounds(min_x, min_y, max_x, max_y, densify_pts=11)
    return found if np.isfinite(found).all() else None


def frame_box(system: FrameSystem, extent: FrameExtent, box: DegreeBox) -> tuple[float, float, float, float] | None:
    """A box of a map frame, metres, outside of which nothing of the frame lies in `box`; None if nothing does.

    Only what the frame covers is converted, because far from there the conversion means nothing.
    """
    covered = degrees_of(system, extent)
    everything = (extent.min_x, extent.min_y, extent.max_x, extent.max_y)
    if system.crs is None:
        return None
    if covered is None or covered[0] > covered[2]:
        return everything
    found = []
    for west, south, east, north in box.parts():
        part = (max(west, covered[0]), max(south, covered[1]), min(east, covered[2]), min(north, covered[3]))
        if part[0] <= part[2] and part[1] <= part[3]:
            found.append(
                to_degrees(system.crs).transform_bounds(*part, densify_pts=11, direction=TransformDirection.INVERSE)
            )
    if not found:
        return None
    bounds = np.array(found)
    if not np.isfinite(bounds).all():
        return everything
    corners = np.array([bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)]) * system.metres_per_unit
    corners -= np.asarray(system.origin)
    margin = _MARGIN * (corners[1] - corners[0]) + _METRE
    (min_x, min_y), (max_x, max_y) = (corners + np.array([-margin, margin])).tolist()
    return min_x, min_y, max_x, max_y


def _overlap(outline: NDArray[np.float64], part: tuple[float, float, float, float]) -> bool:
    """Whether a convex polygon and a box overlap: no edge of either has all of the other on its far side."""
    west, south, east, north = part
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    edges = np.roll(outline, -1, axis=0) - outline
    axes = np.vstack([[[1.0, 0.0], [0.0, 1.0]], np.column_stack([-edges[:, 1], edges[:, 0]])])
    one, other = outline @ axes.T, corners @ axes.T
    return bool(((one.max(axis=0) >= other.min(axis=0)) & (other.max(axis=0) >= one.min(axis=0))).all())
