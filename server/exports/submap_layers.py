"""Landmarks and submaps as rows of a table.

Submaps are read in pages of the order in which they were stored, each in a transaction of its own, so that a slow
reader keeps no old state of the database alive. What is stored meanwhile may be among the rows.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.collections.hulls import hull_of
from server.exports.selection import ExportChoice, ExportPlaces
from server.outputs.tables import OutputColumn, OutputLayer, OutputRows
from server.store.codec import unpack_attributes, unpack_ids, unpack_positions
from server.store.storage import Storage
from server.store.submap_records import SubmapContent
from urquhart import Budget

LANDMARK_COLUMNS: Final = (
    OutputColumn("id", "text"),
    OutputColumn("dbh_cm", "real"),
    OutputColumn("height_m", "real"),
    OutputColumn("species", "text"),
    OutputColumn("submap", "text"),
    OutputColumn("session", "text"),
    OutputColumn("stamp", "time"),
    OutputColumn("frame_id", "text"),
    OutputColumn("x_submap", "real"),
    OutputColumn("y_submap", "real"),
)
SUBMAP_COLUMNS: Final = (
    OutputColumn("id", "text"),
    OutputColumn("session", "text"),
    OutputColumn("stamp", "time"),
    OutputColumn("frame_id", "text"),
    OutputColumn("landmarks", "integer"),
    OutputColumn("map_x", "real"),
    OutputColumn("map_y", "real"),
    OutputColumn("map_yaw_degrees", "real"),
    OutputColumn("revision", "integer"),
    OutputColumn("created", "time"),
    OutputColumn("updated", "time"),
)
_PAGE: Final = 50
"""Submaps that are read at once."""
_ATTRIBUTES: Final = ("dbh_cm", "height_m", "species")


def landmark_layer(places: ExportPlaces) -> OutputLayer:
    """The table of landmarks: a point for each."""
    return OutputLayer("landmarks", LANDMARK_COLUMNS, places.system)


def submap_layer(places: ExportPlaces) -> OutputLayer:
    """The table of submaps: the hull of the landmarks of each; x and y of CSV are their middle."""
    return OutputLayer("submaps", SUBMAP_COLUMNS, places.system, "Polygon")


def landmark_rows(
    database: Storage, places: ExportPlaces, choice: ExportChoice, budget: Budget | None = None
) -> Iterator[OutputRows]:
    """The landmarks of the chosen submaps, a batch for each submap.

    Submaps of a stand overlap. A tree that several of them share has one row, with the first of them, unless the choice
    says `every`. Raises Abandoned if the budget's caller has gone.
    """
    seen: dict[int, set[str]] = defaultdict(set)
    for row in submaps_of(database, places, choice, budget):
        ids = unpack_ids(row.landmark_ids, row.landmark_count)
        chosen = np.arange(len(ids))
        if row.stand_key is not None and not choice.every:
            known = seen[row.stand_key]
            chosen = np.array([i for i, name in enumerate(ids) if name not in known], dtype=np.int64)
            known.update(ids)
        if len(chosen):
            yield rows_of_landmarks(row, places, chosen)


def rows_of_landmarks(row: SubmapContent, places: ExportPlaces, chosen: NDArray[np.int64]) -> OutputRows:
    """The landmarks at the positions `chosen` (K,) of a submap."""
    ids = unpack_ids(row.landmark_ids, row.landmark_count)
    attributes = unpack_attributes(row.attributes)
    xy = unpack_positions(row.landmarks)[chosen]
    count, positions = len(chosen), chosen.tolist()
    known: list[list[Any]] = [
        [attributes[name][i] for i in positions] if name in attributes else [None] * count for name in _ATTRIBUTES
    ]
    frame_id = None if row.place is None else row.place.map_frame_id
    shared = [[value] * count for value in (row.id, row.session, row.stamp, frame_id)]
    there = places.of_submap(row.place, xy)
    why = () if np.isfinite(there).all() else [places.missing(frame_id)] * count
    return OutputRows([[ids[i] for i in positions], *known, *shared, *xy.T.tolist()], there, why=why)


def submap_rows(
    database: Storage, places: ExportPlaces, choice: ExportChoice, budget: Budget | None = None
) -> Iterator[OutputRows]:
    """The chosen submaps. Raises Abandoned if the budget's caller has gone."""
    for row in submaps_of(database, places, choice, budget):
        yield row_of_submap(row, places)


def row_of_submap(row: SubmapContent, places: ExportPlaces) -> OutputRows:
    """A submap with the hull of its landmarks."""
    place = row.place
    xy = unpack_positions(row.landmarks)
    frame_id = None if place is None else place.map_frame_id
    values: list[Any] = [row.id, row.session, row.stamp, frame_id, row.landmark_count]
    values += [None] * 3 if place is None else [place.map_x, place.map_y, math.degrees(place.map_yaw)]
    values += [row.revision, row.created, row.updated]
    middle = places.of_submap(place, xy.mean(axis=0, keepdims=True) if len(xy) else np.zeros((1, 2)))
    hull = hull_of(xy)
    path = None if hull is None else places.of_submap(place, hull)
    if path is not None and not np.isfinite(path).all():
        path = None
    why = () if path is not None else [places.missing(frame_id) if hull is not None else "its landmarks span no area"]
    return OutputRows([[value] for value in values], middle, [path], why)


def submaps_of(
    database: Storage, places: ExportPlaces, choice: ExportChoice, budget: Budget | None, after_key: int = 0
) -> Iterator[SubmapContent]:
    """The chosen submaps in the order in which they were stored, beginning after a key."""
    while True:
        with database.read() as tx:
            page = tx.submaps(places.collection.key).page(
                choice.chosen, SubmapContent, after_key=after_key, limit=_PAGE
            )
        for row in page:
            if budget is not None:
                budget.check()
            yield row
        if len(page) < _PAGE:
            return
        after_key = page[-1].key
