"""The index of one collection: segments of quads and polygons, each with a mask of the submaps that are still part.

An index is immutable. Adding and removing submaps makes a new one, which shares all but the small segments, and each
query searches the view it started with. The index is derived from features and can be rebuilt at any time.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import UNBOUNDED, Budget
from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.polygon_search import PolygonHits, search_partitions
from urquhart.index.quad_search import QuadShard
from urquhart.index.segment import Segment, merge_segments


class SegmentNumbers(NamedTuple):
    """How segments in memory are merged. Chosen by hand, not fitted."""

    fanout: int = 4
    """A segment in memory is merged with the one before it if that is less than this many times as large."""


SEGMENTS: Final = SegmentNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class LiveSegment:
    """A segment with a mask: deleted and replaced submaps stay in the segment, but are not found.

    Attributes:
        segment: of S submaps.
        alive: (S,) uint8, 1 for the submaps that are part of the collection.
        living: how many those are.
    """

    segment: Segment
    alive: NDArray[np.uint8]
    living: int

    @staticmethod
    def of(segment: Segment) -> "LiveSegment":
        """A segment of which every submap is part of the collection."""
        return LiveSegment(segment, np.ones(len(segment), np.uint8), len(segment))

    def without(self, keys: NDArray[np.int64]) -> "LiveSegment":
        """A copy without the submaps `keys` (K,) int64; unknown keys are ignored."""
        slots = self.segment.slots(keys)
        slots = slots[slots >= 0]
        if not self.alive[slots].any():
            return self
        alive = self.alive.copy()
        alive[slots] = 0
        return LiveSegment(self.segment, alive, int(np.count_nonzero(alive)))

    def only(self, keys: NDArray[np.int64]) -> "LiveSegment":
        """A copy that keeps only the submaps `keys` (K,) int64; unknown keys are ignored."""
        slots = self.segment.slots(keys)
        alive = np.zeros_like(self.alive)
        slots = slots[slots >= 0]
        alive[slots] = self.alive[slots]
        return LiveSegment(self.segment, alive, int(np.count_nonzero(alive)))


@dataclass(frozen=True, slots=True, eq=False)
class CollectionIndex:
    """The segments of one collection, the oldest first. Each submap is alive in exactly one of them.

    Attributes:
        config: parameters of the method.
        live_segments: segments from files first, then those in memory.
    """

    config: Config
    live_segments: tuple[LiveSegment, ...] = ()
    _count: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_count", sum(part.living for part in self.live_segments))

    def __len__(self) -> int:
        return self._count

    def __contains__(self, key: int) -> bool:
        wanted = np.array([key], np.int64)
        return any(part.alive[slot] for part in self.live_segments for slot in part.segment.slots(wanted) if slot >= 0)

    def __iter__(self) -> Iterator[int]:
        """The keys of all submaps, segment by segment."""
        for part in self.live_segments:
            yield from part.segment.keys[part.alive > 0].tolist()

    def with_changes(
        self, added: Iterable[tuple[int, Features]] = (), removed: Iterable[int] = ()
    ) -> "CollectionIndex":
        """A new index with submaps added or replaced, and others removed. Many at once are far cheaper.

        Raises:
            ValueError: features made with another configuration.
        """
        new = dict(added)
        segment = Segment.build(new.items(), self.config)
        gone = np.array([*removed, *new], np.int64)
        parts = [part.without(gone) for part in self.live_segments] if len(gone) else list(self.live_segments)
        if len(segment):
            parts.append(LiveSegment.of(segment))
        return CollectionIndex(self.config, tuple(_tidied(parts)))

    def narrowed(self, only: Collection[int] | None, excluded: Collection[int]) -> "CollectionIndex":
        """The index restricted to the keys `only`, if given, and without the keys `excluded`; both by masks."""
        if only is None and not excluded:
            return self
        chosen = self.live_segments
        if only is not None:
            keys = np.fromiter(only, np.int64, len(only))
            chosen = tuple(part.only(keys) for part in chosen)
        if excluded:
            keys = np.fromiter(excluded, np.int64, len(excluded))
            chosen = tuple(part.without(keys) for part in chosen)
        return CollectionIndex(self.config, chosen)

    def quad_shards(self) -> list[QuadShard]:
        """The quads of all segments that have living submaps, ready for search."""
        return [QuadShard(p.segment.quads, p.segment.scales, p.alive) for p in self.live_segments if p.living]

    def search_polygons(
        self,
        counts: NDArray[np.int32],
        descriptors: NDArray[np.float32],
        neighbours: int,
        window: int = 0,
        budget: Budget = UNBOUNDED,
    ) -> Iterator[PolygonHits]:
        """The nearest `neighbours` living polygons of each query polygon; see `search_partitions`.

        Args:
            counts: (Q,) int32, vertices of each query polygon.
            descriptors: (Q, D) float32, their descriptors.
            neighbours: most hits for each query polygon and vertex count.
            window: largest difference in vertex count of a polygon that is found.
            budget: when the search must end; by default never.

        Raises:
            Abandoned: nobody waits for the hits any more.
        """
        searched = [
            (p.segment.polygons, p.segment.keys, p.segment.units, p.alive) for p in self.live_segments if p.living
        ]
        return search_partitions(searched, counts, descriptors, neighbours=neighbours, window=window, budget=budget)

    def keys_of(self, slots: NDArray[np.int64]) -> list[int]:
        """Keys of slots (K,), which are numbered through all shards of `quad_shards`."""
        keys = np.empty(len(slots), np.int64)
        first = 0
        for part in self.live_segments:
            if part.living:
                here = (slots >= first) & (slots < first + len(part.alive))
                keys[here] = part.segment.keys[slots[here] - first]
                first += len(part.alive)
        return keys.tolist()


def _tidied(parts: Sequence[LiveSegment]) -> list[LiveSegment]:
    """Drop empty segments, and merge small ones; segments from files are left as they are."""
    tidy = [part for part in parts if part.living or part.segment.file is not None]
    while len(tidy) > 1 and tidy[-2].segment.file is None and tidy[-2].living < SEGMENTS.fanout * tidy[-1].living:
        last, before = tidy.pop(), tidy.pop()
        tidy.append(LiveSegment.of(merge_segments([(before.segment, before.alive), (last.segment, last.alive)])))
    return tidy
