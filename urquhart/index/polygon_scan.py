"""The compiled search of one partition of polygons: distances list by list, the nearest polygons in a heap.

Lists are stored by column: in a list of n rows come n first components, then n second ones, and so on. One instruction
then works on many rows, and a list is read five times as fast as row by row.

A file can be damaged. Whatever values the arrays hold, nothing is read outside of them; invalid entries are skipped.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.polygon_partition import draw_outline

_BLOCK: Final = 512
"""Rows whose distances are summed together: so many stay in the first-level cache."""
_ROW_BITS: Final = 40
"""Bits of an address that hold the row; the bits above hold the number of the segment."""


class Scan(NamedTuple):
    """One partition to be searched. It is flat, because numba dispatches more slowly on nested tuples.

    Attributes:
        owners, codes, low, step, centroids, lists: see `Partition`; the codes are its `descriptors`.
        alive: (S,) uint8, 0 for slots whose submap was deleted or replaced.
        segment: number of the segment, which becomes part of the addresses.
        probes: nearest lists that are read for each query row.
        budget: most rows that are read for each query row in an inverted partition.
    """

    owners: NDArray[np.int32]
    codes: NDArray[Any]
    low: NDArray[np.float32]
    step: NDArray[np.float32]
    centroids: NDArray[np.float32]
    lists: NDArray[np.int64]
    alive: NDArray[np.uint8]
    segment: int
    probes: int
    budget: int


class Heaps(NamedTuple):
    """The nearest polygons of each query row, in a heap with the largest distance at its root.

    Attributes:
        distances: (Q, K) float32, squared descriptor distances.
        addresses: (Q, K) int64, segment and row of each polygon; `gather_addresses` resolves them.
        sizes: (Q,) int64, entries in each heap.
    """

    distances: NDArray[np.float32]
    addresses: NDArray[np.int64]
    sizes: NDArray[np.int64]


@kernel
def scan_partition(scan: Scan, queries: NDArray[np.float32], heaps: Heaps) -> None:
    """Offer the living polygons of one partition to the heaps of the query descriptors (Q, D)."""
    owners, low, centroids, lists = scan.owners, scan.low, scan.centroids, scan.lists
    width, listed, probes = len(low), len(centroids), max(scan.probes, 1)
    shift = np.empty(width, np.float32)
    near, chosen = np.empty(probes, np.float32), np.empty(probes, np.int64)
    for q in range(len(queries)):
        if listed == 0:
            for d in range(width):
                shift[d] = low[d] - queries[q, d]
            _scan_list(scan, (0, len(owners), len(owners)), shift, heaps, q)
            continue
        found = 0
        for c in range(listed):
            distance = 0.0
            for d in range(width):
                difference = centroids[c, d] - queries[q, d]
                distance += difference * difference
            found = _offer(near, chosen, found, distance, c)
        sort_heap(near, chosen, found)
        left = scan.budget
        for i in range(found):
            first, last = lists[chosen[i]], lists[chosen[i] + 1]
            if first < 0 or last > len(owners) or last <= first:
                continue
            for d in range(width):
                shift[d] = low[d] + (centroids[chosen[i], d] - queries[q, d])
            read = min(last - first, left)
            _scan_list(scan, (first, read, last - first), shift, heaps, q)
            left -= read
            if left <= 0:
                break


@kernel
def _scan_list(scan: Scan, listed: tuple[int, int, int], shift: NDArray[np.float32], heaps: Heaps, q: int) -> None:
    """Offer rows of one list to the heap of query row `q`.

    `listed`: first row of the list, how many of its rows are read, and how many it has.
    """
    owners, codes, step, alive, segment = scan.owners, scan.codes, scan.step, scan.alive, scan.segment
    first, read, length = listed
    distances, addresses, size = heaps.distances[q], heaps.addresses[q], heaps.sizes[q]
    width, sums = len(shift), np.empty(_BLOCK, np.float32)
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
                    size = _offer(distances, addresses, size, sums[r], (segment << _ROW_BITS) | row)
                    if size == len(distances):
                        worst = distances[0]
    heaps.sizes[q] = size


@kernel
def _offer(
    distances: NDArray[np.float32], addresses: NDArray[np.int64], size: int, distance: float, address: int
) -> int:
    """Add an entry to a heap, in place of the farthest one if it is full; returns the new number of entries."""
    if size < len(distances):
        at = size
        while at > 0:
            parent = (at - 1) // 2
            if not distances[parent] < distance:
                break
            distances[at], addresses[at] = distances[parent], addresses[parent]
            at = parent
        distances[at], addresses[at] = distance, address
        return size + 1
    if distance < distances[0]:
        _sink(distances, addresses, size, distance, address)
    return size


@kernel
def _sink(
    distances: NDArray[np.float32], addresses: NDArray[np.int64], size: int, distance: float, address: int
) -> None:
    """Replace the root of a heap of `size` entries by a new entry, and sift that down."""
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and distances[child + 1] > distances[child]:
            child += 1
        if not distances[child] > distance:
            break
        distances[at], addresses[at] = distances[child], addresses[child]
        at = child
    distances[at], addresses[at] = distance, address


@kernel
def sort_heap(distances: NDArray[np.float32], addresses: NDArray[np.int64], size: int) -> None:
    """Sort a heap of `size` entries by rising distance."""
    for last in range(size - 1, 0, -1):
        distance, address = distances[last], addresses[last]
        distances[last], addresses[last] = distances[0], addresses[0]
        _sink(distances, addresses, last, distance, address)


@kernel
def sort_heaps(
    heaps: Heaps, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int64], NDArray[np.bool_]]:
    """Sort all heaps, and concatenate them.

    Returns:
        Query rows (H,), distances (H,), addresses (H,); and (G,) bool, which segments occur among the addresses.
    """
    distances, addresses, sizes = heaps
    total, highest = 0, 0
    for q in range(len(sizes)):
        sort_heap(distances[q], addresses[q], sizes[q])
        for i in range(sizes[q]):
            highest = max(highest, addresses[q, i] >> _ROW_BITS)
        total += sizes[q]
    out_rows, out_distances, out_addresses = (
        np.empty(total, np.int64),
        np.empty(total, np.float32),
        np.empty(total, np.int64),
    )
    occurs = np.zeros(highest + 1, np.bool_)
    at = 0
    for q in range(len(sizes)):
        for i in range(sizes[q]):
            out_rows[at], out_distances[at], out_addresses[at] = rows[q], distances[q, i], addresses[q, i]
            occurs[addresses[q, i] >> _ROW_BITS] = True
            at += 1
    return out_rows, out_distances, out_addresses, occurs


class Outlines(NamedTuple):
    """The outlines of one partition, and the submaps they belong to.

    Attributes:
        segment: number of the segment, as in the addresses.
        owners, outlines: see `Partition`.
        keys: (S,) int64, the submap in each slot.
        units: (S,) float32, metres, the unit of the submap's outlines.
    """

    segment: int
    owners: NDArray[np.int32]
    outlines: NDArray[np.uint8]
    keys: NDArray[np.int64]
    units: NDArray[np.float32]


@kernel
def gather_addresses(
    addresses: NDArray[np.int64],
    source: Outlines,
    out_keys: NDArray[np.int64],
    out_outlines: NDArray[np.float32],
) -> None:
    """Fill in keys (H,) and outlines (H, count, 2), metres, of the addresses (H,) in the source's segment."""
    owners, outlines, keys, units = source.owners, source.outlines, source.keys, source.units
    for i in range(len(addresses)):
        if addresses[i] >> _ROW_BITS != source.segment:
            continue
        row = addresses[i] & ((1 << _ROW_BITS) - 1)
        owner = owners[row]
        if not 0 <= owner < len(keys):  # the file was damaged since the row was found
            out_keys[i], out_outlines[i] = -1, 0.0
            continue
        out_keys[i] = keys[owner]
        draw_outline(outlines[row], units[owner], out_outlines[i])
