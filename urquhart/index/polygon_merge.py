"""The partitions of several segments merged into one. Polygons of deleted and replaced submaps are dropped.

Besides the result, a merge needs memory for one block of rows, and a few bytes for each row of one vertex count.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.index.polygon_partition import Partition, PartitionArrays


class PolygonMergeNumbers(NamedTuple):
    """How partitions are merged and their lists trained. Chosen by hand, not fitted."""

    exact_below: int = 50_000
    """Partitions with no more polygons than this stay exact, and are read as a whole."""
    block: int = 65_536
    """Rows that are processed at once."""
    sample: int = 64
    """Rows that each centroid is trained on."""
    rounds: int = 10
    """Rounds of k-means; later ones hardly move the centroids."""
    finest: float = 1e-5
    """Least step of a code, as a share of the values it encodes. With it, decoding and encoding again gives the same
    code."""


MERGE: Final = PolygonMergeNumbers()
_SEED: Final = 1


@dataclass(frozen=True, slots=True, eq=False)
class _Input:
    """One of the partitions to merge.

    Attributes:
        slots: (S,) int32, the new slot of each old one, -1 for submaps to be dropped.
        lists_of_rows: (M,) int32, the list that each row is in; -1 for rows to be dropped.
    """

    partition: Partition
    slots: NDArray[np.int32]
    lists_of_rows: NDArray[np.int32]

    @property
    def kept(self) -> int:
        return int(np.count_nonzero(self.lists_of_rows >= 0))

    def decode(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        return self.partition.decode(self.lists_of_rows, rows)

    def blocks(self) -> Iterator[NDArray[np.int64]]:
        """The rows that are kept, block by block."""
        for begin in range(0, len(self.partition), MERGE.block):
            rows = begin + np.flatnonzero(self.lists_of_rows[begin : begin + MERGE.block] >= 0)
            if len(rows):
                yield rows


@dataclass(frozen=True, slots=True, eq=False)
class _Coder:
    """How descriptors are encoded: `centroids` (L, D), `low` (D,) and `step` (D,), all float32; see `Partition`."""

    centroids: NDArray[np.float32]
    low: NDArray[np.float32]
    step: NDArray[np.float32]


def merge_partitions(
    parts: Sequence[tuple[Mapping[int, Partition], NDArray[np.int32]]], *, exact_below: int = MERGE.exact_below
) -> dict[int, Partition]:
    """The partitions of several segments, merged into those of one segment.

    Up to `exact_below` polygons with one vertex count make an exact partition. More of them make an inverted one. Its
    centroids are those of the largest inverted input, if that holds more than a quarter of the polygons and has lists
    of a suitable length. Otherwise they are trained by k-means, on a sample that depends only on the inputs.

    Args:
        parts: for each segment its partitions by vertex count, and `slots` (S,) int32: the new slot of each old one, -1
            for submaps to be dropped.
        exact_below: polygons up to which a partition is exact.
    """
    merged = {}
    for count in sorted({count for partitions, _ in parts for count in partitions}):
        inputs = [_input(partitions[count], slots) for partitions, slots in parts if count in partitions]
        partition = _merge(count, [part for part in inputs if part.kept], exact_below)
        if partition is not None:
            merged[count] = partition
    return merged


def _input(partition: Partition, slots: NDArray[np.int32]) -> _Input:
    lists_of_rows = partition.lists_of_rows()
    _drop(partition.owners, slots, lists_of_rows)
    part = _Input(partition, slots, lists_of_rows)
    for rows in part.blocks():
        lists_of_rows[rows[~np.isfinite(part.decode(rows)).all(axis=1)]] = -1
    return part


def _merge(count: int, inputs: list[_Input], exact_below: int) -> Partition | None:
    total = sum(part.kept for part in inputs)
    if not total:
        return None
    if total <= exact_below:
        width = len(inputs[0].partition.low)
        plain = _Coder(np.empty((0, width), np.float32), np.zeros(width, np.float32), np.ones(width, np.float32))
        return _fill(count, inputs, plain, [np.minimum(part.lists_of_rows, 0) for part in inputs])
    base = max(inputs, key=lambda part: part.kept if part.partition.inverted else 0)
    if base.partition.inverted and 4 * base.kept > total and _fair(len(base.partition.centroids), total):
        p = base.partition
        inputs = [base, *(part for part in inputs if part is not base)]
        listed = [base.lists_of_rows, *_assign(inputs[1:], p.centroids)[0]]
        return _fill(count, inputs, _Coder(p.centroids, p.low, p.step), listed)
    centroids = _train(inputs, total)
    listed, (lowest, highest, largest) = _assign(inputs, centroids)
    step = np.maximum((highest - lowest) / 255.0, MERGE.finest * largest)
    step[step == 0.0] = 1.0
    return _fill(count, inputs, _Coder(centroids, lowest.astype(np.float32), step.astype(np.float32)), listed)


def _lists(rows: int) -> int:
    return max(round(math.sqrt(rows)), 1)


def _fair(lists: int, rows: int) -> bool:
    """Whether a number of lists is within a factor of two of the best one for so many rows."""
    return 0.5 <= lists / _lists(rows) <= 2.0


def _faiss() -> Any:
    """FAISS, with one thread. Only large merges need it, so no other process spends 14 MB on it.

    OpenMP keeps its thread count by calling thread, so it is set at every use and not once at start.
    """
    import faiss

    faiss.omp_set_num_threads(1)
    return faiss


def _train(inputs: list[_Input], total: int) -> NDArray[np.float32]:
    lists = _lists(total)
    rng = np.random.default_rng(_SEED)
    share = min(1.0, lists * MERGE.sample / total)
    chosen = [
        part.decode(rows[rng.permutation(len(rows))[: math.ceil(share * len(rows))]])
        for part in inputs
        for rows in part.blocks()
    ]
    sample = np.concatenate(chosen)
    means = _faiss().Kmeans(
        sample.shape[1],
        lists,
        niter=MERGE.rounds,
        seed=_SEED,
        min_points_per_centroid=1,
        max_points_per_centroid=2 * MERGE.sample,
    )
    means.train(sample)
    return np.ascontiguousarray(means.centroids, np.float32)


def _assign(
    inputs: list[_Input], centroids: NDArray[np.float32]
) -> tuple[list[NDArray[np.int32]], NDArray[np.float64]]:
    """The nearest centroid of each row, and how far components lie from those of their centroid.

    Returns:
        For each input, the centroid of each row: (M,) int32, -1 for rows that are dropped. And bounds (3, D) float64 by
        component: the least and the largest difference from the centroid, and the largest absolute value.
    """
    listed = [np.full(len(part.partition), -1, np.int32) for part in inputs]
    bounds = np.full((3, centroids.shape[1]), -np.inf)
    quantizer = _faiss().IndexFlatL2(centroids.shape[1])
    quantizer.add(centroids)
    for batch in _batches(inputs):
        decoded = np.concatenate([inputs[i].decode(rows) for i, rows in batch])
        near = quantizer.search(decoded, 1)[1][:, 0]
        off = decoded - centroids[near]
        bounds = np.maximum(bounds, [(-off).max(axis=0), off.max(axis=0), np.abs(decoded).max(axis=0)])
        at = 0
        for i, rows in batch:
            listed[i][rows] = near[at : at + len(rows)]
            at += len(rows)
    return listed, bounds * [[-1.0], [1.0], [1.0]]


def _batches(inputs: list[_Input]) -> Iterator[list[tuple[int, NDArray[np.int64]]]]:
    """The rows that are kept, with the number of their input, in batches of at least a block: FAISS is faster so."""
    batch, size = [], 0
    for i, part in enumerate(inputs):
        for rows in part.blocks():
            batch.append((i, rows))
            size += len(rows)
            if size >= MERGE.block:
                yield batch
                batch, size = [], 0
    if batch:
        yield batch


def _fill(count: int, inputs: list[_Input], coder: _Coder, listed: list[NDArray[np.int32]]) -> Partition:
    """The merged partition: every row that has a list is put into it, in the order of the inputs."""
    lengths = np.zeros(max(len(coder.centroids), 1), np.int64)
    for lists_of_rows in listed:
        lengths += np.bincount(lists_of_rows[lists_of_rows >= 0], minlength=len(lengths))
    lists = np.concatenate([[0], np.cumsum(lengths)])
    rows, width = int(lists[-1]), len(coder.low)
    code: Any = np.uint8 if len(coder.centroids) else np.float32
    merged = Partition(
        count,
        np.empty(rows, np.int32),
        np.empty((rows, 2 * count + 3), np.uint8),
        np.empty(rows * width, code),
        coder.low,
        coder.step,
        coder.centroids,
        lists,
    )
    ends = lists[:-1].copy()
    for part, lists_of_rows in zip(inputs, listed, strict=True):
        for block in part.blocks():
            owners, outlines = part.slots[part.partition.owners[block]], part.partition.outlines[block]
            _place(part.decode(block), lists_of_rows[block], owners, outlines, merged.as_tuple(), ends)
    return merged


@kernel
def _drop(owners: NDArray[np.int32], slots: NDArray[np.int32], lists_of_rows: NDArray[np.int32]) -> None:
    """Drop rows whose submap is to be dropped, or whose owner is no slot: their entry in `lists_of_rows` becomes -1."""
    for row in range(len(owners)):
        owner = owners[row]
        if owner < 0 or owner >= len(slots) or slots[owner] < 0:
            lists_of_rows[row] = -1


@kernel
def _place(
    decoded: NDArray[np.float32],
    listed: NDArray[np.int32],
    owners: NDArray[np.int32],
    outlines: NDArray[np.uint8],
    merged: PartitionArrays,
    ends: NDArray[np.int64],
) -> None:
    """Append rows to the lists `listed` (K,) of a merged partition; `ends` (L,) is the end of each list, updated."""
    out_owners, out_outlines, out_codes, low, step, centroids, lists = merged
    width = len(low)
    for i in range(len(listed)):
        c = listed[i]
        if c < 0:
            continue
        first, length, at = lists[c], lists[c + 1] - lists[c], ends[c]
        ends[c] += 1
        out_owners[at] = owners[i]
        for b in range(outlines.shape[1]):
            out_outlines[at, b] = outlines[i, b]
        for d in range(width):
            value = decoded[i, d]
            if len(centroids):
                value = min(max(np.round((value - centroids[c, d] - low[d]) / step[d]), 0.0), 255.0)
            out_codes[first * width + d * length + at - first] = value
