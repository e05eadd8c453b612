"""The coordinate reference systems of a collection's maps, so that results stand in the coordinates of the maps' files.

A map frame's own reference counts first; else the system of the file that `urquhart index` stored as a stand.
"""

from dataclasses import dataclass

from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction


@dataclass(frozen=True, slots=True)
class MapSystem:
    """The system of one map frame: its code or name, None if not known; and what to add to coordinates, metres."""

    crs: str | None = None
    origin: tuple[float, float] = (0.0, 0.0)


def map_system(tx: ReadTransaction, collection: CollectionRecord, frame_id: str) -> MapSystem:
    """The system of the map `frame_id`."""
    reference = tx.map_frames(collection).some([frame_id]).get(frame_id)
    if reference is not None:
        return MapSystem(reference.crs, reference.origin or (0.0, 0.0))
    stands = tx.stands(collection.key).page()
    return MapSystem(next((stand.crs for stand in stands if stand.frame_id == frame_id), None))
