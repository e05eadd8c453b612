"""The polygons of one segment with one vertex count: immutable arrays, in memory or mapped from a file.

An exact partition holds the descriptors themselves, and is read as a whole. An inverted one holds them in lists, one
for each centroid, as codes of one byte a component; a search reads only the lists with the nearest centroids.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features.describe import Features


class PartitionArrays(NamedTuple):
    """The arrays of a `Partition`, as a plain tuple for kernels."""

    owners: NDArray[np.int32]
    outlines: NDArray[np.uint8]
    descriptors: NDArray[Any]
    low: NDArray[np.float32]
    step: NDArray[np.float32]
    centroids: NDArray[np.float32]
    lists: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Partition:
    """M polygons of one segment with one vertex count: exact (one list) or inverted (rows sorted by list).

    Attributes:
        count: vertices of each polygon.
        owners: (M,) int32, the slot of each polygon's submap in the segment.
        outlines: (M, 2 * count + 3) uint8, the vertices, counter-clockwise, centred submap frame, in units of the
            submap (`Segment.units`, metres): the first vertex, two bytes a coordinate; the units in a step; then the
            way from each vertex to the next, one byte a coordinate, in steps. Each vertex makes up for the rounding of
            those before. `draw_outline` unpacks them.
        descriptors: (M * D,) float32 (exact) or uint8 (inverted), list after list; within a list of n rows, n first
            components, then n second ones, and so on. `rows` unpacks them.
        low, step: (D,) float32; a component is low + step * code, plus that of the list's centroid. Exact: 0 and 1.
        centroids: (L, D) float32; L is 0 in an exact partition.
        lists: (L + 1,) int64, where the rows of each list begin; (0, M) in an exact partition.

    Raises:
        ValueError: an array of a wrong type or shape.
    """

    count: int
    owners: NDArray[np.int32]
    outlines: NDArray[np.uint8]
    descriptors: NDArray[Any]
    low: NDArray[np.float32]
    step: NDArray[np.float32]
    centroids: NDArray[np.float32]
    lists: NDArray[np.int64]

    def __post_init__(self) -> None:
        rows, width, listed = len(self.owners), len(self.low), len(self.centroids)
        code = np.uint8 if listed else np.float32
        wanted: dict[str, tuple[Any, tuple[int, ...]]] = {
            "owners": (np.int32, (rows,)),
            "outlines": (np.uint8, (rows, 2 * self.count + 3)),
            "descriptors": (code, (rows * width,)),
            "low": (np.float32, (width,)),
            "step": (np.float32, (width,)),
            "centroids": (np.float32, (listed, width)),
            "lists": (np.int64, (max(listed, 1) + 1,)),
        }
        # Kernels rely on shapes, and only on shapes: values are checked where they are read.
        for name, (dtype, shape) in wanted.items():
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f"{name} of polygons with {self.count} vertices: {array.dtype} {array.shape}, "
                    f"{np.dtype(dtype)} {shape} expected"
                )

    def __len__(self) -> int:
        return len(self.owners)

    @property
    def inverted(self) -> bool:
        """Whether a search reads only the nearest lists."""
        return len(self.centroids) > 0

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self.arrays().values())

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by name, to be stored; `of` is the inverse."""
        return self.as_tuple()._asdict()

    def as_tuple(self) -> PartitionArrays:
        """All arrays as a plain tuple for kernels."""
        return PartitionArrays(
            self.owners, self.outlines, self.descriptors, self.low, self.step, self.centroids, self.lists
        )

    @staticmethod
    def of(count: int, arrays: Mapping[str, NDArray[Any]]) -> "Partition":
        """The partition with these `arrays`, as `arrays()` returned them; other names are ignored.

        Raises:
            KeyError: an array is missing.
            ValueError: an array of a wrong type or shape.
        """
        # numba dispatches far more slowly on a subclass such as `np.memmap` than on a plain array.
        return Partition(count, *(np.asarray(arrays[name]) for name in PartitionArrays._fields))

    def rows(self) -> NDArray[np.float32]:
        """Descriptors (M, D) float32, row by row; NaN in rows that no list holds (a damaged file)."""
        return self.decode(self.lists_of_rows(), np.arange(len(self)))

    def decode(self, lists_of_rows: NDArray[np.int32], rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """Descriptors (K, D) float32 of `rows` (K,); NaN for rows that have no list in `lists_of_rows` (M,)."""
        return _decode(self.as_tuple(), lists_of_rows, rows)

    def lists_of_rows(self) -> NDArray[np.int32]:
        """The list (M,) int32 that each row is in; -1 for rows that are in none."""
        return _lists_of_rows(self.lists, len(self))


def exact_partition(
    owners: NDArray[np.int32], outlines: NDArray[np.uint8], descriptors: NDArray[np.float32]
) -> Partition:
    """An exact partition of M polygons: owners (M,), packed outlines (M, 2 * count + 3), descriptors (M, D)."""
    width = descriptors.shape[1]
    return Partition(
        (outlines.shape[1] - 3) // 2,
        owners,
        outlines,
        np.ascontiguousarray(descriptors.T).ravel(),
        np.zeros(width, np.float32),
        np.ones(width, np.float32),
        np.empty((0, width), np.float32),
        np.array([0, len(owners)], np.int64),
    )


def build_partitions(features: Sequence[Features], units: NDArray[np.float32]) -> dict[int, Partition]:
    """The polygons of S submaps in exact partitions, by vertex count; `features[i]` gets slot i.

    Args:
        units: (S,) float32, metres, the unit of each submap's outlines. Coordinates are clipped at 32,767 units.

    Raises:
        ValueError: the number of units differs from that of features, or a unit is not positive.
    """
    units = np.asarray(units, np.float32)
    if len(units) != len(features) or not np.all(units > 0.0):
        raise ValueError("each submap needs a positive unit")
    if not features:
        return {}
    polygons = np.array([len(f.tessellation) for f in features], np.int64)
    owners = np.repeat(np.arange(len(features), dtype=np.int32), polygons)
    counts = np.concatenate([f.tessellation.vertex_counts() for f in features])
    points = np.concatenate([f.landmarks[f.tessellation.vertices] for f in features])
    descriptors = np.concatenate([f.descriptors for f in features])
    starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    partitions = {}
    for count in np.unique(counts).tolist():
        chosen = np.flatnonzero(counts == count)
        outlines = pack_outlines(points, starts[chosen], count, units[owners[chosen]])
        partitions[count] = exact_partition(owners[chosen], outlines, descriptors[chosen])
    return partitions


@kernel
def pack_outlines(
    points: NDArray[np.float64], starts: NDArray[np.int64], count: int, units: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Packed outlines (K, 2 * count + 3) uint8 of polygons with `count` vertices; see `Partition.outlines`.

    `points`: (V, 2), metres, vertices of all polygons; `starts`: (K,), where each polygon's vertices begin; `units`:
    (K,), metres.
    """
    outlines = np.empty((len(starts), 2 * count + 3), np.uint8)
    wanted = np.empty((count, 2), np.int64)
    for i in range(len(starts)):
        longest = 0
        for v in range(count):
            for k in range(2):
                steps = np.round(points[starts[i] + v, k] / units[i])
                wanted[v, k] = np.int64(min(max(steps, -32_767.0), 32_767.0))
                if v > 0:
                    longest = max(longest, int(abs(wanted[v, k] - wanted[v - 1, k])))
        # Rounding shifts a vertex by at most half a step, and the next vertex makes up for it.
        step = int(min(max((longest + 125) // 126, 1), 255))
        outlines[i, 4] = step
        for k in range(2):
            place = int(wanted[0, k])
            outlines[i, 2 * k], outlines[i, 2 * k + 1] = place & 255, (place >> 8) & 255
            for v in range(1, count):
                moved = int(min(max(np.round((wanted[v, k] - place) / step), -127.0), 127.0))
                place += moved * step
                outlines[i, 2 * v + 3 + k] = moved & 255
    return outlines


@kernel
def draw_outline(packed: NDArray[np.uint8], unit: float, out: NDArray[np.float32]) -> None:
    """Fill `out` (count, 2), metres, with the vertices of a packed outline (2 * count + 3,); `unit`: metres."""
    step = np.int64(packed[4])
    for k in range(2):
        place = ((np.int64(packed[2 * k + 1]) ^ 128) - 128) * 256 + np.int64(packed[2 * k])
        out[0, k] = place * unit
        for v in range(1, len(out)):
            place += ((np.int64(packed[2 * v + 3 + k]) ^ 128) - 128) * step
            out[v, k] = place * unit


@kernel
def _lists_of_rows(lists: NDArray[np.int64], rows: int) -> NDArray[np.int32]:
    found = np.full(rows, -1, np.int32)
    for c in range(len(lists) - 1):
        first, last = lists[c], lists[c + 1]
        # The ends are compared: in a damaged file, the length of a range may overflow.
        if first < 0 or last > rows or last <= first:
            continue
        for row in range(first, last):
            if found[row] < 0:
                found[row] = c
    return found


@kernel
def _decode(
    partition: PartitionArrays, lists_of_rows: NDArray[np.int32], rows: NDArray[np.int64]
) -> NDArray[np.float32]:
    _, _, codes, low, step, centroids, lists = partition
    width = len(low)
    decoded = np.empty((len(rows), width), np.float32)
    for i in range(len(rows)):
        c = lists_of_rows[rows[i]]
        if c < 0:
            decoded[i] = np.nan
            continue
        first, length = lists[c], lists[c + 1] - lists[c]
        for d in range(width):
            code = np.float32(codes[first * width + d * length + rows[i] - first])
            decoded[i, d] = low[d] + step[d] * code
            if len(centroids):
                decoded[i, d] += centroids[c, d]
    return decoded
