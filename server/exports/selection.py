"""Which rows an export has, and the one coordinate reference system that they are in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from server.collections.crud import get_collection
from server.collections.frame_systems import FrameSystem, frame_systems
from server.errors import InvalidField, NotAcceptable
from server.outputs.tables import LONGITUDE_LATITUDE
from server.store.records import CollectionRecord
from server.store.storage import Storage
from server.store.submap_records import Place, SubmapFilter
from urquhart import SE2

DEGREES: Final = FrameSystem("", CRS.from_user_input(LONGITUDE_LATITUDE), LONGITUDE_LATITUDE, unit="degree")
"""Longitude and latitude, for GeoJSON, which can hold nothing else."""
_SHOWN: Final = 6


@dataclass(frozen=True, slots=True)
class ExportChoice:
    """What to export.

    Attributes:
        chosen: the submaps.
        every: whether trees that overlapping submaps of one stand share have a row for each of these.
        in_degrees: whether positions are to be longitude and latitude.
    """

    chosen: SubmapFilter = field(default_factory=SubmapFilter)
    every: bool = False
    in_degrees: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ExportPlaces:
    """How positions of a collection's map frames become those of the export.

    Attributes:
        collection: as it was when the export began.
        systems: of the map frames, by name.
        system: of the export.
    """

    collection: CollectionRecord
    systems: Mapping[str, FrameSystem]
    system: FrameSystem

    def of_frame(self, frame_id: str, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 2), metres, map frame, as (N, 2) coordinates of the export; NaN where there are none."""
        system = self.systems.get(frame_id)
        if system is None or not len(xy):
            return np.full_like(xy, np.nan)
        full = system.full(xy)
        if self.system is not DEGREES:
            return full
        if system.crs is None:
            return np.full_like(xy, np.nan)
        degrees = np.column_stack(to_degrees(system.crs).transform(full[:, 0], full[:, 1]))
        return np.where(np.isfinite(degrees).all(axis=1, keepdims=True), degrees, np.nan)

    def of_submap(self, place: Place | None, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same of points (N, 2), metres, in the frame of a submap."""
        if place is None:
            return np.full_like(xy, np.nan)
        return self.of_frame(place.map_frame_id, SE2(place.map_x, place.map_y, place.map_yaw).apply(xy))

    def missing(self, frame_id: str | None) -> str:
        """Why a row whose submap is in this map frame has no position; None for a submap without a map pose."""
        if frame_id is None:
            return "it has no map_pose"
        system = self.systems.get(frame_id)
        if self.system is DEGREES and (system is None or system.crs is None):
            return f"the map frame {frame_id!r} has no crs: set it in the collection"
        return f"it lies outside the area of {'its system' if system is None else system.name}"


def places_of(database: Storage, collection_id: str, choice: ExportChoice) -> ExportPlaces:
    """The system of an export: that of the chosen map frames, if they have only one.

    Raises:
        NotFound: there is no such collection.
        NotAcceptable: longitude and latitude are asked for, and no map frame has a CRS.
        InvalidField: the map frames have several systems.
    """
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        one = choice.chosen.map_frame_id
        frames = [one] if one is not None else [extent.frame_id for extent in tx.collections.extents(collection.key)]
        systems = frame_systems(tx, collection, frames)
    if choice.in_degrees:
        if systems and all(system.crs is None for system in systems.values()):
            raise NotAcceptable(
                f"No map frame of the collection {collection_id!r} has a crs, so nothing in it has a longitude and "
                "latitude. Set its crs, or that of its map frames, with PATCH, or export CSV, GeoPackage or "
                "GeoParquet, which can hold a local frame.",
                ["text/csv"],
            )
        return ExportPlaces(collection, systems, DEGREES)
    kinds = _different(list(systems.values()))
    if len(kinds) > 1:
        named = ", ".join(f"{kind.frame_id!r} ({kind.name or 'local'})" for kind in kinds[:_SHOWN])
        more = f" and {len(kinds) - _SHOWN} more" if len(kinds) > _SHOWN else ""
        raise InvalidField(
            f"is needed, because one file has one coordinate reference system, and the map frames of the collection "
            f"{collection_id!r} have {len(kinds)}: {named}{more}. Choose one, or export GeoJSON, which is in longitude "
            "and latitude.",
            code="several_systems",
            parameter="frame_id",
        )
    return ExportPlaces(collection, systems, kinds[0] if kinds else FrameSystem("submap", None, None))


def _different(systems: Sequence[FrameSystem]) -> list[FrameSystem]:
    """One map frame of each system; a local frame is a system of its own. Origins do not matter."""
    kinds: list[FrameSystem] = []
    for system in systems:
        same = (kind.crs is not None and system.crs is not None and _equal(kind.crs, system.crs) for kind in kinds)
        if not any(same):
            kinds.append(system)
    return kinds


@lru_cache(maxsize=256)
def _equal(one: CRS, other: CRS) -> bool:
    return bool(one.equals(other, ignore_axis_order=True))


@lru_cache(maxsize=16)
def to_degrees(crs: CRS) -> Transformer:
    """From a projected system, east first, to longitude and latitude."""
    return Transformer.from_crs(crs, LONGITUDE_LATITUDE, always_xy=True)
