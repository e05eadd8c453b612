"""Plots as submaps: each plot of a file becomes one submap, or several if it is larger than a submap may be."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from server.stem_maps.reader import StemMap
from server.stem_maps.tiling import MINIMUM_TREES, Cut, CuttingError, Disc, check_sizes, cut, merge, too_few

_UNFIT: Final = re.compile(r"[^A-Za-z0-9._-]+")


def cut_plots(stem_map: StemMap, radius: float, spacing: float, *, maximum_trees: int = 20_000) -> Cut:
    """Cut a stem map whose trees have plots. A plot within a circle of `radius` metres is one submap.

    Larger ones are cut as a stem map of their own is. The submaps' ids are `<map>-<plot>`, and `<map>-<plot>-c-r`. If
    plots have frames of their own, those are called `<map>-<plot>`.

    Raises:
        CuttingError: radius or spacing does not fit, no plot has enough trees, or two plots get one id.
    """

    check_sizes(radius, spacing)

    def cut_plot(plot: StemMap) -> Cut:
        whole = _whole(plot)
        if whole.radius <= radius and len(whole.discs[0].xy) <= maximum_trees:
            return replace(whole, radius=radius, spacing=spacing)
        return cut(plot, radius, spacing, maximum_trees=maximum_trees)

    return _cut_each(stem_map, cut_plot)


def keep_whole(stem_map: StemMap, *, maximum_trees: int = 20_000) -> Cut:
    """Make a stem map one submap, or each of its plots if its trees have plots, however large they are.

    The submap's id is `<map>`, or `<map>-<plot>`. Radius and spacing of the result are the radius, in metres, of the
    circle around the middle of the trees that contains all of them; of several plots, the largest.

    Raises:
        CuttingError: a submap would have more than `maximum_trees`, no plot has enough trees, or two plots get one id.
    """

    def keep_plot(plot: StemMap) -> Cut:
        whole = _whole(plot)
        count = len(whole.discs[0].xy)
        if count < MINIMUM_TREES:
            raise too_few(plot, count)
        if count > maximum_trees:
            raise CuttingError(
                f"{plot.name!r} has {count} trees, more than the {maximum_trees} that a submap may have: cut it with "
                "--radius and --spacing"
            )
        return whole

    return keep_plot(stem_map) if stem_map.plots is None else _cut_each(stem_map, keep_plot)


def _cut_each(stem_map: StemMap, cut_plot: Callable[[StemMap], Cut]) -> Cut:
    """Cut each plot that has enough trees; the results as one. Raises CuttingError."""
    names = sorted(set(stem_map.plots or ()))
    ids = {name: f"{stem_map.name}-{_UNFIT.sub('_', name).strip('_')}" for name in names}
    for name in names:
        twin = next((other for other in names if other != name and ids[other] == ids[name]), None)
        if twin is not None:
            raise CuttingError(f"the plots {name!r} and {twin!r} would both have the id {ids[name]!r}: rename one")
    plots = np.asarray(stem_map.plots)
    cuts: list[Cut] = []
    small: list[str] = []
    for name in names:
        trees = np.flatnonzero(plots == name)
        plot = replace(stem_map.chosen(trees), name=ids[name], plots=None)
        if len(merge(plot.xy, diameters=plot.dbh_cm)) < MINIMUM_TREES:
            small.append(name)
            continue
        one = cut_plot(plot)
        frame = ids[name] if stem_map.own_frames else None
        discs = tuple(replace(disc, tree_indices=trees[disc.tree_indices], frame_id=frame) for disc in one.discs)
        cuts.append(replace(one, discs=discs))
    if not cuts:
        raise CuttingError(f"none of the {len(names)} plots has {MINIMUM_TREES} trees, which a submap needs")
    return Cut(
        radius=max(one.radius for one in cuts),
        spacing=max(one.spacing for one in cuts),
        trees=len(stem_map),
        merged=sum(one.merged for one in cuts),
        uncovered=sum(one.uncovered for one in cuts) + int(np.isin(plots, small).sum()),
        columns=sum(one.columns * one.rows for one in cuts),
        rows=1,
        skipped=sum(one.skipped for one in cuts),
        discs=tuple(disc for one in cuts for disc in one.discs),
        plots=len(cuts),
        small_plots=tuple(small),
    )


def _whole(plot: StemMap) -> Cut:
    """The plot as one submap, whose radius and spacing are the radius of the circle that its trees are in."""
    kept = merge(plot.xy, diameters=plot.dbh_cm)
    xy = plot.xy[kept]
    centre = (xy.min(axis=0) + xy.max(axis=0)) / 2.0
    radius = float(np.hypot(*(xy - centre).T).max())
    disc = Disc(plot.name, (float(centre[0]), float(centre[1])), kept, xy - centre)
    return Cut(radius, radius, len(plot), len(plot) - len(kept), 0, 1, 1, 0, (disc,))
