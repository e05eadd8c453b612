"""Quads by range search in FAISS: every one whose five lengths lie within a ball about a query's, a vote each.

The ball has the volume of the box in which the method looks for the same quads, so both find about as many.
"""

import math
from typing import Any, Final

import faiss
import numpy as np
from numpy.typing import NDArray

from benchmarks.scale.measurement_plan import EXACT_UP_TO
from benchmarks.scale.rivals.rival import CONFIG, TOLERANCE, Described, RivalRanking, most
from urquhart import Features
from urquhart._kernel import kernel
from urquhart.se2 import fit

_UNIT_BALL: Final = 8.0 * math.pi**2 / 15.0
"""Volume of the unit ball in five dimensions."""
RADIUS: Final = 2.0 * TOLERANCE / _UNIT_BALL**0.2
"""Metres."""
_TURNED: Final = [2, 3, 0, 1, 4]
"""The lengths of a quad read from its third landmark on."""
_PROBES: Final = 16
"""Lists looked into for each quad."""
_TRAINED: Final = 64
"""Quads for each list that its centre is found with."""
_CHUNK: Final = 2_000_000


class QuadRival:
    """FAISS over quads; one thread, as every look-up has."""

    refined = 1

    def __init__(self) -> None:
        self._lengths: list[NDArray[np.float32]] = []
        self._counts: list[int] = []
        self._index: Any = None
        self._owner = np.empty(0, np.int32)
        self._starts = np.empty(0, np.int64)

    def add(self, features: Features) -> None:
        """Take the next submap in."""
        lengths = measure(features.landmarks, features.tessellation.quads)[0]
        self._lengths.append(lengths)
        self._counts.append(len(lengths))

    def build(self) -> None:
        """Exact for few quads; for many about four lists for the root of their number, by k-means of a sample."""
        lengths = np.concatenate(self._lengths)
        self._lengths.clear()
        counts = np.array(self._counts)
        self._owner = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        self._starts = np.concatenate([[0], np.cumsum(counts)])
        if len(counts) <= EXACT_UP_TO:
            self._index = faiss.IndexFlatL2(5)
        else:
            lists = 2 ** round(math.log2(4.0 * math.sqrt(len(lengths))))
            self._index = faiss.IndexIVFFlat(faiss.IndexFlatL2(5), 5, lists)
            sample = np.random.default_rng(0).choice(len(lengths), min(len(lengths), _TRAINED * lists), replace=False)
            self._index.train(lengths[np.sort(sample)])
            self._index.nprobe = _PROBES
        for start in range(0, len(lengths), _CHUNK):
            self._index.add(lengths[start : start + _CHUNK])
        faiss.omp_set_num_threads(1)

    def nbytes(self) -> int:
        """Five lengths a quad, its submap, and in inverted lists its number."""
        each = 20 + (8 if isinstance(self._index, faiss.IndexIVFFlat) else 0)
        return each * int(self._index.ntotal) + self._owner.nbytes + self._starts.nbytes

    def rank(self, query: Described, count: int) -> RivalRanking:
        """Votes of all hits, both readings of each quad of the query."""
        features = query.features
        lengths = measure(features.landmarks, features.tessellation.quads)[0]
        asked = np.concatenate([lengths, lengths[:, _TURNED]])
        limits, _, found = self._index.range_search(asked, RADIUS**2)
        asker = np.repeat(np.arange(len(asked)), np.diff(limits.astype(np.int64)))
        owner = self._owner[found]
        votes = np.bincount(owner, minlength=len(self._counts))
        return RivalRanking(most(votes, count), (asker, found, owner))

    def poses(self, query: Described, ranking: RivalRanking, at: int, submap: Described) -> NDArray[np.float64]:
        """Each hit turns the query's quad onto the submap's; those that fit best."""
        asker, found, owner = ranking.evidence
        key = int(ranking.submaps[at])
        hits = np.flatnonzero(owner == key)
        theirs, ours = submap.features, query.features
        quads = ours.tessellation.quads
        transforms, misfit = align_quads(
            ours.landmarks,
            quads,
            theirs.landmarks,
            theirs.tessellation.quads,
            (asker[hits] % len(quads)).astype(np.int32),
            (found[hits] - self._starts[key]).astype(np.int32),
            asker[hits] >= len(quads),
        )
        return transforms[np.argsort(misfit, kind="stable")[: CONFIG.hypotheses]]


@kernel
def measure(
    landmarks: NDArray[np.float64], quads: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Five lengths (Q, 5) float32, metres (four sides, then the diagonal), and the direction (Q,) of the diagonal.

    Directions are radians, counter-clockwise from the x axis, from the first landmark to the third.
    """
    lengths, directions = np.empty((len(quads), 5), np.float32), np.empty(len(quads), np.float32)
    for q in range(len(quads)):
        for k in range(4):
            a, b = quads[q, k], quads[q, (k + 1) % 4]
            lengths[q, k] = math.hypot(landmarks[b, 0] - landmarks[a, 0], landmarks[b, 1] - landmarks[a, 1])
        dx = landmarks[quads[q, 2], 0] - landmarks[quads[q, 0], 0]
        dy = landmarks[quads[q, 2], 1] - landmarks[quads[q, 0], 1]
        lengths[q, 4], directions[q] = math.hypot(dx, dy), math.atan2(dy, dx)
    return lengths, directions


@kernel
def align_quads(
    query: NDArray[np.float64],
    query_quads: NDArray[np.int32],
    submap: NDArray[np.float64],
    submap_quads: NDArray[np.int32],
    hits_query: NDArray[np.int32],
    hits_submap: NDArray[np.int32],
    turned: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transforms (H, 3), x, y, yaw of submap_T_query, from query quads onto submap quads, and misfits (H,), metres.

    `hits_query`, `hits_submap` (H,): which quads; `turned` (H,): the submap's quad is read from its third landmark on.
    """
    transforms, misfit = np.empty((len(hits_query), 3)), np.empty(len(hits_query))
    first, second = np.empty(4, np.int64), np.empty(4, np.int64)
    for h in range(len(hits_query)):
        shift = 2 if turned[h] else 0
        for k in range(4):
            first[k] = query_quads[hits_query[h], k]
            second[k] = submap_quads[hits_submap[h], (k + shift) % 4]
        x, y, yaw = fit(query, submap, first, second)
        c, s = math.cos(yaw), math.sin(yaw)
        total = 0.0
        for k in range(4):
            i, j = first[k], second[k]
            dx = c * query[i, 0] - s * query[i, 1] + x - submap[j, 0]
            dy = s * query[i, 0] + c * query[i, 1] + y - submap[j, 1]
            total += dx * dx + dy * dy
        transforms[h, 0], transforms[h, 1], transforms[h, 2] = x, y, yaw
        misfit[h] = math.sqrt(0.25 * total)
    return transforms, misfit
