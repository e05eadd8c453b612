"""Index of quads: an integer grid over their five lengths.

Segments of quads sorted by cell, searched in all cells that the tolerance touches. A segment never changes; new submaps
make a small one, and small ones are merged, as in a log-structured store.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel

STEP: Final = 0.01
"""Metres: lengths are kept as whole multiples of this, in 16 bits."""
CELL: Final = 1.0
"""Metres: side of a cell of the grid; with a tolerance of up to half of it a search meets two cells a side."""
_BITS: Final = 12
"""Bits for each length in a cell code: 4096 cells of a metre."""
_COMMON: Final = 64
"""A query quad with more than this part of the hits that are kept is too common to be looked for: in rows of trees all
quads are alike, and finding each in every row would take longer than everything else."""
_FANOUT: Final = 4
"""A segment is merged with the one before it while that is less than this many times as large."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Quads sorted by cell; never changed once made.

    Attributes:
        codes: (C,) int64, the cells that hold quads, ascending.
        starts: (C + 1,) int64, where each cell's quads begin.
        lengths: (Q, 5) uint16, multiples of `STEP`.
        directions: (Q,) uint16, 65,536ths of a turn.
        slots: (Q,) int32, the submap's slot.
        ordinals: (Q,) uint16, which quad of that submap.
    """

    codes: NDArray[np.int64]
    starts: NDArray[np.int64]
    lengths: NDArray[np.uint16]
    directions: NDArray[np.uint16]
    slots: NDArray[np.int32]
    ordinals: NDArray[np.uint16]

    def __len__(self) -> int:
        return len(self.slots)


def _segment(
    lengths: NDArray[np.uint16], directions: NDArray[np.uint16], slots: NDArray[np.int32], ordinals: NDArray[np.uint16]
) -> Segment:
    codes = np.zeros(len(lengths), np.int64)
    for k in range(5):
        codes = (codes << _BITS) | (lengths[:, k] // int(CELL / STEP)).astype(np.int64)
    order = np.argsort(codes, kind="stable")
    unique, first = np.unique(codes[order], return_index=True)
    starts = np.append(first, len(codes)).astype(np.int64)
    return Segment(unique, starts, lengths[order], directions[order], slots[order], ordinals[order])


@dataclass(frozen=True, slots=True, eq=False)
class QuadHits:
    """Quads found: (H,) arrays of the query's quad, the submap's key, its quad, rotation (radians) and misfit.

    `turned` tells that the submap's quad corresponds to the query's read from its third landmark on. `misfit` is the
    sum of squared length differences, square metres.
    """

    quads: NDArray[np.int32]
    keys: NDArray[np.int64]
    ordinals: NDArray[np.int32]
    turned: NDArray[np.bool_]
    rotations: NDArray[np.float32]
    misfit: NDArray[np.float32]


class QuadIndex:
    """Quads of all submaps of a collection. Not safe for a change during a search; searches may run side by side."""

    def __init__(self) -> None:
        self._segments: list[Segment] = []
        self._keys: NDArray[np.int64] = np.empty(0, np.int64)
        self._slots: dict[int, int] = {}

    def __len__(self) -> int:
        return sum(len(segment) for segment in self._segments)

    def add(self, items: Iterable[tuple[int, NDArray[np.float32], NDArray[np.float32]]]) -> None:
        """Add submaps: key, lengths (Q, 5) and directions (Q,) as `measure` gives them. Keys must be new."""
        keys: list[int] = []
        lengths, directions, slots, ordinals = [], [], [], []
        for key, measured, direction in items:
            slot = len(self._keys) + len(keys)
            keys.append(key)
            self._slots[key] = slot
            lengths.append(np.minimum(np.round(measured / STEP), 65_535).astype(np.uint16))
            directions.append((np.round(direction * (32_768.0 / math.pi)).astype(np.int64) & 0xFFFF).astype(np.uint16))
            slots.append(np.full(len(measured), slot, np.int32))
            ordinals.append(np.arange(len(measured), dtype=np.uint16))
        if not keys:
            return
        self._keys = np.concatenate([self._keys, np.array(keys, np.int64)])
        self._segments.append(
            _segment(
                np.concatenate(lengths), np.concatenate(directions), np.concatenate(slots), np.concatenate(ordinals)
            )
        )
        while len(self._segments) > 1 and len(self._segments[-2]) < _FANOUT * len(self._segments[-1]):
            self._merge_last_two()

    def remove(self, keys: set[int]) -> int:
        """Forget submaps; their quads are skipped at once and dropped when their segment is merged."""
        slots = [self._slots.pop(key) for key in keys if key in self._slots]
        self._keys[slots] = -1
        return len(slots)

    def search(
        self, lengths: NDArray[np.float32], directions: NDArray[np.float32], tolerance: float, limit: int
    ) -> QuadHits:
        """Quads of submaps whose every length is within `tolerance` metres of a query quad's, in either reading.

        Args:
            lengths, directions: (Q, 5) and (Q,), as `measure` gives them.
            limit: most hits kept; past it those of the commonest query quads are left out, and the commonest of all are
                not even gathered.
        """
        parts = [
            find_quads(
                s.codes,
                s.starts,
                s.lengths,
                s.directions,
                s.slots,
                s.ordinals,
                self._keys,
                lengths,
                directions,
                tolerance,
                max(limit // _COMMON, 1),
            )
            for s in self._segments
        ]
        quads, keys, ordinals, turned, rotations, misfit = (
            (np.concatenate(columns) for columns in zip(*parts, strict=True)) if parts else _NO_HITS
        )
        if len(quads) > limit:
            commonness = np.bincount(quads, minlength=len(lengths))[quads]
            kept = np.argsort(commonness, kind="stable")[:limit]
            quads, keys, ordinals, turned, rotations, misfit = (
                column[kept] for column in (quads, keys, ordinals, turned, rotations, misfit)
            )
        return QuadHits(quads, keys, ordinals, turned, rotations, misfit)

    def _merge_last_two(self) -> None:
        small, smaller = self._segments[-2], self._segments.pop()
        columns = [
            np.concatenate([getattr(small, name), getattr(smaller, name)])
            for name in ("lengths", "directions", "slots", "ordinals")
        ]
        alive = self._keys[columns[2]] >= 0
        self._segments[-1] = _segment(*(column[alive] for column in columns))


_NO_HITS: Final = (
    np.empty(0, np.int32),
    np.empty(0, np.int64),
    np.empty(0, np.int32),
    np.empty(0, np.bool_),
    np.empty(0, np.float32),
    np.empty(0, np.float32),
)


@kernel
def find_quads(
    codes: NDArray[np.int64],
    starts: NDArray[np.int64],
    stored: NDArray[np.uint16],
    stored_directions: NDArray[np.uint16],
    slots: NDArray[np.int32],
    ordinals: NDArray[np.uint16],
    keys: NDArray[np.int64],
    lengths: NDArray[np.float32],
    directions: NDArray[np.float32],
    tolerance: float,
    most: int,
) -> tuple[
    NDArray[np.int32], NDArray[np.int64], NDArray[np.int32], NDArray[np.bool_], NDArray[np.float32], NDArray[np.float32]
]:
    """Search one segment; see `QuadIndex.search` and `QuadHits`. Quads of submaps whose key is negative are skipped.

    A query quad with more than `most` hits is given up, hits and all.
    """
    capacity, found = 1024, 0
    out_quad, out_key, out_ordinal = (
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int32),
    )
    out_turned, out_rotation = np.empty(capacity, np.bool_), np.empty(capacity, np.float32)
    out_misfit = np.empty(capacity, np.float32)
    low, high, wanted = np.empty(5, np.int64), np.empty(5, np.int64), np.empty(5)
    for q in range(len(lengths)):
        before = found
        for reading in range(2):
            if found - before > most:
                break
            for k in range(4):
                wanted[k] = lengths[q, (k + 2 * reading) % 4]
            wanted[4] = lengths[q, 4]
            for k in range(5):
                low[k] = int(max(wanted[k] - tolerance, 0.0) / CELL)
                high[k] = int((wanted[k] + tolerance) / CELL)
            # The last length varies fastest in a code, so the cells of one row of it are one run of codes.
            for c0 in range(low[0], high[0] + 1):
                if found - before > most:
                    break
                for c1 in range(low[1], high[1] + 1):
                    for c2 in range(low[2], high[2] + 1):
                        for c3 in range(low[3], high[3] + 1):
                            row = ((((c0 << _BITS) | c1) << _BITS | c2) << _BITS | c3) << _BITS
                            at = np.searchsorted(codes, row + low[4])
                            while at < len(codes) and codes[at] <= row + high[4]:
                                for e in range(starts[at], starts[at + 1]):
                                    misfit, near = 0.0, True
                                    for k in range(5):
                                        difference = STEP * stored[e, k] - wanted[k]
                                        if abs(difference) > tolerance:
                                            near = False
                                            break
                                        misfit += difference * difference
                                    if not near or keys[slots[e]] < 0:
                                        continue
                                    if found == capacity:
                                        capacity *= 2
                                        out_quad, out_key = _doubled(out_quad), _doubled(out_key)
                                        out_ordinal, out_turned = _doubled(out_ordinal), _doubled(out_turned)
                                        out_rotation, out_misfit = _doubled(out_rotation), _doubled(out_misfit)
                                    turn = (
                                        stored_directions[e] * (math.pi / 32_768.0) - directions[q] - math.pi * reading
                                    )
                                    out_quad[found], out_key[found] = q, keys[slots[e]]
                                    out_ordinal[found], out_turned[found] = ordinals[e], reading == 1
                                    out_rotation[found], out_misfit[found] = turn, misfit
                                    found += 1
                                at += 1
        if found - before > most:
            found = before
    return (
        out_quad[:found],
        out_key[:found],
        out_ordinal[:found],
        out_turned[:found],
        out_rotation[:found],
        out_misfit[:found],
    )


@kernel
def _doubled(array: NDArray[Any]) -> NDArray[Any]:
    larger = np.empty(2 * len(array), array.dtype)
    larger[: len(array)] = array
    return larger
