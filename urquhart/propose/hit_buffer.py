"""Memory for the hits of a quad search, reused from one search to the next."""

import os
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart.index.quad_search import HIT

_FIRST: Final = 4096
"""Hits that a new buffer holds."""
_MANY: Final = 1 << 18
"""A buffer for fewer hits grows to four times its size, a larger one to twice."""


class HitBuffer:
    """Memory for hits. The system would have to find and clear it again for every search that does not borrow it.

    Attributes:
        hits: (R,) of `HIT`; what is in it belongs to an earlier search until it is overwritten.
        totals: (R,) float32, what each hit and those that agree with it are worth.
    """

    def __init__(self) -> None:
        """Allocate memory for a few thousand hits."""
        self.hits: NDArray[Any] = np.empty(_FIRST, HIT)
        self.totals: NDArray[np.float32] = np.empty(_FIRST, np.float32)

    def grow(self) -> None:
        """Make room for more hits, and keep those that are there."""
        size = (4 if len(self.hits) < _MANY else 2) * len(self.hits)
        hits, totals = np.empty(size, HIT), np.empty(size, np.float32)
        hits[: len(self.hits)], totals[: len(self.totals)] = self.hits, self.totals
        self.hits, self.totals = hits, totals


class BufferPool:
    """Buffers that searches borrow one after the other, from any thread."""

    def __init__(self, kept: int) -> None:
        """Start empty, and keep up to `kept` of the buffers that are given back."""
        self._free: deque[HitBuffer] = deque(maxlen=kept)

    @contextmanager
    def borrow(self) -> Iterator[HitBuffer]:
        """A buffer for one search at a time, which must not be used after the block."""
        try:
            buffer = self._free.pop()
        except IndexError:
            buffer = HitBuffer()
        try:
            yield buffer
        finally:
            self._free.append(buffer)


BUFFERS: Final = BufferPool(os.cpu_count() or 1)
"""The buffers of this process: as many as searches can run at once."""
