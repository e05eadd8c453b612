"""The paper's matching (section IV-C): polygons, then their triangles, then edges, then landmarks.

It is used by `method="paper"`; the robust method computes a transform directly from each hit.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.budget import UNBOUNDED, Budget
from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.features.polygon_descriptor import describe_triangles
from urquhart.index.polygon_search import POLYGONS


class MatchingNumbers(NamedTuple):
    """Numbers of the paper's matching."""

    preferred: tuple[int, int] = (4, 9)
    """Fewest and most vertices of the polygons that sampling takes first (paper, section V-B): larger polygons break
    easily, and triangles say little."""
    pair_steps: int = 100
    """Mean steps of work to compare two polygons, most of which differ in their descriptors. Chosen by hand."""


MATCHING: Final = MatchingNumbers()


class Polygons(NamedTuple):
    """The polygons of one side of a matching, as a plain tuple for kernels.

    Attributes:
        landmarks: (N, 2) float64, metres, centred frame.
        triangles, members, member_offsets: as in `Tessellation`.
        triangle_rows: (T, D) float32, descriptors of the triangles.
        counts: (P,) int32, vertices of each polygon.
        descriptors: (P, D) float32, descriptors of the polygons.
        sample: (K,) int64, indices of the polygons that are matched.
    """

    landmarks: NDArray[np.float64]
    triangles: NDArray[np.int32]
    triangle_rows: NDArray[np.float32]
    members: NDArray[np.int32]
    member_offsets: NDArray[np.int32]
    counts: NDArray[np.int32]
    descriptors: NDArray[np.float32]
    sample: NDArray[np.int64]


def sample_polygons(counts: NDArray[np.int32], gamma: int | None, rng: np.random.Generator) -> NDArray[np.int64]:
    """A random sample of at most `gamma` polygons, as indices (K,): 4 to 9 vertices first, then larger, then triangles.

    Args:
        counts: (P,) int32, vertices of each polygon.
        gamma: the paper's bound on polygons per observation (section V-B); None keeps all.
    """
    if gamma is None or gamma >= len(counts):
        return np.arange(len(counts))
    low, high = MATCHING.preferred
    tier = np.where(counts < low, 2, np.where(counts <= high, 0, 1))
    return np.sort(np.lexsort((rng.random(len(counts)), tier))[:gamma])


def match_landmarks(
    query: Features, submap: Features, config: Config, rng: np.random.Generator, budget: Budget = UNBOUNDED
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One-to-one landmark correspondences (K,), (K,) int64 between two sets of features (paper, section IV-C).

    Polygons correspond if their vertex counts differ by at most `vertex_window`, and their descriptors by less than
    `tau`. They count if more than a share `eta` of the first one's triangles (phi) has a partner among the second
    one's. The edges of two partner triangles are assigned by length, and a landmark corresponds to the landmark that
    the partners of its two edges share. If several triangles disagree, the most frequent claim wins.

    Raises:
        DeadlinePassed: the deadline passed before all polygons were compared.
    """
    first = sampled_polygons(query, config, rng)
    budget.check()
    second = sampled_polygons(submap, config, rng)
    budget.check()
    claims = [
        claim_landmarks(first._replace(sample=first.sample[rows]), second, config.tau, config.vertex_window, config.eta)
        for rows in budget.portions(len(first.sample), MATCHING.pair_steps * len(second.sample))
    ]
    none = np.empty((0, 2), np.int64)
    return keep_one_to_one(np.concatenate([none, *claims]), len(query.landmarks), len(submap.landmarks))


def sampled_polygons(features: Features, config: Config, rng: np.random.Generator) -> Polygons:
    """The polygons of one side of a matching, sampled, with descriptors of their triangles."""
    t = features.tessellation
    counts = t.vertex_counts()
    sample = sample_polygons(counts, config.gamma, rng)
    triangle_rows = describe_triangles(features.landmarks, t.triangles, config.samples, config.squared)
    return Polygons(
        features.landmarks,
        t.triangles,
        triangle_rows,
        t.members,
        t.member_offsets,
        counts,
        features.descriptors,
        sample[counts[sample] <= POLYGONS.largest],
    )


@kernel
def claim_landmarks(query: Polygons, submap: Polygons, tau: float, window: int, eta: float) -> NDArray[np.int64]:
    """The claims (C, 2) of all pairs of triangles: a query landmark, and its partner among the submap's.

    `tau`, `window`, `eta`: `tau`, `vertex_window` and `eta` of `Config`.
    """
    # A triangle belongs to one polygon, but a polygon may have several partners: the array grows if there are many.
    claims, count = np.empty((1024, 2), np.int64), 0
    mapping = np.empty(3, np.int64)
    partner = np.empty(len(query.triangles), np.int64)
    for m in query.sample:
        for n in submap.sample:
            if abs(query.counts[m] - submap.counts[n]) > window:
                continue
            if row_distance(query.descriptors, m, submap.descriptors, n) >= tau * tau:
                continue
            first, last = query.member_offsets[m], query.member_offsets[m + 1]
            if pair_triangles(query, m, submap, n, tau, partner) <= eta * (last - first):
                continue
            for a in range(first, last):
                u = partner[a - first]
                if u < 0:
                    continue
                t = query.members[a]
                assign_edges(query.landmarks, query.triangles[t], submap.landmarks, submap.triangles[u], mapping)
                if count + 3 > len(claims):
                    larger = np.empty((2 * len(claims), 2), np.int64)
                    larger[:count] = claims[:count]
                    claims = larger
                for k in range(3):
                    claims[count, 0] = query.triangles[t, k]
                    claims[count, 1] = submap.triangles[u, mapping[k]]
                    count += 1
    return claims[:count].copy()


@kernel
def pair_triangles(query: Polygons, m: int, submap: Polygons, n: int, tau: float, partner: NDArray[np.int64]) -> int:
    """Pair the triangles of polygon `m` and polygon `n` that are each other's nearest; returns the number of pairs.

    `partner`: filled with the partner of each triangle of polygon `m`, -1 for none; `tau`: largest distance.
    """
    first, last = query.member_offsets[m], query.member_offsets[m + 1]
    found = 0
    for a in range(first, last):
        t = query.members[a]
        partner[a - first] = -1
        begin, end = submap.member_offsets[n], submap.member_offsets[n + 1]
        u, distance = nearest_row(query.triangle_rows, t, submap.triangle_rows, submap.members, begin, end)
        if distance >= tau * tau:
            continue
        back, _ = nearest_row(submap.triangle_rows, u, query.triangle_rows, query.members, first, last)
        if back == t:
            partner[a - first] = u
            found += 1
    return found


@kernel
def row_distance(a: NDArray[np.float32], i: int, b: NDArray[np.float32], j: int) -> float:
    """Squared Euclidean distance between descriptors `a[i]` and `b[j]`."""
    total = 0.0
    for k in range(a.shape[1]):
        difference = a[i, k] - b[j, k]
        total += difference * difference
    return total


@kernel
def nearest_row(
    rows: NDArray[np.float32], i: int, others: NDArray[np.float32], members: NDArray[np.int32], first: int, last: int
) -> tuple[int, float]:
    """The index of the nearest to `rows[i]` among `others[members[first:last]]`, and its squared distance."""
    best, best_distance = -1, np.inf
    for at in range(first, last):
        distance = row_distance(rows, i, others, members[at])
        if distance < best_distance:
            best, best_distance = members[at], distance
    return best, best_distance


@kernel
def assign_edges(
    query: NDArray[np.float64],
    first: NDArray[np.int32],
    submap: NDArray[np.float64],
    second: NDArray[np.int32],
    mapping: NDArray[np.int64],
) -> None:
    """Write into `mapping` (3,) which corner of triangle `second` (3,) each corner of `first` (3,) corresponds to.

    It is the permutation chi with the smallest differences of the edge lengths (paper, section IV-C). Edge k lies
    opposite to corner k, so the permutation of the edges is also that of the corners.

    `query`, `submap`: landmarks (N, 2), (M, 2), metres.
    """
    a, b = np.empty(3), np.empty(3)
    for k in range(3):
        i, j = first[(k + 1) % 3], first[(k + 2) % 3]
        a[k] = math.hypot(query[i, 0] - query[j, 0], query[i, 1] - query[j, 1])
        i, j = second[(k + 1) % 3], second[(k + 2) % 3]
        b[k] = math.hypot(submap[i, 0] - submap[j, 0], submap[i, 1] - submap[j, 1])
    best = np.inf
    for x in range(3):
        for y in range(3):
            if y == x:
                continue
            z = 3 - x - y
            cost = (a[0] - b[x]) ** 2 + (a[1] - b[y]) ** 2 + (a[2] - b[z]) ** 2
            if cost < best:
                best = cost
                mapping[0], mapping[1], mapping[2] = x, y, z


def keep_one_to_one(
    claims: NDArray[np.int64], query_count: int, submap_count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One-to-one correspondences (K,), (K,) int64 from claims (C, 2): the most frequent claim wins, ties by index."""
    if not len(claims):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    pairs, frequency = np.unique(claims[:, 0] * submap_count + claims[:, 1], return_counts=True)
    pairs = pairs[np.argsort(-frequency, kind="stable")]
    query_taken, submap_taken = np.zeros(query_count, np.bool_), np.zeros(submap_count, np.bool_)
    kept = []
    for i, j in zip((pairs // submap_count).tolist(), (pairs % submap_count).tolist(), strict=True):
        if not query_taken[i] and not submap_taken[j]:
            query_taken[i] = submap_taken[j] = True
            kept.append((i, j))
    pairs_kept = np.array(sorted(kept), np.int64)
    return pairs_kept[:, 0], pairs_kept[:, 1]
