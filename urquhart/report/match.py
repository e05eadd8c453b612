"""The picture of a match: two sets of landmarks in one frame, with partners joined and misses crossed."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from urquhart.budget import UNBOUNDED, Budget
from urquhart.decide.candidates import Candidate
from urquhart.report.svg import MOST, Canvas, left_out

LEGEND: Final = "cross: seen by one side only, pale: outside the overlap"
"""The legend of an overlay."""
PARTNERS: Final = 0.75
"""Metres: largest distance of two landmarks that are joined in the picture."""
_EDGE: Final = 1e-9
"""Metres: tolerance for landmarks on the edge of a hull, because of rounding."""


def draw_match(
    query_xy: ArrayLike, submap_xy: ArrayLike, candidate: Candidate, *, title: str = "", budget: Budget = UNBOUNDED
) -> str:
    """Draw a match as SVG in the submap frame: both sets of landmarks, with inlier pairs joined and misses crossed.

    Args:
        query_xy, submap_xy: (N, 2), (M, 2), metres, each in its own frame, as posted.
        candidate: the match.
        title: above the picture.
        budget: when the work must end; by default never.

    Raises:
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the picture any more.
    """
    submap = np.asarray(submap_xy, dtype=np.float64)
    query = candidate.transform.apply(np.asarray(query_xy, dtype=np.float64))
    subtitle = (
        f"{len(candidate.residuals)} inliers, RMS {candidate.rms:.2f} m, overlap {candidate.overlap_ratio:.0%}, "
        f"confidence {_odds(candidate.confidence)}"
    )
    canvas = Canvas(
        np.concatenate([submap, query]),
        title or "Match",
        subtitle,
        f"filled: query, ring: submap, {LEGEND}",
        *left_out(len(query), len(submap)),
    )
    overlay(canvas, query, submap, candidate.query_indices, candidate.submap_indices, budget)
    return canvas.render()


def overlay(
    canvas: Canvas,
    query: NDArray[np.float64],
    submap: NDArray[np.float64],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    budget: Budget,
) -> None:
    """Draw two sets of landmarks (N, 2), (M, 2), metres, in one frame, with partners joined and misses crossed.

    A landmark without a partner is a miss if it lies in the hull of the other side; outside, it is only drawn pale. At
    most `MOST` landmarks of each side are drawn: those in the overlap first, and a random sample of them.

    Args:
        first, second: (K,), indices of the partners in `query` and `submap`.

    Raises:
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the picture any more.
    """
    rng = np.random.default_rng(0)
    turn_of_query, turn_of_submap = rng.random(len(query)), rng.random(len(submap))
    turn_of_submap[second] = turn_of_query[first]  # partners are drawn together
    query_paired, submap_paired = np.zeros(len(query), np.bool_), np.zeros(len(submap), np.bool_)
    query_paired[first] = submap_paired[second] = True
    query_inside, submap_inside = query_paired | covered(query, submap), submap_paired | covered(submap, query)
    query_shown, submap_shown = _thinned(query_inside, turn_of_query), _thinned(submap_inside, turn_of_submap)
    both = query_shown[first] & submap_shown[second]
    for i, j in budget.each(zip(first[both].tolist(), second[both].tolist(), strict=True)):
        canvas.line(query[i], submap[j], "pair")
    for name, radius, side, paired, inside, shown in (
        ("submap", 6.0, submap, submap_paired, submap_inside, submap_shown),
        ("query", 3.5, query, query_paired, query_inside, query_shown),
    ):
        for i in budget.each(np.flatnonzero(shown).tolist()):
            canvas.circle(side[i], radius, name if inside[i] else f"{name} outside", f"{name} {i}")
            if inside[i] and not paired[i]:
                canvas.cross(side[i], 5.0, "miss")


def _odds(confidence: float) -> str:
    return "over 0.9999" if confidence > 0.9999 else f"{confidence:.4f}"


def _thinned(inside: NDArray[np.bool_], turn: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which landmarks (N,) are drawn: at most `MOST`, those `inside` the overlap first, in the order of `turn` (N,)."""
    shown = np.zeros(len(inside), np.bool_)
    shown[np.lexsort((turn, ~inside))[:MOST]] = True
    return shown


def covered(points: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which `points` (N, 2) lie inside the convex hull of `others` (M, 2), or on its edge: (N,) bool.

    Takes n log n steps, and memory for the points only, however many corners the hull has.
    """
    x, y = points.T
    order = np.lexsort((others[:, 1], others[:, 0]))
    ordered = others[order]
    columns, lowest = np.unique(ordered[:, 0], return_index=True)
    highest = np.append(lowest[1:], len(ordered)) - 1
    below = _lower_chain(columns, ordered[lowest, 1])
    above = -_lower_chain(columns, -ordered[highest, 1])
    within = (x >= columns[0] - _EDGE) & (x <= columns[-1] + _EDGE)
    return np.asarray(
        within & (y >= np.interp(x, columns, below) - _EDGE) & (y <= np.interp(x, columns, above) + _EDGE)
    )


def _lower_chain(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lower edge of the convex hull of points `x`, `y` (N,), `x` ascending, as its y (N,) at each `x`."""
    corners: list[tuple[float, float]] = []
    for there, low in zip(x.tolist(), y.tolist(), strict=True):
        while len(corners) > 1:
            (x0, y0), (x1, y1) = corners[-2:]
            if (x1 - x0) * (low - y0) > (y1 - y0) * (there - x0):
                break
            corners.pop()
        corners.append((there, low))
    at, value = zip(*corners, strict=True)
    return np.asarray(np.interp(x, at, value), np.float64)


def partners(
    query: NDArray[np.float64], submap: NDArray[np.float64], budget: Budget = UNBOUNDED
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (K,), (K,) of landmarks (N, 2), (M, 2), metres, one frame, that are each other's nearest.

    Partners are at most `PARTNERS` metres apart.

    Raises:
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the picture any more.
    """
    there, back = _nearest(query, submap, budget), _nearest(submap, query, budget)
    near = np.flatnonzero(there < len(submap))
    mutual = near[back[there[near]] == near]
    return mutual, there[mutual]


def _nearest(points: NDArray[np.float64], others: NDArray[np.float64], budget: Budget) -> NDArray[np.int64]:
    """For each of `points` (N, 2), the index of the nearest of `others` (M, 2) within `PARTNERS`, or M: (N,).

    Without the bound, a point in the middle of a ring would be compared with the whole ring.
    """
    tree, bound = cKDTree(others), math.nextafter(PARTNERS, math.inf)
    parts = [
        tree.query(points[rows], distance_upper_bound=bound)[1] for rows in budget.portions(len(points), len(others))
    ]
    return np.concatenate(parts).astype(np.int64)
