"""Memory for the hits of a quad search, which is reused by later searches."""

import os
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.index.quad_search import HIT

_FIRST: Final = 4096
"""Hits that a new buffer can hold."""
_MANY: Final = 1 << 18
"""Hits below which a buffer grows to four times its size; a larger one grows to twice its size."""


class HitBuffer:
    """Memory for hits. It is reused, because the operating system takes long to provide and clear new memory.

    Attributes:
        hits: (R,) of `HIT`; rows beyond those of the current search are left from earlier ones.
        totals: (R,) float32, total weight of each hit and of those that agree with it.
    """

    def __init__(self) -> None:
        """Allocate memory for a few thousand hits."""
        self.hits: NDArray[Any] = np.empty(_FIRST, HIT)
        self.totals: NDArray[np.float32] = np.empty(_FIRST, np.float32)

    def grow(self) -> None:
        """Enlarge the buffer, and keep its hits."""
        size = (4 if len(self.hits) < _MANY else 2) * len(self.hits)
        hits, totals = np.empty(size, HIT), np.empty(size, np.float32)
        hits[: len(self.hits)], totals[: len(self.totals)] = self.hits, self.totals
        self.hits, self.totals = hits, totals


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
