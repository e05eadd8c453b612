"""Plausibility of a stem map: it is refused if a column cannot mean what its name says."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from server.stem_maps.formats.table import StemMapError
from server.stem_maps.reading.rows import wrong_unit
from server.stem_maps.reading.trees import TreeRows

_NAMED_CM: Final = (1.0, 300.0)
"""Centimetres. The median diameter of any stand lies between these."""
_UNNAMED_CM: Final = (1.0, 60.0)
"""Centimetres. The same if nobody named the unit. Values beyond are metres, or millimetres from 6 cm on."""
_TALL_M: Final = 60.0
"""Metres. No median height of a stand is larger, but those in feet are."""
_REPEATED: Final = 0.5
"""Share of rows that may have the position of another row: stems of one tree do, but not whole plots."""
_FEW: Final = 20
"""Rows from which a pattern in all of them is no accident."""
_OVERLAP: Final = 0.1
"""Share of the smaller plot's width and height that two plots in one frame may share."""
_MOST_PLOTS: Final = 3000
_NEIGHBOURS: Final = 6
_SAMPLE: Final = 5000
"""Trees whose neighbours say how dense the stand is."""
_DENSEST: Final = 10_000.0
"""Trees per hectare. A denser stand is a thicket, or in another unit."""
_SPARSEST: Final = 30.0
"""Trees per hectare. Stands of 40 to 300 trees per hectare look like this or sparser if feet are taken as metres."""
_THINNEST_BASAL: Final = 4.0
"""Square metres of stems per hectare. Forests have 10 to 60, and look a tenth of that if feet are taken as metres."""
_NO_POSITION: Final = (0.0, -9.0, -99.0, -999.0, -9999.0, 999.0, 9999.0, 99999.0)
"""Coordinates that tables have where a position is missing."""
_MISSING: Final = 2
"""Trees with different ids that stand exactly there, from which that is no accident."""
_COARSE: Final = 0.1
"""Share of trees that may share a position with another one where positions are whole metres or coarser."""


def check_plausible(trees: TreeRows) -> None:
    """Raise StemMapError if a column of `trees` can hardly mean what it is taken for."""
    if not len(trees):
        return
    check_plots(trees)
    xy = spread(trees)
    _check_degrees(trees.path, xy, trees)
    _check_centres(trees.path, trees, xy)
    _check_missing(trees.path, trees.xy)
    if trees.whole:
        _check_cut_decimals(trees.path, xy)
    _check_values(trees.path, xy)
    if trees.dbh_cm is not None:
        _check_diameters(trees, trees.dbh_cm)
    if trees.height_m is not None:
        _check_heights(trees, trees.height_m)
    _check_density(trees)


def spread(trees: TreeRows) -> NDArray[np.float64]:
    """Positions (N, 2), metres, with plots that have frames of their own laid side by side in rows."""
    if not trees.own_frames or trees.plots is None:
        return trees.xy
    names, of_plot = np.unique(np.asarray(trees.plots), return_inverse=True)
    # Twice the extent of a plot: no tree has a neighbour in another plot.
    step = 2.0 * float(np.max(trees.xy.max(axis=0) - trees.xy.min(axis=0))) + 1.0
    width = int(np.ceil(np.sqrt(len(names))))
    return trees.xy + step * np.column_stack([of_plot % width, -(of_plot // width)])


def neighbour_tree(trees: TreeRows) -> cKDTree:
    """The positions of `spread` for the search of neighbours, built once. Plots must have been checked before."""
    if trees.neighbours is None:
        trees.neighbours = cKDTree(spread(trees))
    return trees.neighbours


def stems_per_hectare(tree: cKDTree) -> float | None:
    """The density of trees, metres, from the distance to their sixth neighbour; None for fewer than 20 trees.

    Gaps between plots do not count, because only trees have neighbours.
    """
    xy = np.asarray(tree.data)
    if len(xy) < _FEW:
        return None
    sample = xy[:: max(1, len(xy) // _SAMPLE)]
    distance, _ = tree.query(sample, _NEIGHBOURS + 1)
    middle = float(np.median(np.asarray(distance)[:, -1]))
    # The median of the sixth distance squared, of trees that stand at random: 5.67 / (pi density).
    return 1e4 * (_NEIGHBOURS - 1 / 3) / (np.pi * middle**2) if middle > 0 else np.inf


def _check_degrees(path: Path, xy: NDArray[np.float64], trees: TreeRows) -> None:
    if len(xy) < 3 or trees.positions.unit_named or trees.own_frames:
        return
    within = (np.abs(xy[:, 0]) <= 180.0).all() and (np.abs(xy[:, 1]) <= 90.0).all()
    extent = float(np.max(xy.max(axis=0) - xy.min(axis=0)))
    if within and 0.0 < extent < 0.1:
        raise StemMapError(
            path,
            f"the positions around {xy[0, 0]:.5f}, {xy[0, 1]:.5f} lie within {extent:.2g}, as degrees "
            "of longitude and latitude do: name their system with --crs EPSG:4326 and a projected one with --project; "
            "if they are metres, say --unit m",
        )


def _check_diameters(trees: TreeRows, dbh_cm: NDArray[np.float64]) -> None:
    known = dbh_cm[np.isfinite(dbh_cm)]
    if not len(known):
        return
    median = float(np.median(known))
    low, high = _NAMED_CM if "dbh" in trees.columns.units else _UNNAMED_CM
    if not low <= median <= high:
        raise wrong_unit(trees, median)


def _check_heights(trees: TreeRows, height_m: NDArray[np.float64]) -> None:
    known = height_m[np.isfinite(height_m)]
    if len(known) and "height" not in trees.columns.units and float(np.median(known)) > _TALL_M:
        raise StemMapError(
            trees.path,
            f"read in metres, the median of the column {trees.columns.names['height']!r} is {np.median(known):.3g} m, "
            "which no stand has: name the unit with --height-unit",
        )


def _check_missing(path: Path, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if trees without a position seem to have one that stands for none."""
    for code in _NO_POSITION:
        at = int((xy == code).all(axis=1).sum())
        if at >= _MISSING:
            raise StemMapError(
                path, f"{at} trees stand at {code:g}, {code:g}, as if they had no position: leave these rows out, or "
                "leave their cells empty and use --skip-bad"
            )  # fmt: skip


def _places(xy: NDArray[np.float64]) -> int:
    """Number of different positions. Sorting by columns takes a tenth of the time of np.unique by rows."""
    ordered = xy[np.lexsort(xy.T)]
    return 1 + int((ordered[1:] != ordered[:-1]).any(axis=1).sum())


def _check_centres(path: Path, trees: TreeRows, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if positions are those of plots and not of trees."""
    places = _places(xy)
    if len(xy) >= 3 and places < _REPEATED * len(xy):
        raise StemMapError(
            path,
            f"{len(xy)} rows stand at {places} positions, which are plots' centres and not trees' positions: give each "
            "tree its own x_m and y_m, or name the columns of polar measurements with --azimuth and --distance",
            None,
        )


def check_plots(trees: TreeRows) -> None:
    """Note whether plots have coordinates of their own, which overlap. Raise StemMapError if nobody said so."""
    plots = trees.plots
    if plots is None or len(set(plots)) < 2:
        return
    names, of_plot = np.unique(np.asarray(plots), return_inverse=True)
    low, high = np.full((len(names), 2), np.inf), np.full((len(names), 2), -np.inf)
    np.minimum.at(low, of_plot, trees.xy)
    np.maximum.at(high, of_plot, trees.xy)
    if not (len(names) > _MOST_PLOTS or _overlap(low, high)):
        return
    if trees.by_plot:
        trees.own_frames = True
        trees.notes.append(f"{len(names)} plots, each with coordinates of its own, because they overlap")
        return
    name = trees.columns.names["plot"]
    raise StemMapError(
        trees.path,
        f"the column {name!r} has {len(names)} values whose trees overlap, as if each plot had coordinates of its own: "
        f"say --plot {name} to make each plot a submap or, if all coordinates are in one frame, use --ignore {name}",
    )


def _overlap(low: NDArray[np.float64], high: NDArray[np.float64]) -> bool:
    """Whether any two boxes share more than a tenth of the smaller one's width and height."""
    size = high - low
    for i in range(len(low) - 1):
        shared = np.minimum(high[i], high[i + 1 :]) - np.maximum(low[i], low[i + 1 :])
        if (shared > _OVERLAP * np.minimum(size[i], size[i + 1 :])).all(axis=1).any():
            return True
    return False


def _check_cut_decimals(path: Path, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError for whole numbers of which one axis has a single digit throughout.

    That is what remains of x = 125.0 and y = 179.4 in `125,0,179,4`.
    """
    if len(xy) < _FEW:
        return
    for axis, name in enumerate("xy"):
        if xy[:, axis].min() >= 0 and xy[:, axis].max() <= 9:
            raise StemMapError(
                path,
                f"all coordinates are whole numbers and {name} has one digit in all {len(xy)} rows: commas of decimals "
                "were probably read as separators; write a point for decimals, or separate the columns by semicolons",
            )


def _check_values(path: Path, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if an axis has one value, or positions are so coarse that trees share them."""
    if len(xy) < _FEW:
        return
    for axis, name in enumerate("xy"):
        if np.ptp(xy[:, axis]) == 0.0:
            raise StemMapError(
                path, f"{name} is {xy[0, axis]:g} in all {len(xy)} rows, so the trees stand in a line: is it the right "
                f"column? Name it with --{name}"
            )  # fmt: skip
    if not (xy == np.round(xy)).all():
        return
    shared = 1.0 - _places(xy) / len(xy)
    if shared > _COARSE:
        raise StemMapError(
            path,
            f"positions are whole metres, and {100 * shared:.0f} % of the trees share theirs with another one: they "
            "are rounded too coarsely to tell trees apart, so give at least decimetres",
        )


def _check_density(trees: TreeRows) -> None:
    """Raise StemMapError if trees stand closer, or further apart, than in any forest, and nobody named the unit."""
    if trees.options.unit is not None:
        return
    density = stems_per_hectare(neighbour_tree(trees))
    if density is None:
        return
    if density > _DENSEST:
        raise StemMapError(
            trees.path,
            f"there would be {density:,.0f} trees on a hectare: name the unit of the positions with --unit m, ft, "
            "us-ft, cm or km",
        )
    if trees.positions.unit_named:
        return
    if trees.dbh_cm is not None and np.isfinite(trees.dbh_cm).mean() > 0.5:
        basal = density * np.pi / 4.0 * float(np.nanmean((trees.dbh_cm / 100.0) ** 2))
        if basal >= _THINNEST_BASAL:
            return
        what = f"{density:.0f} trees and {basal:.1f} m2 of stems on a hectare"
    elif density < _SPARSEST:
        what = f"{density:.0f} trees on a hectare"
    else:
        return
    family = ", or diameters in another unit than mm, say --dbh-unit" if trees.columns.family_unit else ""
    raise StemMapError(
        trees.path,
        f"there would be only {what}: if the positions are in feet, say --unit ft{family}; if all is right, --unit m",
    )
