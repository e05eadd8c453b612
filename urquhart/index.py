"""Nearest-neighbour index of polygon descriptors, keyed on vertex count.

Polygons with n vertices live in partition n: FAISS over their descriptors, and beside it the polygon itself (whose it
is, where its vertices are), so that a hit is ready to be aligned without another look-up. A partition is exact while it
is small and turns into an inverted file (IVF) once it has outgrown `exact_below`.

Ids given to FAISS are slots that this index hands out; they never move, so removal renumbers nothing.
"""

import hashlib
import json
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import faiss
import numpy as np
from numpy.typing import NDArray

_MAGIC: Final = b"URQI0001"
_LENGTH: Final = struct.Struct("<Q")


class IndexDamaged(ValueError):
    """An index file that cannot be trusted. Indexes are derived: rebuild it."""


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Neighbours found in one partition.

    Attributes:
        count: vertices of the polygons found.
        rows: (H,) int64, which query row each hit answers.
        keys: (H,) int64, the submap of the polygon found.
        ordinals: (H,) int32, which polygon of that submap.
        outlines: (H, count, 2) float32, metres, centred submap frame: its vertices, counter-clockwise.
        distances: (H,) float32, squared descriptor distance.
    """

    count: int
    rows: NDArray[np.int64]
    keys: NDArray[np.int64]
    ordinals: NDArray[np.int32]
    outlines: NDArray[np.float32]
    distances: NDArray[np.float32]


class Partition:
    """Polygons with one vertex count: FAISS for the descriptors, arrays by slot for the rest."""

    def __init__(self, count: int, dimension: int, exact_below: int) -> None:
        self.count, self.dimension, self.exact_below = count, dimension, exact_below
        self.faiss: Any = faiss.IndexIDMap2(faiss.IndexFlatL2(dimension))
        self.keys: NDArray[np.int64] = np.empty(0, np.int64)
        self.ordinals: NDArray[np.int32] = np.empty(0, np.int32)
        self.outlines: NDArray[np.float32] = np.empty((0, count, 2), np.float32)
        self.used = 0
        self.free: list[int] = []
        self.slots: dict[int, list[int]] = {}

    def __len__(self) -> int:
        return int(self.faiss.ntotal)

    @property
    def exact(self) -> bool:
        """Whether a search reads every descriptor (small partitions) or an inverted file's nearest lists."""
        return isinstance(self.faiss, faiss.IndexIDMap2)

    def add(
        self,
        keys: NDArray[np.int64],
        ordinals: NDArray[np.int32],
        outlines: NDArray[np.float32],
        descriptors: NDArray[np.float32],
    ) -> None:
        slots = self._allocate(len(keys))
        self.keys[slots], self.ordinals[slots], self.outlines[slots] = keys, ordinals, outlines
        for key, slot in zip(keys.tolist(), slots.tolist(), strict=True):
            self.slots.setdefault(key, []).append(slot)
        self.faiss.add_with_ids(np.ascontiguousarray(descriptors), slots)
        if self.exact and len(self) > self.exact_below:
            self._invert()

    def remove(self, keys: set[int]) -> int:
        slots = [slot for key in keys for slot in self.slots.pop(key, ())]
        if slots:
            self.faiss.remove_ids(faiss.IDSelectorBatch(np.array(slots, np.int64)))
            self.free.extend(slots)
        return len(slots)

    def search(self, rows: NDArray[np.int64], descriptors: NDArray[np.float32], neighbours: int) -> Hits:
        distances, slots = self.faiss.search(descriptors, min(neighbours, max(len(self), 1)))
        found = slots >= 0
        which = np.repeat(rows, slots.shape[1]).reshape(slots.shape)[found]
        at = slots[found]
        return Hits(self.count, which, self.keys[at], self.ordinals[at], self.outlines[at], distances[found])

    def _allocate(self, wanted: int) -> NDArray[np.int64]:
        reused = [self.free.pop() for _ in range(min(wanted, len(self.free)))]
        fresh = wanted - len(reused)
        if self.used + fresh > len(self.keys):
            capacity = max(2 * len(self.keys), self.used + fresh, 64)
            self.keys = _grown(self.keys, capacity)
            self.ordinals = _grown(self.ordinals, capacity)
            self.outlines = _grown(self.outlines, capacity)
        slots = np.array(reused + list(range(self.used, self.used + fresh)), np.int64)
        self.used += fresh
        return slots

    def _invert(self) -> None:
        stored: Any = faiss.downcast_index(self.faiss.index)
        descriptors = faiss.rev_swig_ptr(stored.get_xb(), stored.ntotal * self.dimension).reshape(-1, self.dimension)
        slots = faiss.vector_to_array(self.faiss.id_map)
        lists = int(2.0 * np.sqrt(len(descriptors)))
        quantizer = faiss.IndexFlatL2(self.dimension)
        inverted = faiss.IndexIVFFlat(quantizer, self.dimension, lists)
        # Reading a fixed share of the lists keeps the recall while the partition grows.
        inverted.nprobe = max(16, lists // 16)
        inverted.cp.seed = 1
        inverted.train(descriptors)
        inverted.add_with_ids(descriptors, slots)
        self.faiss = inverted


class PolygonIndex:
    """Descriptors of all polygons of a collection, searched within a window of vertex counts.

    Not safe for a change during a search; searches may run side by side.
    """

    def __init__(self, dimension: int, exact_below: int = 50_000) -> None:
        self.dimension, self.exact_below = dimension, exact_below
        self.partitions: dict[int, Partition] = {}

    def __len__(self) -> int:
        return sum(len(partition) for partition in self.partitions.values())

    def add(
        self,
        keys: NDArray[np.int64],
        ordinals: NDArray[np.int32],
        outlines: NDArray[np.float32],
        descriptors: NDArray[np.float32],
    ) -> None:
        """Add polygons that have one vertex count.

        Args:
            keys: (K,) int64, the submap each belongs to.
            ordinals: (K,) int32, its number among that submap's polygons.
            outlines: (K, n, 2) float32, metres, centred submap frame, counter-clockwise.
            descriptors: (K, D) float32.
        """
        count = outlines.shape[1]
        if count not in self.partitions:
            self.partitions[count] = Partition(count, self.dimension, self.exact_below)
        faiss.omp_set_num_threads(1)
        self.partitions[count].add(keys, ordinals, outlines, descriptors)

    def remove(self, keys: set[int]) -> int:
        """Remove every polygon of the given submaps; how many went."""
        faiss.omp_set_num_threads(1)
        return sum(partition.remove(keys) for partition in self.partitions.values())

    def search(
        self, counts: NDArray[np.int32], descriptors: NDArray[np.float32], *, neighbours: int, window: int = 0
    ) -> Iterator[Hits]:
        """The nearest `neighbours` of each row in every partition within `window` of its vertex count.

        Args:
            counts: (Q,) int32, vertices of each query polygon.
            descriptors: (Q, D) float32.
        """
        # OpenMP keeps its thread count by calling thread, so it is set here and not once at start.
        faiss.omp_set_num_threads(1)
        for count, partition in sorted(self.partitions.items()):
            rows = np.flatnonzero(np.abs(counts - count) <= window)
            if len(rows) and len(partition):
                yield partition.search(rows, np.ascontiguousarray(descriptors[rows]), neighbours)

    def save(self, path: Path) -> None:
        """Write the index to one file with a checksum, in one step: a reader sees the old file or the new one."""
        body = b"".join(_frame(part) for part in self._parts())
        temporary = path.with_name(path.name + ".tmp")
        with temporary.open("wb") as file:
            file.write(_MAGIC + hashlib.sha256(body).digest() + body)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)

    @staticmethod
    def load(path: Path) -> "PolygonIndex":
        """Read what `save` wrote.

        Raises:
            IndexDamaged: not such a file, truncated, or its checksum is wrong.
        """
        data = path.read_bytes()
        if data[:8] != _MAGIC:
            raise IndexDamaged(f"{path} is not an index file of this version: rebuild it")
        body = data[40:]
        if hashlib.sha256(body).digest() != data[8:40]:
            raise IndexDamaged(f"{path} is damaged (wrong checksum): rebuild it")
        parts = _unframe(body)
        head = json.loads(next(parts))
        index = PolygonIndex(head["dimension"], head["exact_below"])
        for entry in head["partitions"]:
            partition = Partition(entry["count"], index.dimension, index.exact_below)
            partition.faiss = faiss.deserialize_index(np.frombuffer(next(parts), np.uint8))
            partition.keys = np.frombuffer(next(parts), np.int64).copy()
            partition.ordinals = np.frombuffer(next(parts), np.int32).copy()
            partition.outlines = np.frombuffer(next(parts), np.float32).reshape(-1, partition.count, 2).copy()
            partition.used, partition.free = len(partition.keys), entry["free"]
            gaps = set(partition.free)
            for slot, key in enumerate(partition.keys.tolist()):
                if slot not in gaps:
                    partition.slots.setdefault(key, []).append(slot)
            index.partitions[partition.count] = partition
        return index

    def _parts(self) -> Iterator[bytes]:
        entries = [{"count": p.count, "free": p.free} for p in self.partitions.values()]
        head = {"dimension": self.dimension, "exact_below": self.exact_below, "partitions": entries}
        yield json.dumps(head).encode()
        for partition in self.partitions.values():
            yield faiss.serialize_index(partition.faiss).tobytes()
            yield partition.keys[: partition.used].tobytes()
            yield partition.ordinals[: partition.used].tobytes()
            yield partition.outlines[: partition.used].tobytes()


def _grown(array: NDArray[Any], capacity: int) -> NDArray[Any]:
    grown = np.zeros((capacity, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


def _frame(part: bytes) -> bytes:
    return _LENGTH.pack(len(part)) + part


def _unframe(body: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(body):
        (length,) = _LENGTH.unpack_from(body, at)
        yield body[at + _LENGTH.size : at + _LENGTH.size + length]
        at += _LENGTH.size + length
