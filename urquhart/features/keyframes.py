"""Several views of one place, with odometry between them, joined to one observation.

The search then sees one observation: the evidence of all views adds up, and there is one set of rivals. Each tree
counts once, at the mean of where it was seen, so that a tree in three views is no threefold evidence. A tree that does
not come together stays twice, and counts against a pose: odometry that is off makes a match less likely, never more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from urquhart.se2 import SE2, fit


class KeyframeNumbers(NamedTuple):
    """How views are joined. Chosen by hand; `tests/urquhart/test_keyframes.py` counts what three views decide."""

    same: float = 0.5
    """Metres within which the nearest trees of two views are one tree."""
    reach: float = 1.0
    """The same while a view is still shifted onto the ones before: odometry may be off by as much."""
    shared: int = 5
    """Fewest trees that a view shares with those before, for it to be shifted."""
    rounds: int = 3
    """How often a view is shifted."""


KEYFRAMES: Final = KeyframeNumbers()


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """One view.

    Attributes:
        xy: (N, 2) float64, metres, frame of the view.
        pose: takes points of the view to the frame of the sequence, such as that of the odometry.
        diameters: (N,) float64, metres, NaN where unknown; None if none is known.
    """

    xy: NDArray[np.float64]
    pose: SE2
    diameters: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JoinedKeyframes:
    """The trees of all views.

    Attributes:
        xy: (M, 2) float64, metres, frame of the sequence: the mean of where the views saw each tree.
        first: (M, 2) int64, the view that saw a tree first, and its number there.
        seen: (M,) int64, in how many views it is.
        diameters: (M,) float64, metres: the median of those known, NaN where none is; None if none is known at all.
    """

    xy: NDArray[np.float64]
    first: NDArray[np.int64]
    seen: NDArray[np.int64]
    diameters: NDArray[np.float64] | None


def join_keyframes(keyframes: Sequence[Keyframe]) -> JoinedKeyframes:
    """Join views to one observation in the frame of the sequence. Two trees of one view never become one."""
    xy, seen = np.empty((0, 2)), np.empty(0, np.int64)
    first, diameters = list[tuple[int, int]](), list[list[float]]()
    for number, view in enumerate(keyframes):
        there = _shifted(view.pose.apply(view.xy), xy)
        old, new = _pairs(xy, there, KEYFRAMES.same)
        xy[old] += (there[new] - xy[old]) / (seen[old] + 1)[:, None]
        seen[old] += 1
        known = np.full(len(view.xy), np.nan) if view.diameters is None else view.diameters
        for tree, place in zip(old.tolist(), new.tolist(), strict=True):
            diameters[tree].append(float(known[place]))
        fresh = np.setdiff1d(np.arange(len(there)), new)
        xy, seen = np.concatenate([xy, there[fresh]]), np.concatenate([seen, np.ones(len(fresh), np.int64)])
        first += [(number, place) for place in fresh.tolist()]
        diameters += [[float(known[place])] for place in fresh.tolist()]
    medians = np.array([_median(values) for values in diameters])
    some = bool(np.isfinite(medians).any())
    return JoinedKeyframes(xy, np.array(first, np.int64).reshape(-1, 2), seen, medians if some else None)


def _shifted(there: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.float64]:
    """A view (N, 2) moved onto the trees before (M, 2), if it shares enough of them and fits better then."""
    for _ in range(KEYFRAMES.rounds):
        old, new = _pairs(before, there, KEYFRAMES.reach)
        if len(old) < KEYFRAMES.shared:
            break
        there = SE2(*fit(there, before, new, old)).apply(there)
    return there


def _pairs(
    before: NDArray[np.float64], there: NDArray[np.float64], within: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Trees that are each other's nearest within a distance, metres: their numbers in both."""
    if not len(before) or not len(there):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    away, nearest = (np.asarray(found) for found in cKDTree(before).query(there))
    back = np.asarray(cKDTree(there).query(before)[1])
    new = np.flatnonzero((back[nearest] == np.arange(len(there))) & (away <= within))
    return np.asarray(nearest[new], np.int64), new.astype(np.int64)


def _median(values: list[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")
