"""Coordinates of a map frame as surveyors give them: their axes, their unit, and the full coordinates of the system."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction

_METRE: Final = "metre"
_AHEAD: Final = 100.0
"""Metres to a second point, which shows how two systems are rotated against each other."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameSystem:
    """The coordinate reference system of a map frame, or that it has none.

    Attributes:
        frame_id: the map frame.
        crs: its projected system; None if it has none, or one that is only a name.
        name: what was said of the system, such as `EPSG:25832`; None if nothing was.
        origin: of the frame in that system: easting and northing, metres.
        unit: the name of the system's unit; `metre` without a system.
        metres_per_unit: metres in one such unit.
    """

    frame_id: str
    crs: CRS | None
    name: str | None
    origin: tuple[float, float] = (0.0, 0.0)
    unit: str = _METRE
    metres_per_unit: float = 1.0

    @property
    def axes(self) -> tuple[str, str]:
        """What x and y of the frame are called."""
        return ("x", "y") if self.crs is None else ("east", "north")

    def full(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 2), metres, map frame, as (N, 2) full coordinates of the system, x east and y north, in its unit.

        Without a system they are those of the frame, in metres.
        """
        return np.asarray((xy + np.asarray(self.origin)) / self.metres_per_unit, dtype=np.float64)

    def point_of(self, name: str | None, point: tuple[float, float]) -> tuple[tuple[float, float], float] | None:
        """A point of the system `name`, metres, in this one, metres, without taking off the origin of the frame.

        With it comes the rotation from that system's axes to this one's there, radians, counter-clockwise: grids have
        norths of their own. If either system is not known, both are taken for the same. None if they are known to
        differ, and the point cannot be converted.
        """
        if name is None or self.name is None or name == self.name:
            return point, 0.0
        other = frame_system("", name)
        if other.crs is None or self.crs is None:
            return None
        ends = np.array([point, (point[0] + _AHEAD, point[1])]) / other.metres_per_unit
        converted = Transformer.from_crs(other.crs, self.crs, always_xy=True).transform(ends[:, 0], ends[:, 1])
        here, ahead = np.column_stack(converted) * self.metres_per_unit
        if not np.isfinite([here, ahead]).all():
            return None
        return (float(here[0]), float(here[1])), math.atan2(*(ahead - here)[::-1].tolist())


def frame_systems(
    tx: ReadTransaction, collection: CollectionRecord, frame_ids: Collection[str]
) -> dict[str, FrameSystem]:
    """The systems of map frames, by name: what the collection says, or else the stem map stored in that frame."""
    frames = tx.map_frames(collection).some(frame_ids)
    found: dict[str, FrameSystem] = {}
    for frame_id in frame_ids:
        reference = frames.get(frame_id)
        if reference is not None:
            found[frame_id] = frame_system(frame_id, reference.crs, reference.origin)
        else:
            stand = tx.stands(collection.key).get(frame_id)
            found[frame_id] = frame_system(frame_id, None if stand is None else stand.crs)
    return found


def frame_system(frame_id: str, name: str | None, origin: tuple[float, float] | None = None) -> FrameSystem:
    """The system `name` of a map frame, whose `origin` is there: easting and northing, metres; None for (0, 0)."""
    crs = None if name is None else _projected(name)
    if crs is None:
        return FrameSystem(frame_id, None, name)
    unit = crs.axis_info[0]
    return FrameSystem(frame_id, crs, name, origin or (0.0, 0.0), unit.unit_name, unit.unit_conversion_factor)


def metres_per_unit_of(name: str | None) -> float:
    """Metres in one unit of the projected system `name`; 1 if there is none, or it is only a name."""
    return frame_system("", name).metres_per_unit


@lru_cache(maxsize=64)
def _projected(name: str) -> CRS | None:
    """The projected system of that name; None if no such system is known."""
    try:
        crs = CRS.from_user_input(name).to_2d()
    except CRSError:
        return None
    return crs if crs.is_projected else None
