"""Pages of features: landmarks and submaps, in an order that writes of others do not change.

A page begins after a place in that order: a submap's key, which is never used again, and a position among its
landmarks. So a page never repeats or leaves out what was there all the time, whoever writes meanwhile.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np
import orjson
from numpy.typing import NDArray

from server.errors import InvalidField, NotFound
from server.exports.selection import ExportPlaces
from server.exports.submap_layers import (
    landmark_layer,
    row_of_submap,
    rows_of_landmarks,
    submap_layer,
)
from server.ogc.boxes import DegreeBox, frame_box
from server.outputs.geojson_text import features_of
from server.outputs.tables import OutputRows
from server.resources.paging import read_name_cursor, write_cursor
from server.store.codec import unpack_ids
from server.store.records import FrameExtent
from server.store.storage import Storage
from server.store.submap_records import SubmapContent, SubmapFilter
from urquhart import Budget

FeatureKind = Literal["landmarks", "submaps"]
_READ: Final = 20
"""Submaps that are read at once."""
_MOST: Final = 500
"""Submaps that are looked at for one page. A page that ends there may be empty, and has a next one."""


@dataclass(frozen=True, slots=True)
class ItemsRequest:
    """The wanted page: how many features at most, in which box, of which submaps (by stamp), after which cursor."""

    limit: int
    box: DegreeBox | None = None
    chosen: SubmapFilter = field(default_factory=SubmapFilter)
    cursor: str | None = None


@dataclass(frozen=True, slots=True)
class _Mark:
    """A place in the order: the map frame (only with a box), a submap's key, the first landmark not yet returned."""

    frame_id: str = ""
    key: int = 0
    position: int = 0

    def written(self) -> str:
        return write_cursor("items", orjson.dumps([self.frame_id, self.key, self.position]).decode())

    @staticmethod
    def read(cursor: str | None) -> "_Mark":
        text = read_name_cursor("items", cursor)
        if not text:
            return _Mark()
        try:
            content = orjson.loads(text)
        except orjson.JSONDecodeError:
            content = None
        match content:
            case [str(frame_id), int(key), int(position)] if 0 <= key < 2**63 and 0 <= position < 2**31:
                return _Mark(frame_id, key, position)
        raise InvalidField("is not a cursor of these items; follow the link `next`", code="cursor", parameter="cursor")


@dataclass(frozen=True, slots=True, eq=False)
class ItemSource:
    """What features are made of.

    Attributes:
        kind: of features.
        places: where map frames are on Earth, in longitude and latitude.
        extents: what each map frame covers.
    """

    database: Storage
    kind: FeatureKind
    places: ExportPlaces
    extents: tuple[FrameExtent, ...]


def page_of(source: ItemSource, asked: ItemsRequest, budget: Budget) -> tuple[list[dict[str, Any]], str | None]:
    """The features of a page, and the cursor of the next one.

    Raises InvalidField for a cursor that is not of these items, and Abandoned.
    """
    features: list[dict[str, Any]] = []
    mark = _Mark.read(asked.cursor)
    for looked_at, (frame_id, row) in enumerate(_submaps(source, asked, mark)):
        budget.check()
        if looked_at >= _MOST:
            return features, mark.written()
        start = mark.position if (mark.key, mark.frame_id) == (row.key, frame_id) else 0
        left = asked.limit - len(features)
        if source.kind == "submaps":
            if left == 0:
                return features, mark.written()
            features += _submap_feature(source, row, asked.box)
        else:
            chosen = _wanted_landmarks(source, row, start, asked.box)
            if len(chosen) > left or (left == 0 and len(chosen)):
                features += landmark_features(source, row, chosen[:left])
                return features, replace(_Mark(frame_id, row.key), position=int(chosen[left])).written()
            features += landmark_features(source, row, chosen)
        mark = _Mark(frame_id, row.key, 2**31 - 1)
    return features, None


def item_of(source: ItemSource, feature_id: str) -> dict[str, Any]:
    """One feature by its id. Raises NotFound."""
    submap_id, _, landmark_id = feature_id.partition(":")
    with source.database.read() as tx:
        row = tx.submaps(source.places.collection.key).get(submap_id, SubmapContent)
    if row is not None and source.kind == "submaps" and feature_id == row.id:
        return _submap_feature(source, row, None)[0]
    if row is not None and source.kind == "landmarks" and ":" in feature_id:
        ids = unpack_ids(row.landmark_ids, row.landmark_count)
        if landmark_id in ids:
            return landmark_features(source, row, np.array([ids.index(landmark_id)]))[0]
    raise NotFound("feature", feature_id[:300])


def landmark_features(source: ItemSource, row: SubmapContent, chosen: NDArray[np.int64]) -> list[dict[str, Any]]:
    """The landmarks at the positions `chosen` (K,) of a submap, with ids `SUBMAP:LANDMARK`."""
    rows = rows_of_landmarks(row, source.places, chosen)
    made = features_of(landmark_layer(source.places), rows)
    return [feature | {"id": f"{row.id}:{feature['properties']['id']}"} for feature in made]


def _submap_feature(source: ItemSource, row: SubmapContent, box: DegreeBox | None) -> list[dict[str, Any]]:
    """The submap as a list of one feature; empty if it is not in the box."""
    made = row_of_submap(row, source.places)
    if box is not None and not _is_inside(made, box):
        return []
    return [feature | {"id": row.id} for feature in features_of(submap_layer(source.places), made)]


def _is_inside(made: OutputRows, box: DegreeBox) -> bool:
    path = made.paths[0]
    return path is not None and box.touches(path)


def _wanted_landmarks(source: ItemSource, row: SubmapContent, start: int, box: DegreeBox | None) -> NDArray[np.int64]:
    """Positions (K,) of the landmarks from `start` on that are in the box, and in no earlier submap of the stand."""
    ids = unpack_ids(row.landmark_ids, row.landmark_count)
    chosen = np.arange(min(start, len(ids)), len(ids))
    if box is not None and len(chosen):
        chosen = chosen[box.contains(rows_of_landmarks(row, source.places, chosen).xy)]
    if row.stand_key is None or not len(chosen):
        return chosen
    earlier = _earlier_ids(source, row)
    return np.array([i for i in chosen.tolist() if ids[i] not in earlier], dtype=np.int64)


def _earlier_ids(source: ItemSource, row: SubmapContent) -> set[str]:
    """Ids of trees in submaps of the same stand that were stored before and overlap this one.

    Submaps of a stand overlap, and a tree is a feature of the first that has it.
    """
    place, found = row.place, set[str]()
    if place is None:
        return found
    box = (place.map_min_x, place.map_min_y, place.map_max_x, place.map_max_y)
    near, after = SubmapFilter(bbox=box, map_frame_id=place.map_frame_id), 0
    while True:
        with source.database.read() as tx:
            page = tx.submaps(source.places.collection.key).page(near, SubmapContent, after_key=after, limit=_READ)
        for other in page:
            if other.key >= row.key:
                return found
            if other.stand_key == row.stand_key:
                found.update(unpack_ids(other.landmark_ids, other.landmark_count))
        if len(page) < _READ:
            return found
        after = page[-1].key


def _submaps(source: ItemSource, asked: ItemsRequest, mark: _Mark) -> Iterator[tuple[str, SubmapContent]]:
    """The submaps that may have features of the page, from the mark on, each with its map frame if there is a box."""
    if asked.box is None:
        yield from (("", row) for row in _in_order(source, asked.chosen, mark))
        return
    for extent in sorted(source.extents, key=lambda one: one.frame_id):
        if extent.frame_id < mark.frame_id:
            continue
        system = source.places.systems.get(extent.frame_id)
        box = None if system is None else frame_box(system, extent, asked.box)
        if box is None:
            continue
        chosen = replace(asked.chosen, bbox=box, map_frame_id=extent.frame_id)
        start = mark if extent.frame_id == mark.frame_id else _Mark()
        yield from ((extent.frame_id, row) for row in _in_order(source, chosen, start))


def _in_order(source: ItemSource, chosen: SubmapFilter, mark: _Mark) -> Iterator[SubmapContent]:
    """Submaps by key, from that of the mark on: it may have more features."""
    after = max(mark.key - 1, 0)
    while True:
        with source.database.read() as tx:
            page = tx.submaps(source.places.collection.key).page(chosen, SubmapContent, after_key=after, limit=_READ)
        for row in page:
            if row.key != mark.key or mark.position < row.landmark_count:
                yield row
        if len(page) < _READ:
            return
        after = page[-1].key
