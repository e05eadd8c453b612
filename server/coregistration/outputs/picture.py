"""The picture of one plot: its trees with tags and diameters, on those of the map."""

from typing import Final

import numpy as np

from server.coregistration.results import PlotResult
from urquhart.report.svg import Canvas

_STYLE: Final = (
    ".tag{font-size:11px;fill:#8a3a10}.plot{fill:none;stroke:#8a9a90;stroke-width:1;stroke-dasharray:5 4}"
    ".map{fill:none;stroke:#2f6b4f;stroke-width:1.6}.far{opacity:.35}"
)
_MOST_TAGS: Final = 150
"""Trees up to which each has its tag; more of them cover one another."""
_UNKNOWN: Final = 4.0
"""Pixels: radius of a tree whose diameter is not known."""


def draw_plot(result: PlotResult, collection: str) -> str:
    """The plot as SVG, in map coordinates if it is placed, else in its own."""
    pose = result.pose
    if pose is None:
        canvas = _canvas(result, f"{result.name}: {result.outcome.replace('_', ' ')}", "trees as they were surveyed")
        for tree in result.trees:
            _tree(canvas, result, (tree.x, tree.y), tree.id, tree.dbh_cm)
        return canvas.render(_STYLE)
    title = f"{result.name} in {pose.frame_id}: {result.inliers} of {len(result.trees)} trees paired"
    legend = f"filled, with tag: {result.name}, moved to its place; ring: {collection}; cross: seen by one side only"
    canvas = _canvas(result, title, result.sentence.split(";")[0], legend)
    canvas.ring(np.array([pose.e, pose.n]), result.radius, "plot")
    middle, near = np.array([pose.e, pose.n]), 1.25 * result.radius + 1.0
    for one in result.map_trees:
        at = np.array([one.e, one.n])
        if not one.inside and np.abs(at - middle).max() > near:
            continue
        canvas.circle(at, _radius(one.dbh_cm) + 2.5, "map" if one.inside else "map far", _told(one.id, one.dbh_cm))
        if one.inside and not one.paired:
            canvas.cross(at, 5.0, "miss")
    partners = {one.id: np.array([one.e, one.n]) for one in result.map_trees if one.paired}
    for tree in result.trees:
        at = np.array([tree.e, tree.n])
        if tree.partner is None:
            canvas.cross(at, 5.0, "miss")
        elif tree.partner in partners:
            canvas.line(at, partners[tree.partner], "pair")
        _tree(canvas, result, (at[0], at[1]), tree.id, tree.dbh_cm)
    return canvas.render(_STYLE)


def _canvas(result: PlotResult, title: str, *subtitles: str) -> Canvas:
    """The view: the plot with a rim, and an arrow to the north."""
    pose, rim = result.pose, 1.25 * max(result.radius, 1.0)
    middle = np.array(result.centre or (0.0, 0.0)) if pose is None else np.array([pose.e, pose.n])
    canvas = Canvas(np.array([middle - rim, middle + rim]), title, *subtitles)
    canvas.north()
    return canvas


def _tree(canvas: Canvas, result: PlotResult, at: tuple[float, float], tag: str, dbh_cm: float | None) -> None:
    point = np.array(at)
    canvas.circle(point, _radius(dbh_cm), "query", _told(tag, dbh_cm))
    if len(result.trees) <= _MOST_TAGS:
        canvas.label(point, tag, "tag", (_radius(dbh_cm) + 3.0, -4.0))


def _radius(dbh_cm: float | None) -> float:
    """Pixels: a tenth of the diameter in centimetres, but visible."""
    return _UNKNOWN if dbh_cm is None else float(np.clip(dbh_cm / 7.0, 1.5, 10.0))


def _told(tag: str, dbh_cm: float | None) -> str:
    return tag if dbh_cm is None else f"{tag}: {dbh_cm:.1f} cm"
