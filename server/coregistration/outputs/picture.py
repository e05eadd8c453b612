"""The picture of one plot: its trees with tags and diameters, on those of the map."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.coregistration.results import PlotResult
from urquhart.report.svg import Canvas

_STYLE: Final = (
    ".tag{font-size:11px;fill:#8a3a10}.plot{fill:none;stroke:#8a9a90;stroke-width:1;stroke-dasharray:5 4}"
    ".map{fill:none;stroke:#2f6b4f;stroke-width:1.6}.far{opacity:.35}"
)
_LONGEST_TAG: Final = 12
"""Characters of a tag in the picture. Of longer ones the end is shown, where tags of one plot differ."""
_WIDE, _HIGH = 6.3, 11.0
"""Pixels: a character of a tag, which is drawn where it covers no other one. A tooltip has the whole tag."""
_UNKNOWN: Final = 4.0
"""Pixels: radius of a tree whose diameter is not known."""


def draw_plot(result: PlotResult, collection: str) -> str:
    """The plot as SVG, in map coordinates if it is placed, else in its own."""
    pose = result.pose
    if pose is None:
        canvas = _canvas(result, f"{result.name}: {result.outcome.replace('_', ' ')}", "trees as they were surveyed")
        for tree in result.trees:
            _tree(canvas, np.array([tree.x, tree.y]), tree.id, tree.dbh_cm)
        _tags(canvas, [(np.array([tree.x, tree.y]), tree.id, _radius(tree.dbh_cm)) for tree in result.trees])
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
        _tree(canvas, at, tree.id, tree.dbh_cm)
    _tags(canvas, [(np.array([tree.e, tree.n]), tree.id, _radius(tree.dbh_cm)) for tree in result.trees])
    return canvas.render(_STYLE)


def _canvas(result: PlotResult, title: str, *subtitles: str) -> Canvas:
    """The view: the plot with a rim, and an arrow to the north."""
    pose, rim = result.pose, 1.25 * max(result.radius, 1.0)
    middle = np.array(result.centre or (0.0, 0.0)) if pose is None else np.array([pose.e, pose.n])
    canvas = Canvas(np.array([middle - rim, middle + rim]), title, *subtitles)
    canvas.north()
    return canvas


def _tree(canvas: Canvas, point: NDArray[np.float64], tag: str, dbh_cm: float | None) -> None:
    canvas.circle(point, _radius(dbh_cm), "query", _told(tag, dbh_cm))


def _tags(canvas: Canvas, trees: Sequence[tuple[NDArray[np.float64], str, float]]) -> None:
    """Draw the tags of trees: place, tag and radius in pixels of each. A tag without room beside its tree is left out.

    A tag that would cover a tree is drawn only if it fits nowhere else.
    """
    dots = np.array([(*canvas.at(point), radius) for point, _, radius in trees]).reshape(-1, 3)
    taken = np.empty((0, 4))  # left, top, right, bottom
    for (point, tag, radius), (x, y, _) in zip(trees, dots.tolist(), strict=True):
        text = tag if len(tag) <= _LONGEST_TAG else f"\u2026{tag[1 - _LONGEST_TAG :]}"
        wide, beside = _WIDE * len(text), radius + 3.0
        choices = [(right, down) for down in (-4.0, 4.0 + _HIGH) for right in (beside, -beside - wide)]
        boxes = [(x + right, y + down - _HIGH, x + right + wide, y + down) for right, down in choices]
        free = [at for at, box in enumerate(boxes) if not _covers(box, taken)]
        if free:
            best = next((at for at in free if not _touches(boxes[at], dots)), free[0])
            canvas.label(point, text, "tag", choices[best])
            taken = np.vstack([taken, boxes[best]])


def _covers(box: tuple[float, float, float, float], others: NDArray[np.float64]) -> bool:
    """Whether a box overlaps one of others (N, 4): left, top, right, bottom."""
    left, top, right, bottom = box
    away = (others[:, 0] >= right) | (others[:, 2] <= left) | (others[:, 1] >= bottom) | (others[:, 3] <= top)
    return not bool(away.all())


def _touches(box: tuple[float, float, float, float], dots: NDArray[np.float64]) -> bool:
    """Whether a box reaches into one of some circles (N, 3): x, y, radius."""
    left, top, right, bottom = box
    dx = dots[:, 0] - np.clip(dots[:, 0], left, right)
    dy = dots[:, 1] - np.clip(dots[:, 1], top, bottom)
    return bool((np.hypot(dx, dy) < dots[:, 2]).any())


def _radius(dbh_cm: float | None) -> float:
    """Pixels: a tenth of the diameter in centimetres, but visible."""
    return _UNKNOWN if dbh_cm is None else float(np.clip(dbh_cm / 7.0, 1.5, 10.0))


def _told(tag: str, dbh_cm: float | None) -> str:
    return tag if dbh_cm is None else f"{tag}: {dbh_cm:.1f} cm"
