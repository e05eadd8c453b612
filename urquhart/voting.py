"""From hits to submaps worth verifying.

Polygons. A hit with the same number of vertices is more than a vote: turning one outline onto the other gives a full
transform, and how well it fits tells how much the hit is worth. n vertices that agree to r metres do so by chance with
a probability that falls as r^(2n - 3) (2n coordinates less the three that the alignment fits), so a hit votes (2n - 3)
log(scale / r): large polygons that fit tightly count most.

Quads. Hits are many and each says little, but those of the right submap agree in the rotation: each hit votes for its
submap and rotation, with the share it has in all that its query quad found, so that a rare shape counts for more than a
common one.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart._kernel import kernel
from urquhart.features import Features
from urquhart.index import Hits
from urquhart.quad_index import QuadHits
from urquhart.quads import align_quads

_TURN_BINS: Final = 30
"""Bins of rotation; a vote is shared between the two nearest, so that no border splits a true peak."""
TURN: Final = 1.2 * 2.0 * math.pi / _TURN_BINS
"""Radians: how far the rotation of a submap may be from the peak of its votes."""


@dataclass(frozen=True, slots=True, eq=False)
class Votes:
    """Submaps by falling weight of votes, with the hypotheses that voted for each.

    Attributes:
        keys: (S,) int64, submaps.
        weights: (S,) float64.
        counts: (S,) int64, how many polygon hits voted.
        transforms: (H, 3) float64, x, y, yaw of `submap_T_query` between the *centred* frames; sorted by submap.
        offsets: (S + 1,) int64; `transforms[offsets[i]:offsets[i + 1]]` belong to `keys[i]`.
    """

    keys: NDArray[np.int64]
    weights: NDArray[np.float64]
    counts: NDArray[np.int64]
    transforms: NDArray[np.float64]
    offsets: NDArray[np.int64]

    def hypotheses(self, i: int) -> NDArray[np.float64]:
        """Transforms (h, 3) that voted for submap `keys[i]`."""
        return self.transforms[self.offsets[i] : self.offsets[i + 1]]


def outlines(features: Features, count: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Polygons of `features` with `count` vertices: their ordinals (K,) and vertices (K, count, 2), centred frame."""
    t = features.tessellation
    ordinals = np.flatnonzero(t.vertex_counts() == count).astype(np.int32)
    at = t.vertex_offsets[ordinals][:, None] + np.arange(count)
    return ordinals, features.landmarks[t.vertices[at]]


def vote_polygons(query: Features, found: Iterable[Hits], tolerance: float, exclude: frozenset[int]) -> Votes:
    """Align every polygon hit, keep those that fit within `tolerance` metres (RMS), add them up by submap."""
    keys, weights, transforms = [], [], []
    for hits in found:
        wanted = _wanted(hits.keys, exclude)
        ordinals, shapes = outlines(query, hits.count)
        position = np.searchsorted(ordinals, hits.rows[wanted])
        aligned, misfit = align_outlines(shapes, position, hits.outlines[wanted])
        fits = misfit <= tolerance
        keys.append(hits.keys[wanted][fits])
        transforms.append(aligned[fits])
        # Below a few centimetres a better fit says nothing more: trees are not measured better than that.
        weights.append((2 * hits.count - 3) * np.log(1.5 * tolerance / np.maximum(misfit[fits], 0.1 * tolerance)))
    if not sum(map(len, keys)):
        return _NO_VOTES
    return _tally(np.concatenate(keys), np.concatenate(weights), np.concatenate(transforms))


def vote_quads(
    query: Features,
    hits: QuadHits,
    features: Callable[[int], Features],
    tolerance: float,
    candidates: int,
    exclude: frozenset[int],
) -> Votes:
    """The `candidates` submaps whose quad hits agree best in rotation, with the transforms of the hits that do.

    Args:
        features: gives the features of a submap by its key.
        tolerance: metres, largest root mean square misfit of four landmarks for a transform to count.
    """
    turns = _turns(hits, tolerance, exclude)
    if not len(turns.keys):
        return _NO_VOTES
    quads, ordinals, turned = hits.quads[turns.wanted], hits.ordinals[turns.wanted], hits.turned[turns.wanted]
    peak, best = turns.table.argmax(axis=1), turns.table.max(axis=1)
    chosen = np.argsort(-best, kind="stable")[:candidates]
    owner, weights = turns.owner, turns.weights

    out_keys, out_weights, out_transforms = [], [], []
    away = (turns.position - peak[owner] + 0.5 * _TURN_BINS) % _TURN_BINS - 0.5 * _TURN_BINS
    agreeing = np.flatnonzero(np.abs(away) <= 1.0)
    agreeing = agreeing[np.argsort(owner[agreeing], kind="stable")]
    first = np.searchsorted(owner[agreeing], chosen, side="left")
    last = np.searchsorted(owner[agreeing], chosen, side="right")
    for submap, start, end in zip(chosen.tolist(), first.tolist(), last.tolist(), strict=True):
        rows, key = agreeing[start:end], int(turns.keys[submap])
        stored = features(key)
        aligned, rms = align_quads(
            query.landmarks,
            query.tessellation.quads,
            stored.landmarks,
            stored.tessellation.quads,
            quads[rows],
            ordinals[rows],
            turned[rows],
        )
        fits = rms <= tolerance
        out_keys.append(np.full(int(fits.sum()), key))
        out_weights.append(weights[rows][fits])
        out_transforms.append(aligned[fits])
    if not sum(map(len, out_keys)):
        return _NO_VOTES
    return _tally(np.concatenate(out_keys), np.concatenate(out_weights), np.concatenate(out_transforms))


def rank_turns(
    hits: QuadHits, tolerance: float, count: int, exclude: frozenset[int]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The `count` pairs of a submap (K,) and a rotation (K,), radians, that quad hits agree on best, the best first.

    A submap comes once for each rotation that is a peak of its votes; `TURN` is how far a peak may be off.
    """
    turns = _turns(hits, tolerance, exclude)
    if not len(turns.keys):
        return np.empty(0, np.int64), np.empty(0)
    table = turns.table
    peaks = (table > 0.0) & (table >= np.roll(table, 1, axis=1)) & (table > np.roll(table, -1, axis=1))
    rows, bins = np.nonzero(peaks)
    chosen = np.argsort(-table[rows, bins], kind="stable")[:count]
    return turns.keys[rows[chosen]], np.asarray(bins[chosen] * (2.0 * np.pi / _TURN_BINS), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Turns:
    """Quad hits by submap and rotation.

    Attributes:
        wanted: (H,) bool, hits that count; the arrays (h,) below have a row for each of these.
        keys: (S,) int64, submaps; `owner` (h,) says which of them a hit is in.
        table: (S, bins), weight of the votes; `position` (h,) is a hit's place among the bins.
        weights: (h,), what each hit is worth.
    """

    wanted: NDArray[np.bool_]
    keys: NDArray[np.int64]
    owner: NDArray[np.int64]
    position: NDArray[np.float64]
    weights: NDArray[np.float64]
    table: NDArray[np.float64]


def _turns(hits: QuadHits, tolerance: float, exclude: frozenset[int]) -> _Turns:
    wanted = _wanted(hits.keys, exclude)
    quads, keys, misfit, rotations = hits.quads[wanted], hits.keys[wanted], hits.misfit[wanted], hits.rotations[wanted]
    likelihood = np.exp(-misfit / (tolerance * tolerance))
    weights = likelihood / (np.bincount(quads, likelihood)[quads] + 0.1)
    unique, owner = np.unique(keys, return_inverse=True)
    position = np.asarray((rotations / (2.0 * np.pi) % 1.0) * _TURN_BINS, np.float64)
    below = np.minimum(position.astype(np.int64), _TURN_BINS - 1)
    share = position - below
    votes = np.bincount(owner * _TURN_BINS + below, weights * (1.0 - share), len(unique) * _TURN_BINS)
    votes += np.bincount(owner * _TURN_BINS + (below + 1) % _TURN_BINS, weights * share, len(unique) * _TURN_BINS)
    table = np.asarray(votes.reshape(len(unique), _TURN_BINS), np.float64)
    return _Turns(wanted, unique, owner, position, weights, table)


def _wanted(keys: NDArray[np.int64], exclude: frozenset[int]) -> NDArray[np.bool_]:
    return ~np.isin(keys, list(exclude)) if exclude else np.ones(len(keys), np.bool_)


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
    """Best cyclic alignment of query outlines onto found ones.

    Args:
        shapes: (S, n, 2) float64, metres: query outlines, counter-clockwise.
        which: (H,) int64: the query outline of each hit.
        targets: (H, n, 2) float32, metres: the outlines found, counter-clockwise.

    Returns:
        Transforms (H, 3): x, y, yaw of target_T_query; and their root mean square misfit (H,), metres.

    With both outlines centred and read as complex numbers, the best rotation for each of the n ways to start is the
    argument of a correlation, and the misfit follows from its magnitude; no transform is solved but the best.
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
