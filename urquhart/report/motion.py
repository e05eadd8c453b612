"""A moving picture of a match, as SVG: the query, beside the submap at first, turns and slides into place."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from urquhart.report.svg import Canvas
from urquhart.se2 import SE2

_GAP: Final = 0.08
"""Space between the submap and the query at the start, as a share of the submap's width."""
_STYLE: Final = """
.moving{{animation:slide 7s ease-in-out infinite;transform-origin:{x:.1f}px {y:.1f}px}}
.proof{{animation:show 7s linear infinite}}
@keyframes slide{{0%,14%{{transform:translate({dx:.1f}px,{dy:.1f}px) rotate({turn:.1f}deg)}}55%,100%{{transform:none}}}}
@keyframes show{{0%,55%{{opacity:0}}62%,100%{{opacity:1}}}}
@media (prefers-reduced-motion:reduce){{.moving,.proof{{animation:none}}}}
"""


def draw_motion(
    query_xy: ArrayLike, submap_xy: ArrayLike, submap_T_query: SE2, pairs: ArrayLike, *, title: str = ""
) -> str:
    """Draw, as SVG, a query that moves into the submap's frame, in a loop of 7 s.

    Viewers without animation show a still picture of the match.

    Args:
        query_xy, submap_xy: (N, 2), (M, 2), metres, each in its own frame.
        submap_T_query: the transform of the match.
        pairs: (K, 2), indices of the inlier pairs in the query and the submap; they are joined at the end.
        title: above the picture.
    """
    submap = np.asarray(submap_xy, dtype=np.float64)
    query = np.asarray(query_xy, dtype=np.float64)
    placed = submap_T_query.apply(query)
    centre = placed.mean(axis=0)
    beside = query - query.mean(axis=0)
    low, high = submap.min(axis=0), submap.max(axis=0)
    start = np.array([high[0] + _GAP * (high[0] - low[0]) - beside[:, 0].min(), 0.5 * (low[1] + high[1])])
    canvas = Canvas(np.concatenate([submap, placed, beside + start]), title or "Match")
    for landmark in submap:
        canvas.circle(landmark, 6.0, "submap", "submap")
    canvas.open_group("moving")
    for landmark in placed:
        canvas.circle(landmark, 4.5, "query", "query")
    canvas.close_group()
    canvas.open_group("proof")
    for i, j in np.asarray(pairs, dtype=np.int64).reshape(-1, 2).tolist():
        canvas.line(placed[i], submap[j], "pair")
        canvas.circle(submap[j], 9.0, "submap", "inlier pair")
    canvas.close_group()
    (x, y), (from_x, from_y) = canvas.at(centre), canvas.at(start)
    # Turning back by the yaw is clockwise in metres (y up), and counter-clockwise on the screen (y down).
    turn = math.degrees(submap_T_query.yaw)
    return canvas.render(_STYLE.format(x=x, y=y, dx=from_x - x, dy=from_y - y, turn=turn))
