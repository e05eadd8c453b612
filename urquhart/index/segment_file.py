"""Named arrays in one file that is mapped, not read: what a segment is on disk.

    magic, length and CRC-32 of the header | header: JSON | arrays, each at a multiple of 64 bytes

The header names every array with its type, shape, place and CRC-32, and says whatever else the writer wanted kept. A
file appears under its name when it is complete and on the disk, and is never changed; several processes that map it
share its pages.
"""

import json
import mmap
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

_MAGIC: Final = b"URQSEG01"
_LEAD: Final = struct.Struct("<8sII")
_ALIGNED: Final = 64
_HEADER: Final = 65_536
"""Bytes kept free for lead and header: a segment has a few hundred arrays at most."""
_AT_ONCE: Final = 1 << 20
_SMALL: Final = 1 << 24
"""Bytes: arrays up to this size are checked when a file is opened."""


class SegmentDamaged(ValueError):
    """A segment file that cannot be trusted. Segments are derived: build it anew."""


@dataclass(frozen=True, slots=True, eq=False)
class SegmentFile:
    """A mapped file.

    Attributes:
        path: where it lies.
        about: what the writer wanted kept.
        arrays: by name. They are copies as far as writing is concerned (nothing reaches the file), because arrays that
            cannot be written to are another type to the compiler, which would compile every kernel twice.
        sums: CRC-32 of each array.
        stamp: inode, size and time of the last change (ns) when it was opened.
    """

    path: Path
    about: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    sums: Mapping[str, int]
    stamp: tuple[int, int, int]

    @staticmethod
    def open(path: Path) -> "SegmentFile":
        """Map a file, checking its header, its size and its small arrays; `check` reads the large ones too.

        Raises:
            SegmentDamaged: not such a file, of another format, truncated, or changed since it was written.
            OSError: it is not there, or cannot be read.
        """
        with path.open("rb") as file:
            stamp = _stamp(os.fstat(file.fileno()))
            lead = file.read(_LEAD.size)
            if len(lead) < _LEAD.size:
                raise SegmentDamaged(f"{path.name} is truncated")
            magic, length, checksum = _LEAD.unpack(lead)
            if magic != _MAGIC:
                raise SegmentDamaged(f"{path.name} is not a segment of this format")
            header = file.read(min(length, _HEADER))
            # Once for all arrays: every mapping holds a descriptor of its own, and a process has only so many.
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
        if len(header) < length or zlib.crc32(header) != checksum:
            raise SegmentDamaged(f"{path.name} has a damaged header")
        contents, size = json.loads(header), stamp[1]
        arrays, sums = dict[str, NDArray[Any]](), dict[str, int]()
        for name, dtype, shape, offset, crc in contents["arrays"]:
            count = int(np.prod(shape))
            if offset + count * np.dtype(dtype).itemsize > size:
                raise SegmentDamaged(f"{path.name} is truncated")
            if count:
                arrays[name] = np.frombuffer(mapped, dtype, count, offset).reshape(shape)
            else:
                arrays[name] = np.empty(shape, dtype)
            sums[name] = crc
        opened = SegmentFile(path, contents["about"], arrays, sums, stamp)
        for name, array in arrays.items():
            if array.nbytes <= _SMALL:
                opened._check(name)
        return opened

    def check(self) -> None:
        """Compare every array with its checksum. Raises SegmentDamaged."""
        if self.stamp_now()[1] < self.stamp[1]:
            # To read what is not there any more would end the process.
            raise SegmentDamaged(f"{self.path.name} was cut off")
        for name in self.arrays:
            self._check(name)

    def copied(self, name: str) -> NDArray[Any]:
        """A copy of an array in memory, which is what was written. Raises KeyError, SegmentDamaged."""
        copy = self.arrays[name].copy()
        if _checksum(copy) != self.sums[name]:
            raise SegmentDamaged(f"{self.path.name}: {name} is not what was written")
        return copy

    def stamp_now(self) -> tuple[int, int, int]:
        """The stamp of the file as it is now: another one where somebody wrote to what is mapped.

        That of the opening where the name is gone or another file has it, since what is mapped stays as it is then.
        Raises OSError.
        """
        try:
            now = _stamp(self.path.stat())
        except FileNotFoundError:
            return self.stamp
        return now if now[0] == self.stamp[0] else self.stamp

    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self.arrays.values())

    def _check(self, name: str) -> None:
        if _checksum(self.arrays[name]) != self.sums[name]:
            raise SegmentDamaged(f"{self.path.name}: {name} is not what was written")


@dataclass(slots=True)
class SegmentWriter:
    """Arrays on their way into a file; see `writing`."""

    path: Path
    about: dict[str, Any] = field(default_factory=dict)
    _end: int = _HEADER
    _places: list[tuple[str, NDArray[Any], int]] = field(default_factory=list)

    def empty(self, name: str, shape: int | tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """An array of the file, to be filled.

        Raises:
            OSError: there is no room for it. It is reserved now: a page that finds none later would end the process.
        """
        shape = (shape,) if isinstance(shape, int) else shape
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        if not size:
            array: NDArray[Any] = np.empty(shape, dtype)
        else:
            with self.path.open("r+b") as file:
                os.posix_fallocate(file.fileno(), self._end, size)
            array = np.memmap(self.path, dtype, "r+", self._end, shape).view(np.ndarray)
        self._places.append((name, array, self._end))
        self._end += -(-size // _ALIGNED) * _ALIGNED
        return array

    def put(self, name: str, array: NDArray[Any]) -> None:
        """Add an array as it is. Raises OSError."""
        self.empty(name, array.shape, array.dtype)[...] = array

    def _finish(self) -> None:
        entries = [
            (name, array.dtype.str, list(array.shape), offset, _checksum(array)) for name, array, offset in self._places
        ]
        header = json.dumps({"about": self.about, "arrays": entries}).encode()
        if _LEAD.size + len(header) > _HEADER:
            raise ValueError(f"a header of {len(header)} bytes: more arrays than a segment has")
        self._places.clear()
        with self.path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, self._end)
            file.write(_LEAD.pack(_MAGIC, len(header), zlib.crc32(header)) + header)
            file.flush()
            os.fsync(file.fileno())


@contextmanager
def writing(path: Path) -> Iterator[SegmentWriter]:
    """Write a file: complete, on the disk and under its name when the block is left; gone when it raises.

    Raises:
        OSError: no room, or the folder cannot be written to.
    """
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    temporary.touch()
    writer = SegmentWriter(temporary)
    try:
        yield writer
        writer._finish()
        temporary.replace(path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Put a file on the disk, or a folder's entries, so that a renamed file keeps its name when power is lost."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _stamp(status: os.stat_result) -> tuple[int, int, int]:
    return status.st_ino, status.st_size, status.st_mtime_ns


def _checksum(array: NDArray[Any]) -> int:
    checksum, flat = 0, array.reshape(-1).view(np.uint8)
    for start in range(0, len(flat), _AT_ONCE):
        checksum = zlib.crc32(flat[start : start + _AT_ONCE].data, checksum)
    return checksum
