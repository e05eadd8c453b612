"""The file format of a segment: named arrays in one file, which is mapped into memory.

    magic, length and CRC-32 of the header | header: JSON | arrays, each at a multiple of 64 bytes

The header lists every array with its type, shape, offset and CRC-32, and holds other data of the writer. A file gets
its name when it is complete and synced to disk, and never changes after that. All processes that map it share its
pages.
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
"""Bytes reserved for lead and header: a segment has at most a few hundred arrays."""
_AT_ONCE: Final = 1 << 20
"""Bytes that are added to a checksum at once."""
_SMALL: Final = 1 << 24
"""Bytes: arrays up to this size are checked when a file is opened."""


class SegmentDamaged(ValueError):
    """A segment file that is damaged. Segments are derived data: rebuild it."""


@dataclass(frozen=True, slots=True, eq=False)
class SegmentFile:
    """A mapped segment file.

    Attributes:
        path: of the file.
        about: data that the writer put into the header.
        arrays: by name. They are mapped copy-on-write: writable, although nothing reaches the file. Read-only arrays
            would be another type for numba, and it would compile every kernel twice.
        sums: CRC-32 of each array, by name.
        stamp: inode, size and modification time (ns) of the file when it was opened.
    """

    path: Path
    about: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    sums: Mapping[str, int]
    stamp: tuple[int, int, int]

    @staticmethod
    def open(path: Path) -> "SegmentFile":
        """Map a file, and check its header, its size and its small arrays; `check` checks the large ones too.

        Raises:
            SegmentDamaged: no segment file, of another format, truncated, or changed since it was written.
            OSError: the file does not exist, or cannot be read.
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
            # One mapping for all arrays, because each mapping holds a file descriptor.
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
            # Reading a mapped page that is no longer in the file would end the process.
            raise SegmentDamaged(f"{self.path.name} was cut off")
        for name in self.arrays:
            self._check(name)

    def copied(self, name: str) -> NDArray[Any]:
        """A copy of an array in memory, after a check of its checksum. Raises KeyError, SegmentDamaged."""
        copy = self.arrays[name].copy()
        if _checksum(copy) != self.sums[name]:
            raise SegmentDamaged(f"{self.path.name}: {name} is not what was written")
        return copy

    def stamp_now(self) -> tuple[int, int, int]:
        """The current stamp of the mapped file. It differs from `stamp` if somebody wrote to the file.

        If the file was removed or replaced by another one, the mapping is unaffected, and `stamp` is returned. Raises
        OSError.
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
    """Writes arrays into a new segment file; `writing` opens one."""

    path: Path
    about: dict[str, Any] = field(default_factory=dict)
    _end: int = _HEADER
    _places: list[tuple[str, NDArray[Any], int]] = field(default_factory=list)

    def empty(self, name: str, shape: int | tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """A new array in the file, to be filled by the caller.

        Raises:
            OSError: no space on the disk. Space is reserved now, because a mapped page without any ends the process.
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
        """Copy an array into the file. Raises OSError."""
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
    """Write a segment file in the block. When the block ends, the file is complete, synced, and gets its name.

    If the block raises, no file is left.

    Raises:
        OSError: no space on the disk, or the folder cannot be written.
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
    """Sync a file, or the entries of a folder, to disk: a renamed file then keeps its name when power is lost."""
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
