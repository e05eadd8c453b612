"""Footprints of submaps in longitude and latitude, by the CRS of each one's map frame, or why there is none."""

from typing import Any

from server.collections.georeference import Georeference
from server.errors import NotAcceptable
from server.store.codec import unpack_positions
from server.store.records import DEFAULT_FRAME, CollectionRecord, FrameReference
from server.store.storage import Storage
from server.store.submap_records import SubmapContent


def references_of(database: Storage, collection: CollectionRecord, frame_ids: set[str]) -> dict[str, FrameReference]:
    """Where map frames are on Earth. Raises NotAcceptable if no frame of the collection has a CRS."""
    with database.read() as tx:
        frames = tx.map_frames(collection)
        if not frames.any():
            raise NotAcceptable(
                f"The collection {collection.id!r} has no crs, so its submaps have no longitude and latitude. Set its "
                "crs, or that of its map frames, with PATCH, or ask for application/json.",
                ["application/json"],
            )
        return frames.some(frame_ids)


def geometry_of(row: SubmapContent, references: dict[str, FrameReference]) -> tuple[dict[str, Any] | None, str | None]:
    """A submap's footprint, or why it has none."""
    place = row.place
    if place is None:
        return None, "it has no map_pose"
    reference = references.get(place.map_frame_id)
    if reference is None:
        return None, without_crs(place.map_frame_id)
    footprint = Georeference(reference).footprint(place, unpack_positions(row.landmarks))
    return footprint, None if footprint is not None else outside(place.map_frame_id, reference)


def without_crs(frame_id: str) -> str:
    """Why nothing in a map frame has a longitude and latitude."""
    where = "crs" if frame_id == DEFAULT_FRAME else "frames"
    return f"the map frame {frame_id!r} has no crs: set it in the collection's {where}"


def outside(frame_id: str, reference: FrameReference) -> str:
    """Why something has no longitude and latitude although its map frame has a CRS."""
    return f"it lies outside the area of use of {reference.crs}, the crs of the map frame {frame_id!r}"
