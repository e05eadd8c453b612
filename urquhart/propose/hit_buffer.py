"""Memory for the hits of a quad search, which is reused by later searches."""

import os
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.index.quad_hits import HIT, RAW_HIT, SECTORS

_FIRST: Final = 4096
"""Hits that a new buffer can hold."""
_MANY: Final = 1 << 18
"""Hits below which a buffer grows to four times its size; a larger one grows to twice its size."""


class HitBuffer:
    """Memory for hits. It is reused, because the operating system takes long to provide and clear new memory.

    Attributes:
        raw: (K,) of `RAW_HIT`; rows beyond those of the current search are left from earlier ones, here and below.
        hits: (R,) of `HIT`.
        totals: (R,) float32, total weight of each hit and of those that agree with it.
    """

    def __init__(self) -> None:
        """Allocate memory for a few thousand hits."""
        self.raw: NDArray[Any] = np.empty(_FIRST, RAW_HIT)
        self.hits: NDArray[Any] = np.empty(_FIRST, HIT)
        self.totals: NDArray[np.float32] = np.empty(_FIRST, np.float32)
        self._sectors: NDArray[np.uint8] = np.empty((0, SECTORS), np.uint8)
        self._latest: NDArray[np.int32] = np.empty((0, SECTORS), np.int32)

    def grow(self) -> None:
        """Enlarge `raw`, and keep its rows."""
        self.raw = _enlarged(self.raw, len(self.raw) + 1)

    def make_room(self, count: int) -> None:
        """Enlarge `hits` and `totals` to at least `count` rows, if they have fewer, and keep their rows."""
        if len(self.hits) < count:
            self.hits, self.totals = _enlarged(self.hits, count), _enlarged(self.totals, count)

    def sectors(self, slots: int) -> NDArray[np.uint8]:
        """Counts (S, SECTORS) uint8 for so many slots; they hold anything."""
        if len(self._sectors) < slots:
            self._sectors = np.empty((slots, SECTORS), np.uint8)
        return self._sectors[:slots]

    def latest(self, slots: int) -> NDArray[np.int32]:
        """Zeros (S, SECTORS) int32 for so many slots: the latest hit of each slot in each sector of rotation."""
        if len(self._latest) < slots:
            self._latest = np.empty((slots, SECTORS), np.int32)
        latest = self._latest[:slots]
        latest.fill(0)
        return latest


def _enlarged(array: NDArray[Any], least: int) -> NDArray[Any]:
    size = len(array)
    while size < least:
        size *= 4 if size < _MANY else 2
    larger = np.empty(size, array.dtype)
    larger[: len(array)] = array
    return larger


class BufferPool:
    """Buffers that searches in any thread can borrow."""

    def __init__(self, kept: int) -> None:
        """Start empty; keep at most `kept` returned buffers."""
        self._free: deque[HitBuffer] = deque(maxlen=kept)

    @contextmanager
    def borrow(self) -> Iterator[HitBuffer]:
        """Borrow a buffer for one search; it must not be used after the block."""
        try:
            buffer = self._free.pop()
        except IndexError:
            buffer = HitBuffer()
        try:
            yield buffer
        finally:
            self._free.append(buffer)


BUFFERS: Final = BufferPool(os.cpu_count() or 1)
"""The buffers of this process, as many as it has processor cores."""
