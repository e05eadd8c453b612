"""The trees of a map, from all submaps that lie in it, each tree once."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from server.store.codec import unpack_attributes, unpack_ids, unpack_positions
from server.store.records import CollectionRecord
from server.store.storage import ReadTransaction
from server.store.submap_records import SubmapContent, SubmapFilter
from urquhart import SE2

_ONE_TREE: Final = 0.3
"""Metres: two trees of different submaps that are nearest to each other, and this close, are one tree."""


@dataclass(frozen=True, slots=True, eq=False)
class MapTrees:
    """Trees of a map.

    Attributes:
        xy: (M, 2) float64, metres, map frame.
        ids: their ids, as stored; a tree of several submaps has that of the first.
        dbh_cm, height_m: (M,) float64, NaN where not known.
    """

    xy: NDArray[np.float64]
    ids: list[str]
    dbh_cm: NDArray[np.float64]
    height_m: NDArray[np.float64]

    @property
    def diameters(self) -> NDArray[np.float64] | None:
        """Stem diameters (M,) float64, metres; None if none is known."""
        return None if np.isnan(self.dbh_cm).all() else self.dbh_cm / 100.0


def trees_around(
    tx: ReadTransaction,
    collection: CollectionRecord,
    frame_id: str,
    middle: NDArray[np.float64],
    radius: float,
) -> MapTrees:
    """The trees of the map `frame_id` within `radius` metres of `middle` (2,), metres, map frame."""
    low, high = (middle - radius).tolist(), (middle + radius).tolist()
    submaps = tx.submaps(collection.key)
    keys = submaps.matching(SubmapFilter(bbox=(low[0], low[1], high[0], high[1]), map_frame_id=frame_id))
    found = _Trees(middle, radius)
    for submap in submaps.some(sorted(keys), SubmapContent):
        if submap.place is not None:
            found.add(submap, SE2(submap.place.map_x, submap.place.map_y, submap.place.map_yaw))
    return found.trees()


def trees_of_submap(
    tx: ReadTransaction, collection: CollectionRecord, submap_id: str, middle: NDArray[np.float64], radius: float
) -> MapTrees:
    """The trees of a submap that is in no map, in its own frame, within `radius` metres of `middle` (2,)."""
    found = _Trees(middle, radius)
    submap = tx.submaps(collection.key).get(submap_id, SubmapContent)
    if submap is not None:
        found.add(submap, SE2.identity())
    return found.trees()


class _Trees:
    """Trees gathered from one submap after the other."""

    def __init__(self, middle: NDArray[np.float64], radius: float) -> None:
        self._middle, self._radius = middle, radius
        self._xy = np.empty((0, 2))
        self._ids: list[str] = []
        self._measured = np.empty((0, 2))

    def add(self, submap: SubmapContent, map_T_submap: SE2) -> None:
        """Add the trees of a submap that are near and not known yet."""
        xy = map_T_submap.apply(unpack_positions(submap.landmarks))
        chosen = np.hypot(*(xy - self._middle).T) <= self._radius
        if len(self._xy):
            # A tree is known if it and a known one are nearest to each other: two tops may be very close.
            away, known = cKDTree(self._xy).query(xy)
            mutual = cKDTree(xy).query(self._xy[known])[1] == np.arange(len(xy))
            chosen &= ~(mutual & (away <= _ONE_TREE))
        rows = np.flatnonzero(chosen)
        ids, attributes = unpack_ids(submap.landmark_ids, len(xy)), unpack_attributes(submap.attributes)
        columns = [np.array(attributes.get(name) or [None] * len(xy), dtype=np.float64) for name in _MEASURED]
        self._xy = np.concatenate([self._xy, xy[rows]])
        self._ids += [ids[row] for row in rows.tolist()]
        self._measured = np.concatenate([self._measured, np.column_stack(columns)[rows]])

    def trees(self) -> MapTrees:
        """All that were added."""
        return MapTrees(self._xy, self._ids, self._measured[:, 0], self._measured[:, 1])


_MEASURED: Final = ("dbh_cm", "height_m")
