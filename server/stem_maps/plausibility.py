"""Plausibility of a stem map: it is refused if a column cannot mean what its name says."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.csv_columns import Columns
from server.stem_maps.csv_rows import StemMapError

_NAMED_CM: Final = (1.0, 300.0)
"""Centimetres. The median diameter of any stand lies between these."""
_UNNAMED_CM: Final = (1.0, 60.0)
"""Centimetres. The same if nobody named the unit. Values beyond are metres, or millimetres from 6 cm on."""
_REPEATED: Final = 0.5
"""Share of rows that may have the position of another row: stems of one tree do, but not whole plots."""
_FEW: Final = 20
"""Rows from which a pattern in all of them is no accident."""
_OVERLAP: Final = 0.1
"""Share of the smaller plot's width and height that two plots in one frame may share."""
_MOST_PLOTS: Final = 3000


def check_diameters(path: Path, columns: Columns, dbh_cm: NDArray[np.float64]) -> None:
    """Raise StemMapError if the median of diameters (N,) float64, centimetres, NaN where unknown, is not that of a
    stand.
    """
    known = dbh_cm[np.isfinite(dbh_cm)]
    if not len(known):
        return
    median = float(np.median(known))
    low, high = _NAMED_CM if columns.dbh_named else _UNNAMED_CM
    if not low <= median <= high:
        name, unit = columns.names["dbh"], columns.dbh_unit
        raise StemMapError(
            path,
            f"read in {unit}, the median of the column {name!r} is {median:.3g} cm, which no stand has: give the unit "
            "in the column's name (dbh_cm, dbh_mm, dbh_m, dbh_in) or with --dbh-unit",
        )


def check_centres(path: Path, columns: Columns, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if positions (N, 2) float64, metres, are those of plots and not of trees."""
    places = len(np.unique(xy, axis=0))
    if len(xy) < 3 or places >= _REPEATED * len(xy):
        return
    what = f"{len(xy)} rows stand at {places} positions, which are plots' centres and not trees' positions"
    if columns.polar:
        azimuth, distance = columns.polar
        raise StemMapError(
            path,
            f"{what}; the trees are in the columns {azimuth!r} and {distance!r}, and polar measurements are not read: "
            "compute each tree's position, and give it as x_m and y_m",
        )
    raise StemMapError(path, f"{what}: give each tree its own x_m and y_m")


def check_plots(path: Path, columns: Columns, plots: Sequence[str], xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if plots overlap, as those with coordinates of their own do."""
    names, of_plot = np.unique(np.asarray(plots), return_inverse=True)
    if columns.plot is None or len(names) < 2:
        return
    low, high = np.full((len(names), 2), np.inf), np.full((len(names), 2), -np.inf)
    np.minimum.at(low, of_plot, xy)
    np.maximum.at(high, of_plot, xy)
    if len(names) > _MOST_PLOTS or _overlap(low, high):
        name = columns.plot_name
        raise StemMapError(
            path,
            f"the column {name!r} has {len(names)} values whose trees overlap, as if each plot had coordinates of its "
            f"own: write a file for each plot or, if all coordinates are in one frame, use --ignore {name}",
        )


def _overlap(low: NDArray[np.float64], high: NDArray[np.float64]) -> bool:
    """Whether any two boxes share more than a tenth of the smaller one's width and height."""
    size = high - low
    for i in range(len(low) - 1):
        shared = np.minimum(high[i], high[i + 1 :]) - np.maximum(low[i], low[i + 1 :])
        if (shared > _OVERLAP * np.minimum(size[i], size[i + 1 :])).all(axis=1).any():
            return True
    return False


def check_cut_decimals(path: Path, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError for whole numbers (N, 2) float64 of which one axis has a single digit throughout.

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
