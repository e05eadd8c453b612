"""Triangles in a hash table, after the Stable Triangle Descriptor (Yuan et al., ICRA 2023), for points in the plane.

Three sorted side lengths, in whole metres, name a cell; a query's triangle looks into the neighbouring cells, too, and
each triangle there with all sides near votes for its submap. The original has planes and their normals to tell mirror
images apart; here it is the sense in which the sides grow. Its key points are few; here each Delaunay triangle counts.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.scale.rivals.rival import CONFIG, TOLERANCE, Described, RivalRanking, most
from urquhart import Features
from urquhart._kernel import kernel
from urquhart.se2 import fit

_CELL: Final = 1.0
"""Metres."""
_BITS: Final = 10
"""Bits for each side in a cell's name."""


class TriangleRival:
    """The table: triangles sorted by cell, and where each cell begins."""

    refined = 1

    def __init__(self) -> None:
        self._sides: list[NDArray[np.float32]] = []
        self._corners: list[NDArray[np.int32]] = []
        self._submaps = 0
        self._codes, self._starts = np.empty(0, np.int64), np.empty(0, np.int64)
        self._table, self._vertices = np.empty((0, 3), np.float32), np.empty((0, 3), np.uint16)
        self._owner = np.empty(0, np.int32)

    def add(self, features: Features) -> None:
        """Take the next submap in."""
        sides, corners = sorted_triangles(features.landmarks, features.tessellation.triangles)
        self._sides.append(sides)
        self._corners.append(corners)
        self._submaps += 1

    def build(self) -> None:
        """Sort all triangles by cell."""
        counts = [len(sides) for sides in self._sides]
        owner = np.repeat(np.arange(self._submaps, dtype=np.int32), counts)
        sides, corners = np.concatenate(self._sides), np.concatenate(self._corners).astype(np.uint16)
        self._sides.clear()
        self._corners.clear()
        codes = cell_codes(sides)
        order = np.argsort(codes, kind="stable")
        self._codes, first = np.unique(codes[order], return_index=True)
        self._starts = np.append(first, len(codes)).astype(np.int64)
        self._table, self._vertices, self._owner = sides[order], corners[order], owner[order]

    def nbytes(self) -> int:
        """All arrays of the table."""
        return sum(a.nbytes for a in (self._codes, self._starts, self._table, self._vertices, self._owner))

    def rank(self, query: Described, count: int) -> RivalRanking:
        """Votes of all triangles that are alike."""
        sides, corners = sorted_triangles(query.features.landmarks, query.features.tessellation.triangles)
        everyone = np.empty(0, np.bool_)
        votes, _, _ = find(
            sides, self._codes, self._starts, self._table, self._owner, TOLERANCE, self._submaps, everyone
        )
        chosen = most(votes, count)
        wanted = np.zeros(self._submaps, np.bool_)
        wanted[chosen] = True
        _, asker, entry = find(
            sides, self._codes, self._starts, self._table, self._owner, TOLERANCE, self._submaps, wanted
        )
        return RivalRanking(chosen, (corners, asker, entry))

    def poses(self, query: Described, ranking: RivalRanking, at: int, submap: Described) -> NDArray[np.float64]:
        """Each pair of triangles that are alike, laid over each other; those whose sides agree best."""
        corners, asker, entry = ranking.evidence
        hits = np.flatnonzero(self._owner[entry] == ranking.submaps[at])
        first, second = corners[asker[hits]], self._vertices[entry[hits]].astype(np.int32)
        transforms, misfit = lay_over(query.features.landmarks, submap.features.landmarks, first, second)
        return transforms[np.argsort(misfit, kind="stable")[: CONFIG.hypotheses]]


@kernel
def sorted_triangles(
    landmarks: NDArray[np.float64], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Side lengths (T, 3) float32, metres, ascending, and the corners (T, 3) opposite to them.

    The first length is negative where the sides, from the shortest to the longest, run clockwise.
    """
    sides, corners = np.empty((len(triangles), 3), np.float32), np.empty((len(triangles), 3), np.int32)
    lengths = np.empty(3)
    for t in range(len(triangles)):
        for k in range(3):
            a, b = landmarks[triangles[t, (k + 1) % 3]], landmarks[triangles[t, (k + 2) % 3]]
            lengths[k] = np.hypot(b[0] - a[0], b[1] - a[1])
        order = np.argsort(lengths)
        for k in range(3):
            sides[t, k], corners[t, k] = lengths[order[k]], triangles[t, order[k]]
        if (order[0] + 1) % 3 != order[1]:
            sides[t, 0] = -sides[t, 0]
    return sides, corners


@kernel
def cell_codes(sides: NDArray[np.float32]) -> NDArray[np.int64]:
    """Names (T,) of the cells that triangles (T, 3) lie in."""
    codes = np.empty(len(sides), np.int64)
    for t in range(len(sides)):
        code = np.int64(0)
        for k in range(3):
            code = (code << _BITS) | min(int(abs(sides[t, k]) / _CELL), (1 << _BITS) - 1)
        codes[t] = code
    return codes


@kernel
def find(
    asked: NDArray[np.float32],
    codes: NDArray[np.int64],
    starts: NDArray[np.int64],
    table: NDArray[np.float32],
    owner: NDArray[np.int32],
    tolerance: float,
    submaps: int,
    wanted: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """Votes (N,) of all submaps, where none are `wanted` in particular; else the hits in those that are (N,).

    A hit is a triangle of the query (H,) and one of the table (H,) that is like it.
    """
    votes = np.zeros(submaps, np.int64)
    count = 0
    asker, entry = np.empty(1024, np.int32), np.empty(1024, np.int64)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for q in range(len(asked)):
        for k in range(3):
            low[k] = max(int((abs(asked[q, k]) - tolerance) / _CELL), 0)
            high[k] = int((abs(asked[q, k]) + tolerance) / _CELL)
        for a in range(low[0], high[0] + 1):
            for b in range(low[1], high[1] + 1):
                for c in range(low[2], high[2] + 1):
                    code = (((a << _BITS) | b) << _BITS) | c
                    at = np.searchsorted(codes, code)
                    if at == len(codes) or codes[at] != code:
                        continue
                    for e in range(starts[at], starts[at + 1]):
                        if (
                            abs(table[e, 0] - asked[q, 0]) > tolerance
                            or abs(table[e, 1] - asked[q, 1]) > tolerance
                            or abs(table[e, 2] - asked[q, 2]) > tolerance
                        ):
                            continue
                        if len(wanted) == 0:
                            votes[owner[e]] += 1
                        elif wanted[owner[e]]:
                            if count == len(asker):
                                larger, longer = np.empty(2 * count, np.int32), np.empty(2 * count, np.int64)
                                larger[:count], longer[:count] = asker, entry
                                asker, entry = larger, longer
                            asker[count], entry[count] = q, e
                            count += 1
    return votes, asker[:count].copy(), entry[:count].copy()


@kernel
def lay_over(
    query: NDArray[np.float64], submap: NDArray[np.float64], first: NDArray[np.int32], second: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transforms (H, 3) of corners (H, 3) of the query onto the submap's, and squared misfits (H,), square metres."""
    transforms, misfit = np.empty((len(first), 3)), np.zeros(len(first))
    for h in range(len(first)):
        ours, theirs = first[h].astype(np.int64), second[h].astype(np.int64)
        x, y, yaw = fit(query, submap, ours, theirs)
        c, s = np.cos(yaw), np.sin(yaw)
        transforms[h, 0], transforms[h, 1], transforms[h, 2] = x, y, yaw
        for k in range(3):
            i, j = ours[k], theirs[k]
            misfit[h] += (c * query[i, 0] - s * query[i, 1] + x - submap[j, 0]) ** 2
            misfit[h] += (s * query[i, 0] + c * query[i, 1] + y - submap[j, 1]) ** 2
    return transforms, misfit
