"""Landmarks of a map frame as binary columns, for drawing: thinned evenly where there are more than a screen shows.

The layout, little-endian: the 8 bytes `URQCOL1\\n`; uint32, the length of the head; the head, JSON padded with spaces
so that what follows begins at a multiple of 4; float32 (S, 4), the box of each submap (min x, min y, max x, max y);
uint32 (S,), how many positions each submap has here; float32 (N, 2), positions, submap after submap. Metres, relative
to `origin` of the head, in the map frame.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from server.collections.crud import get_collection
from server.store.codec import unpack_positions
from server.store.storage import Storage
from server.store.submap_records import Place, SubmapContent, SubmapFilter
from urquhart import SE2

MAGIC: Final = b"URQCOL1\n"
_PAGE: Final = 500
"""Submaps that are read at once."""


@dataclass(slots=True)
class _Thinned:
    """Positions of submaps, of which every `step`-th is kept, so that at most about twice `limit` are held."""

    limit: int
    step: int = 1
    seen: int = 0
    kept: int = 0
    parts: list[NDArray[np.float64]] = field(default_factory=list)

    def add(self, xy: NDArray[np.float64]) -> None:
        """The positions of one more submap, (N, 2) float64."""
        chosen = xy[-self.seen % self.step :: self.step]
        self.seen += len(xy)
        self.kept += len(chosen)
        self.parts.append(chosen)
        if self.kept > 2 * self.limit:
            self.thin()

    def thin(self) -> None:
        """Keep every second position."""
        self.step *= 2
        parts, before = [], 0
        for part in self.parts:
            parts.append(part[before % 2 :: 2])
            before += len(part)
        self.parts, self.kept = parts, sum(map(len, parts))


def landmark_columns(
    database: Storage, collection_id: str, chosen: SubmapFilter, limit: int, check: Callable[[], object]
) -> bytes:
    """The submaps that are chosen, which have a place in one map frame, and at most `limit` of their landmarks.

    `check` is called between pages and raises what ends the work. Raises NotFound.
    """
    thinned = _Thinned(limit)
    rows: list[tuple[SubmapContent, Place]] = []
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        submaps, after = tx.submaps(collection.key), 0
        while page := submaps.page(chosen, SubmapContent, after_key=after, limit=_PAGE):
            check()
            after = page[-1].key
            for row in page:
                place = row.place
                if place is not None:
                    pose = SE2(place.map_x, place.map_y, place.map_yaw)
                    thinned.add(pose.apply(unpack_positions(row.landmarks)))
                    rows.append((row, place))
    while thinned.kept > limit:
        thinned.thin()
    places = [place for _, place in rows]
    boxes = np.array([(one.map_min_x, one.map_min_y, one.map_max_x, one.map_max_y) for one in places]).reshape(-1, 4)
    # float32 holds seven digits, too few for full coordinates of a system, so all are relative to a corner.
    corner = np.floor(boxes[:, :2].min(axis=0)) if len(boxes) else np.zeros(2)
    sessions = list(dict.fromkeys(row.session for row, _ in rows if row.session is not None))
    number = {session: at for at, session in enumerate(sessions)}
    head = {
        "collection": collection.id,
        "frame_id": chosen.map_frame_id,
        "revision": collection.revision,
        "origin": corner.tolist(),
        "landmarks": thinned.seen,
        "every": thinned.step,
        "submaps": [row.id for row, _ in rows],
        "sessions": sessions,
        "stamps": [None if row.stamp is None else round(row.stamp.timestamp(), 3) for row, _ in rows],
        "session_of": [-1 if row.session is None else number[row.session] for row, _ in rows],
    }
    return _packed(head, boxes - np.tile(corner, 2), [part - corner for part in thinned.parts])


def _packed(head: dict[str, Any], boxes: NDArray[np.float64], parts: list[NDArray[np.float64]]) -> bytes:
    text = orjson.dumps(head)
    text += b" " * (-len(text) % 4)
    positions = np.concatenate(parts) if parts else np.zeros((0, 2))
    return b"".join(
        (
            MAGIC,
            struct.pack("<I", len(text)),
            text,
            boxes.astype("<f4").tobytes(),
            np.array([len(part) for part in parts], dtype="<u4").tobytes(),
            positions.astype("<f4").tobytes(),
        )
    )
