"""Polygons of one segment with one vertex count: plain arrays that never change, in memory or mapped from a file.

An exact partition holds descriptors as they are and is read as a whole. An inverted one has them in lists, each about a
centroid, as codes of one byte a component; a search reads the nearest lists only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features.describe import Features


class PartitionArrays(NamedTuple):
    """The arrays of a `Partition`, as kernels take them."""

    owners: NDArray[np.int32]
    outlines: NDArray[np.uint8]
    descriptors: NDArray[Any]
    low: NDArray[np.float32]
    step: NDArray[np.float32]
    centroids: NDArray[np.float32]
    lists: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Partition:
    """Polygons of one segment with one vertex count. Exact (one list, rows in any order) or inverted (rows by list).

    Attributes:
        count: vertices of each polygon.
        owners: (M,) int32, slot of the submap in the segment.
        outlines: (M, 2 * count + 3) uint8, vertices, counter-clockwise, centred submap frame, in `units[owner]` metres.
            The first one, two bytes a coordinate; how many units a step is; then from each vertex to the next, one byte
            a coordinate, in steps, made up for the rounding of those before. See `draw_outline`.
        descriptors: (M * D,) float32 (exact) or uint8 (inverted). List after list, and in a list of n rows n first
            components, then n second ones, and so on; `rows` gives them as rows.
        low, step: (D,) float32; a component is low + step * code + that of the list's centroid. Exact: 0 and 1.
        centroids: (L, D) float32; none in an exact partition.
        lists: (L + 1,) int64, where the rows of each list begin; (0, M) in an exact partition.
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
        # Kernels trust shapes, and only shapes: what the arrays hold is checked where it is read.
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
        """Whether a search reads the nearest lists only."""
        return len(self.centroids) > 0

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self.arrays().values())

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by name, for a container to hold; `of` takes them back."""
        return self.as_tuple()._asdict()

    def as_tuple(self) -> PartitionArrays:
        """All arrays as kernels take them."""
        return PartitionArrays(
            self.owners, self.outlines, self.descriptors, self.low, self.step, self.centroids, self.lists
        )

    @staticmethod
    def of(count: int, arrays: Mapping[str, NDArray[Any]]) -> "Partition":
        """The partition that `arrays` came from; other names are ignored.

        Raises:
            KeyError: an array is missing.
            ValueError: an array of a wrong type or shape.
        """
        # A subclass such as `np.memmap` costs the compiler's dispatch far more time than a plain array.
        return Partition(count, *(np.asarray(arrays[name]) for name in PartitionArrays._fields))

    def rows(self) -> NDArray[np.float32]:
        """Descriptors (M, D) float32 row by row; NaN in rows that no list holds, which only damage brings about."""
        return self.decode(self.lists_of_rows(), np.arange(len(self)))

    def decode(self, lists_of_rows: NDArray[np.int32], rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """Descriptors (K, D) float32 of the given rows (K,); NaN where `lists_of_rows` (M,) has no list."""
        return _decode(self.as_tuple(), lists_of_rows, rows)

    def lists_of_rows(self) -> NDArray[np.int32]:
        """The list (M,) int32 that each row is in; -1 where none holds it."""
        return _lists_of_rows(self.lists, len(self))


def exact_partition(
    owners: NDArray[np.int32], outlines: NDArray[np.uint8], descriptors: NDArray[np.float32]
) -> Partition:
    """An exact partition of polygons given by rows: owners (M,), outlines (M, 2 * count + 3), descriptors (M, D)."""
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
    """Exact partitions by vertex count of the polygons of submaps; `features[i]` is in slot i.

    Args:
        units: (S,) float32, metres that each submap's outlines are measured in. Coordinates beyond 32,767 of them are
            cut off there.

    Raises:
        ValueError: not as many units as features, or one that is not positive.
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
    """Outlines as a partition has them; the `count` vertices of each begin at `starts` (K,) of `points` (V, 2)."""
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
        # Rounding shifts a vertex by half a step at most, which the next one has to make up for.
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
    """Fill in the vertices `out` (count, 2), metres, of a packed outline (2 * count + 3,)."""
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
        # Asked outright: the length of a range from one end of the integers to the other overflows.
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
