"""The nearest polygons by vertex count and descriptor, over all segments of a collection at once.

Segments never change, so searches may run in parallel, and while segments are merged. Masks beside the segments mark
submaps that were deleted or replaced.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import UNBOUNDED, Budget
from urquhart.index.polygon_merge import merge_partitions
from urquhart.index.polygon_partition import Partition, build_partitions
from urquhart.index.polygon_scan import Heaps, Outlines, Scan, gather_addresses, scan_partition, sort_heaps

__all__ = ["Partition", "PolygonHits", "Searched", "build_partitions", "merge_partitions", "search_partitions"]

Searched = tuple[Mapping[int, Partition], NDArray[np.int64], NDArray[np.float32], NDArray[np.uint8] | NDArray[np.bool_]]
"""A segment for search: its partitions by vertex count; and by slot, (S,) each: the submap's key, the unit of its
outlines in metres, and whether it is alive."""


class PolygonSearchNumbers(NamedTuple):
    """How much of an index is read for one polygon of the query. Chosen by hand, not fitted."""

    least_probes: int = 16
    """Fewest lists that are read of a partition."""
    probed: int = 64
    """One list in this many is read, if that is more than `least_probes`: neighbours lie in few lists, and in hardly
    more as a partition grows."""
    most_rows: int = 60_000
    """Most rows that are read for a polygon of the query. This bounds the cost of a query."""
    largest: int = 256
    """Vertices of the largest polygons that are searched for. In forests, polygons have fewer than a quarter as many;
    a polygon around a ring of trees or a lake may have more, but changes with every tree."""
    steps: int = 10_000_000
    """Steps of compiled work after which hits are passed on and the budget is checked: 10 to 50 ms."""
    at_once: int = 4
    """Components of a descriptor that count as one step."""


POLYGONS: Final = PolygonSearchNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class PolygonHits:
    """Stored polygons with one vertex count that are near polygons of the query; for each of those, nearest first.

    Attributes:
        count: vertices of the stored polygons.
        rows: (H,) int64, the query polygon of each hit.
        keys: (H,) int64, the submap of the stored polygon.
        outlines: (H, count, 2) float32, metres, centred submap frame: the vertices of the stored polygon,
            counter-clockwise.
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
) -> Iterator[PolygonHits]:
    """The nearest `neighbours` living polygons of each query polygon, for each vertex count within `window` of its own.

    Hits of one vertex count come in one or several portions, in the order of the query polygons. The budget is checked
    before each portion, and after the deadline no more come.

    Args:
        segments: partitions, keys, units and masks of each segment.
        counts: (Q,) int32, vertices of each query polygon.
        descriptors: (Q, D) float32, their descriptors.
        neighbours: most hits for each query polygon and vertex count.
        window: largest difference in vertex count.
        budget: when the search must end; by default never.

    Raises:
        Abandoned: nobody waits for the hits any more.
        ValueError: masks, keys and units of a segment differ in length, a mask is neither bool nor uint8, or the
            descriptors have another width than the index.
    """
    living = [_alive(segment) for segment in segments]
    near = {count + offset for count in np.unique(counts).tolist() for offset in range(-window, window + 1)}
    known = {count for partitions, *_ in segments for count in partitions if count <= POLYGONS.largest}
    for count in sorted(near & known):
        rows = np.flatnonzero(np.abs(counts - count) <= window)
        held = [partitions[count] for partitions, *_ in segments if count in partitions]
        read = sum(min(len(p), POLYGONS.most_rows) if p.inverted else len(p) for p in held)
        # The work on each hit grows with the square of the vertices: every cyclic shift of an outline is tried.
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
) -> PolygonHits:
    """Hits with `count` vertices for the query polygons `rows` (K,); `living`: the mask (S,) of each segment."""
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
            raise ValueError(f"descriptors have {queries.shape[1]} components, but those of the index {len(p.low)}")
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
        # numba dispatches far more slowly on a subclass such as `np.memmap` than on a plain array.
        source = Outlines(i, p.owners, p.outlines, np.asarray(owner_keys), np.asarray(units))
        gather_addresses(found, source, keys, outlines)
    return PolygonHits(count, which, keys, outlines, near_by)


def _alive(segment: Searched) -> NDArray[np.uint8]:
    _, keys, units, alive = segment
    if not len(keys) == len(units) == len(alive):
        raise ValueError(f"{len(keys)} keys, {len(units)} units and {len(alive)} marks of one segment's submaps")
    if alive.dtype not in (np.bool_, np.uint8):
        raise ValueError(f"marks of living submaps are bytes or truth values, not {alive.dtype}")
    return np.asarray(alive).view(np.uint8)
