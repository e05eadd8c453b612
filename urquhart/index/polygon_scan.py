"""Compiled search of one partition of polygons: distances list by list, the nearest kept in a heap.

In a list of n rows all first components stand one after the other, then all second ones, and so on: an instruction then
works on many rows at once, which reads a list five times as fast as row after row would.

A file can be damaged. Whatever the arrays hold, nothing is read outside of them: what points outside is passed over.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.polygon_partition import draw_outline

_BLOCK: Final = 512
"""Rows whose distances are added up at once: they stay in the nearest cache."""
_ROW_BITS: Final = 40
"""Bits of a place that hold the row; those above hold the segment."""


@kernel
def scan_partition(
    codes: NDArray[Any],
    owners: NDArray[np.int32],
    lists: NDArray[np.int64],
    low: NDArray[np.float32],
    step: NDArray[np.float32],
    centroids: NDArray[np.float32],
    alive: NDArray[np.uint8],
    queries: NDArray[np.float32],
    segment: int,
    probes: int,
    budget: int,
    distances: NDArray[np.float32],
    places: NDArray[np.int64],
    sizes: NDArray[np.int64],
) -> None:
    """Offer the living polygons of one partition to the heaps of the query rows.

    Args:
        codes: (M * D,) float32 or uint8, see `Partition.descriptors`; owners, lists, low, step, centroids likewise.
        alive: (S,) uint8, 0 where the submap in a slot is gone.
        queries: (Q, D) float32.
        segment: number of the segment, kept in the places.
        probes: nearest lists read for each query row.
        budget: most rows read for each query row in an inverted partition.
        distances, places: (Q, K), a heap for each query row with the largest distance at its root: squared descriptor
            distances, and where the polygons are (`gather_places` reads that).
        sizes: (Q,) how many each heap holds.
    """
    width, listed = len(low), len(centroids)
    sums, shift = np.empty(_BLOCK, np.float32), np.empty(width, np.float32)
    near, chosen = np.empty(max(probes, 1), np.float32), np.empty(max(probes, 1), np.int64)
    for q in range(len(queries)):
        if listed == 0:
            for d in range(width):
                shift[d] = low[d] - queries[q, d]
            sizes[q] = _scan_list(
                codes, owners, 0, len(owners), len(owners), shift, step, alive, sums,
                segment, distances[q], places[q], sizes[q],
            )  # fmt: skip
            continue
        found = 0
        for c in range(listed):
            distance = 0.0
            for d in range(width):
                difference = centroids[c, d] - queries[q, d]
                distance += difference * difference
            found = _offer(near, chosen, found, distance, c)
        sort_heap(near, chosen, found)
        left = budget
        for i in range(found):
            first, last = lists[chosen[i]], lists[chosen[i] + 1]
            if first < 0 or last > len(owners) or last <= first:
                continue
            for d in range(width):
                shift[d] = low[d] + (centroids[chosen[i], d] - queries[q, d])
            read = min(last - first, left)
            sizes[q] = _scan_list(
                codes, owners, first, read, last - first, shift, step, alive, sums,
                segment, distances[q], places[q], sizes[q],
            )  # fmt: skip
            left -= read
            if left <= 0:
                break


@kernel
def _scan_list(
    codes: NDArray[Any],
    owners: NDArray[np.int32],
    first: int,
    read: int,
    length: int,
    shift: NDArray[np.float32],
    step: NDArray[np.float32],
    alive: NDArray[np.uint8],
    sums: NDArray[np.float32],
    segment: int,
    distances: NDArray[np.float32],
    places: NDArray[np.int64],
    size: int,
) -> int:
    """Offer the first `read` rows of a list of `length` rows; how many the heap then holds."""
    width = len(shift)
    for begin in range(0, read, _BLOCK):
        rows = min(_BLOCK, read - begin)
        for r in range(rows):
            sums[r] = np.float32(0.0)
        for d in range(width):
            at = first * width + d * length + begin
            column = codes[at : at + rows]
            scale, offset = step[d], shift[d]
            for r in range(rows):
                difference = np.float32(column[r]) * scale + offset
                sums[r] += difference * difference
        worst = distances[0] if size == len(distances) else np.float32(np.inf)
        for r in range(rows):
            if sums[r] < worst:
                row = first + begin + r
                owner = owners[row]
                if 0 <= owner < len(alive) and alive[owner] != 0:
                    size = _offer(distances, places, size, sums[r], (segment << _ROW_BITS) | row)
                    if size == len(distances):
                        worst = distances[0]
    return size


@kernel
def _offer(distances: NDArray[np.float32], places: NDArray[np.int64], size: int, distance: float, place: int) -> int:
    """Put one more into a heap, in place of the farthest if it is full; how many it then holds."""
    if size < len(distances):
        at = size
        while at > 0:
            parent = (at - 1) // 2
            if not distances[parent] < distance:
                break
            distances[at], places[at] = distances[parent], places[parent]
            at = parent
        distances[at], places[at] = distance, place
        return size + 1
    if distance < distances[0]:
        _sink(distances, places, size, distance, place)
    return size


@kernel
def _sink(distances: NDArray[np.float32], places: NDArray[np.int64], size: int, distance: float, place: int) -> None:
    """Let an entry sink from the root of a heap of `size`, whose root is given up."""
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and distances[child + 1] > distances[child]:
            child += 1
        if not distances[child] > distance:
            break
        distances[at], places[at] = distances[child], places[child]
        at = child
    distances[at], places[at] = distance, place


@kernel
def sort_heap(distances: NDArray[np.float32], places: NDArray[np.int64], size: int) -> None:
    """Sort a heap of `size` entries by rising distance."""
    for last in range(size - 1, 0, -1):
        distance, place = distances[last], places[last]
        distances[last], places[last] = distances[0], places[0]
        _sink(distances, places, last, distance, place)


@kernel
def sort_heaps(
    distances: NDArray[np.float32], places: NDArray[np.int64], sizes: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int64], NDArray[np.bool_]]:
    """All heaps one after the other, each sorted: (H,) query rows, distances, places; and which segments occur."""
    total, highest = 0, 0
    for q in range(len(sizes)):
        sort_heap(distances[q], places[q], sizes[q])
        for i in range(sizes[q]):
            highest = max(highest, places[q, i] >> _ROW_BITS)
        total += sizes[q]
    out_rows, out_distances, out_places = (
        np.empty(total, np.int64),
        np.empty(total, np.float32),
        np.empty(total, np.int64),
    )
    occurs = np.zeros(highest + 1, np.bool_)
    at = 0
    for q in range(len(sizes)):
        for i in range(sizes[q]):
            out_rows[at], out_distances[at], out_places[at] = rows[q], distances[q, i], places[q, i]
            occurs[places[q, i] >> _ROW_BITS] = True
            at += 1
    return out_rows, out_distances, out_places, occurs


@kernel
def gather_places(
    places: NDArray[np.int64],
    segment: int,
    owners: NDArray[np.int32],
    outlines: NDArray[np.uint8],
    keys: NDArray[np.int64],
    units: NDArray[np.float32],
    out_keys: NDArray[np.int64],
    out_outlines: NDArray[np.float32],
) -> None:
    """Fill in keys (H,) and outlines (H, count, 2), metres, of those places that are in `segment`."""
    for i in range(len(places)):
        if places[i] >> _ROW_BITS != segment:
            continue
        row = places[i] & ((1 << _ROW_BITS) - 1)
        owner = owners[row]
        if not 0 <= owner < len(keys):  # the file was damaged since the row was found
            out_keys[i], out_outlines[i] = -1, 0.0
            continue
        out_keys[i] = keys[owner]
        draw_outline(outlines[row], units[owner], out_outlines[i])
