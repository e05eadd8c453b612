"""Nearest polygons by vertex count and descriptor, over all segments of a collection at once.

Segments never change, so searches may run side by side and while others are merged. What is gone from a collection is
told by the masks that come with its segments.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import UNBOUNDED, Budget
from urquhart.index.polygon_merge import merge_partitions
from urquhart.index.polygon_partition import Partition, build_partitions
from urquhart.index.polygon_scan import Heaps, Outlines, Scan, gather_places, scan_partition, sort_heaps

__all__ = ["Hits", "Partition", "Searched", "build_partitions", "merge_partitions", "search_partitions"]

Searched = tuple[Mapping[int, Partition], NDArray[np.int64], NDArray[np.float32], NDArray[np.uint8] | NDArray[np.bool_]]
"""A segment as it is searched: partitions; key, unit (metres) and life (S,) of the submap in each slot."""


class PolygonSearchNumbers(NamedTuple):
    """How much of an index a polygon of the query reads. Chosen by hand, not fitted."""

    least_probes: int = 16
    """Lists read of each partition, at least."""
    probed: int = 64
    """One list in this many is read, if that is more than `least_probes`: neighbours lie in few lists, and in hardly
    more as a partition grows."""
    most_rows: int = 60_000
    """Most rows read for a polygon of the query: that bounds what a query costs."""
    largest: int = 256
    """Vertices of the largest polygons that are looked for: forests have none with a quarter as many, and the polygon
    about a ring of trees or a lake changes with every tree."""
    steps: int = 10_000_000
    """Steps of compiled work after which hits are handed on and the budget is asked: 10 to 50 ms."""
    at_once: int = 4
    """Components of a descriptor that take one step."""


POLYGONS: Final = PolygonSearchNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Neighbours of polygons with one vertex count, nearest first for each query row.

    Attributes:
        count: vertices of the polygons found.
        rows: (H,) int64, which query row each hit answers.
        keys: (H,) int64, the submap of the polygon found.
        outlines: (H, count, 2) float32, metres, centred submap frame: its vertices, counter-clockwise.
        distances: (H,) float32, squared descriptor distance.
    """

    count: int
    rows: NDArray[np.int64]
    keys: NDArray[np.int64]
    outlines: NDArray[np.float32]
    distances: NDArray[np.float32]


def search_partitions(
    segments: Sequence[Searched],
    counts: NDArray[np.int32],
    descriptors: NDArray[np.float32],
    *,
    neighbours: int,
    window: int = 0,
    budget: Budget = UNBOUNDED,
) -> Iterator[Hits]:
    """The nearest `neighbours` living polygons of each row, for every vertex count within `window` of its own.

    Hits of one vertex count come in portions, in the order of the rows, where there is more than a little work. The
    budget is asked before each, also where there are none, and after the deadline no more come.

    Args:
        counts: (Q,) int32, vertices of each query polygon.
        descriptors: (Q, D) float32.

    Raises:
        Abandoned: nobody waits for the hits any more.
        ValueError: masks, keys and units of a segment of different lengths, masks of another type than bool and uint8,
            or descriptors of another width.
    """
    living = [_alive(segment) for segment in segments]
    near = {count + offset for count in np.unique(counts).tolist() for offset in range(-window, window + 1)}
    known = {count for partitions, *_ in segments for count in partitions if count <= POLYGONS.largest}
    for count in sorted(near & known):
        rows = np.flatnonzero(np.abs(counts - count) <= window)
        held = [partitions[count] for partitions, *_ in segments if count in partitions]
        read = sum(min(len(p), POLYGONS.most_rows) if p.inverted else len(p) for p in held)
        # The work on each hit grows with the square of the vertices: every start of one outline is tried on the other.
        cost = read * descriptors.shape[1] // POLYGONS.at_once + neighbours * count * count
        portion = max(POLYGONS.steps // max(cost, 1), 1)
        for begin in range(0, len(rows), portion):
            if budget.is_spent():
                return
            hits = _search(segments, living, count, rows[begin : begin + portion], descriptors, neighbours)
            if len(hits.rows):
                yield hits


def _search(
    segments: Sequence[Searched],
    living: Sequence[NDArray[np.uint8]],
    count: int,
    rows: NDArray[np.int64],
    descriptors: NDArray[np.float32],
    neighbours: int,
) -> Hits:
    """Neighbours with `count` vertices of some query rows (K,)."""
    queries = np.ascontiguousarray(descriptors[rows], np.float32)
    heaps = Heaps(
        np.empty((len(rows), neighbours), np.float32),
        np.empty((len(rows), neighbours), np.int64),
        np.zeros(len(rows), np.int64),
    )
    for i, (partitions, _, _, _) in enumerate(segments):
        p = partitions.get(count)
        if p is None:
            continue
        if len(p.low) != queries.shape[1]:
            raise ValueError(f"descriptors of {queries.shape[1]} components, {len(p.low)} in the index")
        listed = len(p.centroids)
        probes = min(max(POLYGONS.least_probes, listed // POLYGONS.probed), listed)
        most = POLYGONS.most_rows
        scan = Scan(p.owners, p.descriptors, p.low, p.step, p.centroids, p.lists, living[i], i, probes, most)
        scan_partition(scan, queries, heaps)
    which, near_by, found, occurs = sort_heaps(heaps, rows)
    keys, outlines = np.empty(len(found), np.int64), np.empty((len(found), count, 2), np.float32)
    for i in np.flatnonzero(occurs).tolist() if len(found) else []:
        partitions, owner_keys, units, _ = segments[i]
        p = partitions[count]
        # A subclass such as `np.memmap` costs the compiler's dispatch far more time than a plain array.
        source = Outlines(i, p.owners, p.outlines, np.asarray(owner_keys), np.asarray(units))
        gather_places(found, source, keys, outlines)
    return Hits(count, which, keys, outlines, near_by)


def _alive(segment: Searched) -> NDArray[np.uint8]:
    _, keys, units, alive = segment
    if not len(keys) == len(units) == len(alive):
        raise ValueError(f"{len(keys)} keys, {len(units)} units and {len(alive)} marks of one segment's submaps")
    if alive.dtype not in (np.bool_, np.uint8):
        raise ValueError(f"marks of living submaps are bytes or truth values, not {alive.dtype}")
    return np.asarray(alive).view(np.uint8)
