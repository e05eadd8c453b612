"""Where a collection's map frames are on Earth. Changes are checked against the submaps in the frame."""

from collections.abc import Mapping

from server.collections.georeference import Georeference, check_crs
from server.errors import Conflict, InvalidField
from server.schemas.collections import MapFrame
from server.store.records import DEFAULT_FRAME, CollectionRecord, FrameReference
from server.store.repositories.map_frames import MapFrameReader
from server.store.storage import ReadTransaction, WriteTransaction


def check_frames(frames: Mapping[str, MapFrame | None] | None) -> None:
    """Raise InvalidField for a frame whose CRS cannot be used, and for the default frame, which is set elsewhere."""
    for frame_id, frame in (frames or {}).items():
        if frame_id == DEFAULT_FRAME:
            raise InvalidField(
                f"must not name {DEFAULT_FRAME!r}: set the collection's own `crs` and `origin` instead",
                code="frames",
                pointer=_pointer(frame_id),
            )
        if frame is not None:
            check_crs(frame.crs, f"{_pointer(frame_id)}/crs")


def must_agree(tx: ReadTransaction, row: CollectionRecord, frames: Mapping[str, MapFrame] | None) -> None:
    """Raise Conflict if one of the frames differs from that of the collection."""
    known = tx.map_frames(row).some(list(frames or {}))
    for frame_id, frame in (frames or {}).items():
        if known.get(frame_id) != _reference(frame):
            raise Conflict(
                f"The collection {row.id!r} exists, with another crs or origin for the map frame {frame_id!r}. Change "
                "it with PATCH."
            )


def set_frames(tx: WriteTransaction, row: CollectionRecord, frames: Mapping[str, MapFrame | None] | None) -> bool:
    """Set the given frames; None removes a frame's CRS. Returns whether anything changed.

    Raises InvalidField if a submap would be outside of the area of the frame's system.
    """
    repository = tx.map_frames(row)
    known = repository.some(list(frames or {}))
    changed = False
    for frame_id, frame in (frames or {}).items():
        reference = _reference(frame)
        if known.get(frame_id) == reference:
            continue
        changed = True
        repository.put(frame_id, reference)
        if reference is not None:
            check_submaps(repository, frame_id, reference, _pointer(frame_id))
    return changed


def check_default_frame(tx: ReadTransaction, row: CollectionRecord, pointer: str) -> None:
    """Raise InvalidField if a submap in the default frame would be outside of the area of the collection's CRS."""
    repository = tx.map_frames(row)
    reference = repository.some([DEFAULT_FRAME]).get(DEFAULT_FRAME)
    if reference is not None:
        check_submaps(repository, DEFAULT_FRAME, reference, pointer)


def check_submaps(repository: MapFrameReader, frame_id: str, reference: FrameReference, pointer: str) -> None:
    """Raise InvalidField for the first submap of a frame that would be outside of the area of its system."""
    extent = repository.extent(frame_id)
    if extent is None:
        return
    georeference = Georeference(reference)
    min_x, min_y, max_x, max_y = extent
    corners = [(x, y) for x in (min_x, max_x) for y in (min_y, max_y)]
    if not any(georeference.fault(x, y) for x, y in corners):
        return
    for submap_id, x, y in repository.centres(frame_id):
        fault = georeference.fault(x, y)
        if fault is not None:
            raise InvalidField(
                f"puts the submap {submap_id!r} of the map frame {frame_id!r} {fault}; check the crs and origin of "
                "this frame. If poses are in full coordinates of the system, leave out the origin.",
                code="crs",
                pointer=pointer,
            )


def _reference(frame: MapFrame | None) -> FrameReference | None:
    return None if frame is None else FrameReference(frame.crs, frame.origin)


def _pointer(frame_id: str) -> str:
    return "/frames/" + frame_id.replace("~", "~0").replace("/", "~1")
