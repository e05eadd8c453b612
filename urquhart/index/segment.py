"""Segments: quads and polygons of many submaps, arranged for search. Immutable; in memory, or mapped from a file.

New submaps make small segments, and segments are merged into larger ones, as in a log-structured store. A submap that
was deleted or replaced is masked by the `LiveSegment` around the segment, and the next merge drops it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.polygon_index import Partition, build_partitions, merge_partitions
from urquhart.index.quad_table import MOST_SLOTS, QuadTable, build_table, centre_scale, merge_tables
from urquhart.index.segment_file import SegmentDamaged, SegmentFile, SegmentWriter, writing

FORMAT: Final = 1
"""Raised whenever the same features give another segment than before; stored ones are then built anew."""
_UNIT: Final = 0.01
"""Metres: what outlines are measured in; in more where a submap is too large for it."""
_MOST_UNITS: Final = 16_000
"""Of them from the middle: from one vertex to the next there may be twice as many."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Quads and polygons of submaps, which are known by their slot: their place among `keys`.

    Attributes:
        fingerprint: of the configuration that the features were made with.
        keys: (S,) int64, ascending.
        scales: (S,) float32, metres in a step of a quad's centre.
        units: (S,) float32, metres in a step of a polygon's outline.
        quads: by their lengths.
        polygons: by vertex count.
        file: where the arrays are mapped from; None in memory.
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
        """Slots (K,) of keys (K,) int64, -1 for those that are not here."""
        if not len(self.keys):
            return np.full(len(keys), -1, np.int64)
        at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return np.where(self.keys[at] == keys, at, -1)

    @staticmethod
    def build(items: Iterable[tuple[int, Features]], config: Config) -> "Segment":
        """A segment in memory of submaps by key.

        Raises:
            ValueError: features made with another configuration, or a key that comes twice.
        """
        ordered = sorted(items, key=lambda item: item[0])
        for key, features in ordered:
            if features.fingerprint != config.fingerprint():
                raise ValueError(f"features of submap {key} were made with another configuration: describe it again")
        keys = np.array([key for key, _ in ordered], np.int64)
        if np.any(keys[1:] == keys[:-1]):
            raise ValueError("a submap comes twice")
        known = [features for _, features in ordered]
        scales = np.array([centre_scale(f.landmarks) for f in known], np.float32)
        units = np.array([np.abs(f.landmarks).max() / _MOST_UNITS for f in known], np.float32)
        units = np.maximum(units, _UNIT)
        quads = build_table(
            [(f.landmarks, f.tessellation.quads, float(scale)) for f, scale in zip(known, scales, strict=True)]
        )
        return Segment(config.fingerprint(), keys, scales, units, quads, build_partitions(known, units))

    def write(self, path: Path, **about: Any) -> None:
        """Write the segment to a file that `open` maps; `about` is kept with it. Raises OSError."""
        with writing(path) as writer:
            writer.about = {**about, "format": FORMAT, "fingerprint": self.fingerprint}
            _put(writer, self, self.quads.words)

    @staticmethod
    def open(path: Path) -> "Segment":
        """Map a segment; `file.check()` reads and checks all of it, this does not.

        Raises:
            SegmentDamaged: it cannot be trusted, or is of another format.
            OSError: it is not there, or cannot be read.
        """
        file = SegmentFile.open(path)
        if file.about.get("format") != FORMAT:
            raise SegmentDamaged(f"{path.name} has segment format {file.about.get('format')}, this version {FORMAT}")
        arrays = file.arrays
        # Whatever happens to the file later, slots keep the submaps that they stand for: these are copies.
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
    """One segment of several, without what is dead: in memory, or written to `path` and mapped from there.

    Args:
        parts: each with what lives of it, (S,) uint8. No living key may be in two of them.
        about: kept with the file.

    Raises:
        ValueError: there is nothing to merge, of different configurations, or too much for one segment.
        OSError: the file cannot be written.
    """
    fingerprints = {segment.fingerprint for segment, _ in parts}
    if len(fingerprints) != 1:
        raise ValueError("segments to merge must be there, and of one configuration")
    living = [np.flatnonzero(alive) for _, alive in parts]
    keys = np.concatenate([segment.keys[chosen] for (segment, _), chosen in zip(parts, living, strict=True)])
    if len(keys) >= MOST_SLOTS:
        raise ValueError(f"{len(keys)} submaps, a segment holds {MOST_SLOTS}")
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
        # The words are most of a large segment: they are merged straight into the file.
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
