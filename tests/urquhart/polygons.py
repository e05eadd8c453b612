"""Partitions of polygons for tests."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.evaluation.simulation import paper_forest
from urquhart.features.describe import Features, describe
from urquhart.index.polygon_partition import draw_outline, exact_partition, pack_outlines
from urquhart.index.polygon_search import (
    Partition,
    PolygonHits,
    Searched,
    merge_partitions,
    search_partitions,
)

D = 11
Rows = NDArray[np.float32]


def random_partition(rng: np.random.Generator, rows: int, slots: int, count: int = 5) -> Partition:
    """Polygons with nothing but chance in them."""
    return exact_partition(
        rng.integers(0, slots, rows).astype(np.int32),
        packed(rng.uniform(-9.0, 9.0, (rows, count, 2))),
        rng.normal(0.0, 5.0, (rows, D)).astype(np.float32),
    )


def searched(partitions: Iterable[Partition], slots: int, first_key: int = 0) -> Searched:
    """A segment of living submaps, millimetres their unit, with keys from `first_key` on."""
    return (
        {p.count: p for p in partitions},
        first_key + np.arange(slots, dtype=np.int64),
        np.full(slots, 0.001, np.float32),
        np.ones(slots, np.bool_),
    )


def whole(slots: int) -> NDArray[np.int32]:
    """Slots that stay what they are."""
    return np.arange(slots, dtype=np.int32)


def find(segments: list[Searched], row: Rows, neighbours: int, count: int = 5) -> PolygonHits:
    """What one query polygon finds."""
    [hits] = search_partitions(segments, np.array([count], np.int32), row[None], neighbours=neighbours)
    return hits


def same(one: Partition, other: Partition) -> bool:
    """Whether two partitions are alike to the last byte."""
    pairs = zip(one.arrays().values(), other.arrays().values(), strict=True)
    return one.count == other.count and all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)


def pentagons() -> tuple[Partition, Rows]:
    """Pentagons of a forest seen ten times over with some noise, and twice more as queries."""
    rng = np.random.default_rng(0)
    features = describe(paper_forest(rng, 1_100.0), Config())
    pentagons = features.descriptors[features.tessellation.vertex_counts() == 5]
    seen = np.concatenate([pentagons + rng.normal(0.0, 0.6, pentagons.shape) for _ in range(12)]).astype(np.float32)
    stored, queries = np.split(seen, [10 * len(pentagons)])
    owners = np.arange(len(stored), dtype=np.int32) % 1_000
    return exact_partition(owners, packed(rng.uniform(-9.0, 9.0, (len(stored), 5, 2))), stored), queries


def listed_pentagons(stored: Partition) -> Partition:
    """The same in lists."""
    return merge_partitions([({5: stored}, whole(1_000))], exact_below=1_000)[5]


def small_submaps() -> list[Features]:
    """Submaps with few polygons, one of them with none."""
    rng = np.random.default_rng(5)
    few = [describe(rng.uniform(-30.0, 30.0, (n, 2)), Config()) for n in (60, 3, 120, 80, 40)]
    assert len(few[1].tessellation) == 0
    return few


def units(submaps: list[Features]) -> NDArray[np.float32]:
    """The unit of each submap's outlines, metres."""
    return np.array([np.abs(f.landmarks).max() / 32_000.0 for f in submaps], np.float32)


def packed(outlines: NDArray[np.float64], unit: float = 0.001) -> NDArray[np.uint8]:
    """Outlines (K, count, 2), metres, as a partition has them."""
    kept, count, _ = outlines.shape
    starts = np.arange(kept, dtype=np.int64) * count
    return pack_outlines(outlines.reshape(-1, 2), starts, count, np.full(kept, unit, np.float32))


def drawn(partition: Partition, units: NDArray[np.float32]) -> NDArray[np.float32]:
    """The outlines (M, count, 2) of a partition, metres; `units` (S,)."""
    outlines = np.empty((len(partition), partition.count, 2), np.float32)
    for row, owner in enumerate(partition.owners.tolist()):
        draw_outline(partition.outlines[row], float(units[owner]), outlines[row])
    return outlines
