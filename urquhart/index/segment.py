"""Segments: the quads and polygons of many submaps, arranged for search. Immutable; in memory, or mapped from a file.

New submaps make small segments, and these are merged into larger ones, as in a log-structured store. A `LiveSegment`
masks submaps that were deleted or replaced, and the next merge drops them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.polygon_search import Partition, build_partitions, merge_partitions
from urquhart.index.quad_table import MOST_SLOTS, QuadTable, build_table, centre_scale, merge_tables
from urquhart.index.segment_file import SegmentDamaged, SegmentFile, SegmentWriter, writing

FORMAT: Final = 2
"""Raised whenever the same features give another segment than before; stored segments are then rebuilt."""
_UNIT: Final = 0.01
"""Metres: unit of a submap's outlines; larger submaps have a larger unit."""
_MOST_UNITS: Final = 16_000
"""Most units from the submap's centre to a landmark. From one vertex to the next there may be twice as many."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """The quads and polygons of S submaps. A submap's slot is its position in `keys`.

    Attributes:
        fingerprint: `Config.fingerprint()` of the configuration that made the features.
        keys: (S,) int64, ascending.
        scales: (S,) float32, metres, step of the centres of a submap's quads; see `centre_scale`.
        units: (S,) float32, metres, unit of the outlines of a submap's polygons.
        quads: of all submaps.
        polygons: of all submaps, by vertex count.
        file: the file that the arrays are mapped from; None for a segment in memory.
    """

    fingerprint: str
    keys: NDArray[np.int64]
    scales: NDArray[np.float32]
    units: NDArray[np.float32]
    quads: QuadTable
    polygons: dict[int, Partition]
    file: SegmentFile | None = None

    def __len__(self) -> int:
        return len(self.keys)

    def slots(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Slots (K,) of keys (K,) int64; -1 for keys that are not in this segment."""
        if not len(self.keys):
            return np.full(len(keys), -1, np.int64)
        at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return np.where(self.keys[at] == keys, at, -1)

    @staticmethod
    def build(items: Iterable[tuple[int, Features]], config: Config) -> "Segment":
        """A segment in memory, from the features of submaps by key.

        Raises:
            ValueError: features made with another configuration, or a repeated key.
        """
        ordered = sorted(items, key=lambda item: item[0])
        for key, features in ordered:
            if features.fingerprint != config.fingerprint():
                raise ValueError(f"features of submap {key} were made with another configuration: describe it again")
        keys = np.array([key for key, _ in ordered], np.int64)
        if np.any(keys[1:] == keys[:-1]):
            raise ValueError("the same submap is given twice")
        known = [features for _, features in ordered]
        scales = np.array([centre_scale(f.landmarks) for f in known], np.float32)
        units = np.array([np.abs(f.landmarks).max() / _MOST_UNITS for f in known], np.float32)
        units = np.maximum(units, _UNIT)
        quads = build_table(
            [(f.landmarks, f.tessellation.quads, float(scale)) for f, scale in zip(known, scales, strict=True)]
        )
        return Segment(config.fingerprint(), keys, scales, units, quads, build_partitions(known, units))

    def write(self, path: Path, **about: Any) -> None:
        """Write the segment to a file that `open` maps, with `about` in its header. Raises OSError."""
        with writing(path) as writer:
            writer.about = {**about, "format": FORMAT, "fingerprint": self.fingerprint}
            _put(writer, self, self.quads.words)

    @staticmethod
    def open(path: Path) -> "Segment":
        """Map a segment file. It checks the header and the small arrays; `file.check()` checks all of them.

        Raises:
            SegmentDamaged: the file is damaged, or of another format.
            OSError: the file does not exist, or cannot be read.
        """
        file = SegmentFile.open(path)
        if file.about.get("format") != FORMAT:
            raise SegmentDamaged(f"{path.name} has segment format {file.about.get('format')}, this version {FORMAT}")
        arrays = file.arrays
        # Copies: whatever happens to the file later, a slot still means the same submap.
        keys, scales, units = (file.copied(name) for name in ("keys", "scales", "units"))
        polygons: dict[int, dict[str, NDArray[Any]]] = {}
        for name, array in arrays.items():
            if name.startswith("polygons/"):
                _, count, part = name.split("/")
                polygons.setdefault(int(count), {})[part] = array
        return Segment(
            file.about["fingerprint"],
            keys,
            scales,
            units,
            QuadTable(arrays["codes"], arrays["starts"], arrays["words"]),
            {count: Partition.of(count, parts) for count, parts in sorted(polygons.items())},
            file,
        )


def merge_segments(
    parts: Sequence[tuple[Segment, NDArray[np.uint8]]], path: Path | None = None, **about: Any
) -> Segment:
    """Several segments merged into one, without deleted and replaced submaps.

    Args:
        parts: segments, each with its mask (S,) uint8, 1 for submaps to keep. No such key may be in two of them.
        path: the file to write and map; by default the merged segment is in memory.
        about: kept in the header of the file.

    Raises:
        ValueError: no segments, segments of different configurations, or too many submaps for one segment.
        OSError: the file cannot be written.
    """
    fingerprints = {segment.fingerprint for segment, _ in parts}
    if len(fingerprints) != 1:
        raise ValueError("segments to merge must be at least one, all of one configuration")
    living = [np.flatnonzero(alive) for _, alive in parts]
    keys = np.concatenate([segment.keys[chosen] for (segment, _), chosen in zip(parts, living, strict=True)])
    if len(keys) >= MOST_SLOTS:
        raise ValueError(f"{len(keys)} submaps, but a segment holds at most {MOST_SLOTS}")
    order = np.argsort(keys, kind="stable")
    place = np.empty(len(keys), np.int32)
    place[order] = np.arange(len(keys), dtype=np.int32)
    moved, first = [], 0
    for (segment, _), chosen in zip(parts, living, strict=True):
        slots = np.full(len(segment), -1, np.int32)
        slots[chosen] = place[first : first + len(chosen)]
        moved.append(slots)
        first += len(chosen)
    scales, units = (
        np.concatenate([getattr(segment, name)[chosen] for (segment, _), chosen in zip(parts, living, strict=True)])[
            order
        ]
        for name in ("scales", "units")
    )
    tables = [(segment.quads, slots) for (segment, _), slots in zip(parts, moved, strict=True)]
    partitions = merge_partitions([(segment.polygons, slots) for (segment, _), slots in zip(parts, moved, strict=True)])
    [fingerprint] = fingerprints
    if path is None:
        return Segment(fingerprint, keys[order], scales, units, merge_tables(tables), partitions)
    with writing(path) as writer:
        writer.about = {**about, "format": FORMAT, "fingerprint": fingerprint}
        # Words are most of a large segment, so they are merged directly into the file.
        table = merge_tables(tables, lambda shape, dtype: writer.empty("words", shape, dtype))
        _put(writer, Segment(fingerprint, keys[order], scales, units, table, partitions), None)
    return Segment.open(path)


def _put(writer: SegmentWriter, segment: Segment, words: NDArray[np.uint64] | None) -> None:
    writer.put("keys", segment.keys)
    writer.put("scales", segment.scales)
    writer.put("units", segment.units)
    writer.put("codes", segment.quads.codes)
    writer.put("starts", segment.quads.starts)
    if words is not None:
        writer.put("words", words)
    for count, partition in segment.polygons.items():
        for name, array in partition.arrays().items():
            writer.put(f"polygons/{count}/{name}", array)
