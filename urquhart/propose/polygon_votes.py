"""Votes of polygons: from polygon hits to submaps worth verifying.

Aligning two outlines with the same number of vertices gives a full transform, and the misfit gives the weight of the
hit. By chance, n vertices agree to r metres with a probability that falls as r^(2n - 3): there are 2n coordinates, and
the alignment fits three numbers. So the weight is (2n - 3) log(scale / r). Large polygons that fit tightly count most.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features.describe import Features
from urquhart.index.polygon_search import PolygonHits


@dataclass(frozen=True, slots=True, eq=False)
class Votes:
    """The votes of polygons by submap, the heaviest first, with the transforms that were voted for.

    Attributes:
        keys: (S,) int64, submaps.
        weights: (S,) float64, total weight of the votes for each.
        counts: (S,) int64, number of votes for each.
        transforms: (H, 3) float64, x, y, yaw of `submap_T_query` between centred frames: sorted by submap, and for each
            by falling weight.
        offsets: (S + 1,) int64; `transforms[offsets[i]:offsets[i + 1]]` belong to `keys[i]`.
    """

    keys: NDArray[np.int64]
    weights: NDArray[np.float64]
    counts: NDArray[np.int64]
    transforms: NDArray[np.float64]
    offsets: NDArray[np.int64]

    def hypotheses(self, i: int) -> NDArray[np.float64]:
        """The transforms (h, 3) that were voted for in submap `keys[i]`, the heaviest vote first."""
        return self.transforms[self.offsets[i] : self.offsets[i + 1]]


def outlines(features: Features, count: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The polygons of `features` with `count` vertices: indices (K,), and vertices (K, count, 2), metres, centred."""
    t = features.tessellation
    ordinals = np.flatnonzero(t.vertex_counts() == count).astype(np.int32)
    at = t.vertex_offsets[ordinals][:, None] + np.arange(count)
    return ordinals, features.landmarks[t.vertices[at]]


def vote_polygons(query: Features, found: Iterable[PolygonHits], tolerance: float) -> Votes:
    """Align every polygon hit, keep those with an RMS misfit of at most `tolerance` metres, and count by submap."""
    keys, weights, transforms = [], [], []
    for hits in found:
        ordinals, shapes = outlines(query, hits.count)
        aligned, misfit = align_outlines(shapes, np.searchsorted(ordinals, hits.rows), hits.outlines)
        fits = misfit <= tolerance
        keys.append(hits.keys[fits])
        transforms.append(aligned[fits])
        # A fit to less than a few centimetres does not count more: trees are not measured better than that.
        weights.append((2 * hits.count - 3) * np.log(1.5 * tolerance / np.maximum(misfit[fits], 0.1 * tolerance)))
    if not sum(map(len, keys)):
        return _NO_VOTES
    return _tally(np.concatenate(keys), np.concatenate(weights), np.concatenate(transforms))


def _tally(keys: NDArray[np.int64], weights: NDArray[np.float64], transforms: NDArray[np.float64]) -> Votes:
    unique, owner, counts = np.unique(keys, return_inverse=True, return_counts=True)
    totals = np.bincount(owner, weights).astype(np.float64)
    ranking = np.argsort(-totals, kind="stable")
    place = np.empty(len(unique), np.int64)
    place[ranking] = np.arange(len(unique))
    order = np.lexsort((-weights, place[owner]))
    offsets = np.concatenate([[0], np.cumsum(counts[ranking])])
    return Votes(unique[ranking], totals[ranking], counts[ranking], transforms[order], offsets)


_NO_VOTES: Final = Votes(
    np.empty(0, np.int64), np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.zeros(1, np.int64)
)


@kernel
def align_outlines(
    shapes: NDArray[np.float64], which: NDArray[np.int64], targets: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Align query outlines with stored ones, by least squares over all n cyclic shifts of the vertices.

    With both outlines centred and read as complex numbers, the best rotation for a shift is the argument of a
    correlation, and the misfit follows from its magnitude. So only the best transform needs to be solved.

    Args:
        shapes: (S, n, 2) float64, metres: query outlines, counter-clockwise.
        which: (H,) int64, the query outline of each hit.
        targets: (H, n, 2) float32, metres: stored outlines, counter-clockwise.

    Returns:
        Transforms (H, 3): x, y, yaw of `target_T_query`; and their root mean square misfit (H,), metres.
    """
    n = shapes.shape[1]
    transforms, misfit = np.empty((len(which), 3)), np.empty(len(which))
    ax, ay, bx, by = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for h in range(len(which)):
        q = which[h]
        qx = qy = tx = ty = 0.0
        for v in range(n):
            qx += shapes[q, v, 0]
            qy += shapes[q, v, 1]
            tx += targets[h, v, 0]
            ty += targets[h, v, 1]
        qx, qy, tx, ty = qx / n, qy / n, tx / n, ty / n
        energy = 0.0
        for v in range(n):
            ax[v], ay[v] = shapes[q, v, 0] - qx, shapes[q, v, 1] - qy
            bx[v], by[v] = targets[h, v, 0] - tx, targets[h, v, 1] - ty
            energy += ax[v] * ax[v] + ay[v] * ay[v] + bx[v] * bx[v] + by[v] * by[v]
        best_dot = best_cross = best = 0.0
        for shift in range(n):
            dot = cross = 0.0
            for v in range(n):
                w = v + shift if v + shift < n else v + shift - n
                dot += ax[v] * bx[w] + ay[v] * by[w]
                cross += ax[v] * by[w] - ay[v] * bx[w]
            strength = math.hypot(dot, cross)
            if strength > best:
                best, best_dot, best_cross = strength, dot, cross
        yaw = math.atan2(best_cross, best_dot)
        c, s = math.cos(yaw), math.sin(yaw)
        transforms[h, 0], transforms[h, 1], transforms[h, 2] = tx - c * qx + s * qy, ty - s * qx - c * qy, yaw
        misfit[h] = math.sqrt(max(energy - 2.0 * best, 0.0) / n)
    return transforms, misfit
