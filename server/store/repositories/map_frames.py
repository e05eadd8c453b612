"""Where map frames are on Earth, all seen through one collection."""

from collections.abc import Collection, Iterator

from sqlalchemy import Connection, delete, func, insert, select

from server.store.expressions import batches
from server.store.records import DEFAULT_FRAME, CollectionRecord, FrameReference
from server.store.tables import MapFrameRow, SubmapRow


class MapFrameReader:
    """Reads one collection's map frames in a transaction of the caller."""

    def __init__(self, connection: Connection, collection: CollectionRecord) -> None:
        self._connection = connection
        self._collection = collection

    def named(self) -> dict[str, FrameReference]:
        """All frames but the default one, by name."""
        query = _ALL.where(MapFrameRow.collection_key == self._collection.key).order_by(MapFrameRow.frame_id)
        return {frame_id: _reference(crs, x, y) for frame_id, crs, x, y in self._connection.execute(query)}

    def some(self, frame_ids: Collection[str]) -> dict[str, FrameReference]:
        """Those of the frames that have a reference, the default one among them."""
        found: dict[str, FrameReference] = {}
        if DEFAULT_FRAME in frame_ids and self._collection.crs is not None:
            found[DEFAULT_FRAME] = _reference(
                self._collection.crs, self._collection.origin_x, self._collection.origin_y
            )
        for some in batches(sorted(set(frame_ids) - {DEFAULT_FRAME})):
            query = _ALL.where(MapFrameRow.collection_key == self._collection.key, MapFrameRow.frame_id.in_(some))
            found |= {frame_id: _reference(crs, x, y) for frame_id, crs, x, y in self._connection.execute(query)}
        return found

    def any(self) -> bool:
        """Whether any frame of the collection has a reference."""
        query = select(MapFrameRow.frame_id).where(MapFrameRow.collection_key == self._collection.key).limit(1)
        return self._collection.crs is not None or self._connection.scalar(query) is not None

    def extent(self, frame_id: str) -> tuple[float, float, float, float] | None:
        """min x, min y, max x, max y of the footprints in a frame, metres; None where there are none."""
        low_x, low_y, high_x, high_y = self._connection.execute(
            select(
                func.min(SubmapRow.map_min_x),
                func.min(SubmapRow.map_min_y),
                func.max(SubmapRow.map_max_x),
                func.max(SubmapRow.map_max_y),
            ).where(SubmapRow.collection_key == self._collection.key, SubmapRow.map_frame_id == frame_id)
        ).one()
        if low_x is None or low_y is None or high_x is None or high_y is None:
            return None
        return low_x, low_y, high_x, high_y

    def in_use(self, most: int) -> list[str]:
        """Names of up to `most` frames that submaps have a pose in, in order."""
        found: list[str] = []
        while len(found) < most:
            # Each is looked up in an index, so that the submaps of a frame are not read.
            after = [SubmapRow.map_frame_id > found[-1]] if found else []
            query = select(func.min(SubmapRow.map_frame_id)).where(
                SubmapRow.collection_key == self._collection.key, SubmapRow.map_frame_id.is_not(None), *after
            )
            name = self._connection.scalar(query)
            if name is None:
                break
            found.append(name)
        return found

    def centres(self, frame_id: str) -> Iterator[tuple[str, float, float]]:
        """Id and middle of the footprint, metres, of every submap in a frame."""
        query = select(
            SubmapRow.id,
            (SubmapRow.map_min_x + SubmapRow.map_max_x) / 2,
            (SubmapRow.map_min_y + SubmapRow.map_max_y) / 2,
        ).where(SubmapRow.collection_key == self._collection.key, SubmapRow.map_frame_id == frame_id)
        for submap_id, x, y in self._connection.execute(query.execution_options(yield_per=1000)):
            if x is not None and y is not None:
                yield submap_id, x, y


class MapFrames(MapFrameReader):
    """Reads and writes one collection's map frames in a transaction that the caller commits."""

    def put(self, frame_id: str, reference: FrameReference | None) -> None:
        """Set a frame's reference, or with None take it away; not for the default frame."""
        key = self._collection.key
        self._connection.execute(
            delete(MapFrameRow).where(MapFrameRow.collection_key == key, MapFrameRow.frame_id == frame_id)
        )
        if reference is not None:
            x, y = reference.origin or (None, None)
            values = {"collection_key": key, "frame_id": frame_id, "crs": reference.crs, "origin_x": x, "origin_y": y}
            self._connection.execute(insert(MapFrameRow).values(values))


_ALL = select(MapFrameRow.frame_id, MapFrameRow.crs, MapFrameRow.origin_x, MapFrameRow.origin_y)


def _reference(crs: str, x: float | None, y: float | None) -> FrameReference:
    return FrameReference(crs, None if x is None or y is None else (x, y))
