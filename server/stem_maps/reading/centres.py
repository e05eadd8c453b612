"""A table of plots and their positions: centres that trees were measured from, or where plots ought to be."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.table import StemMapError

_NEAREST: Final = 2.0
"""Extent of several plots below which their positions are degrees: metres would lay them over one another."""
_DECIMALS: Final = 4
"""Decimals of a position, from which on it is in degrees: nobody measures a plot to a hundredth of a millimetre."""


@dataclass(frozen=True, slots=True)
class Centres:
    """The positions of plots by their names, x and y in metres; `crs` is their system, None if it is not known."""

    path: Path
    places: dict[str, tuple[float, float]]
    crs: str | None = None


def check_not_degrees(path: Path, xy: NDArray[np.float64]) -> None:
    """Raise StemMapError if positions of plots (N, 2), whose unit nobody named, can only be degrees."""
    if not len(xy) or (np.abs(xy[:, 0]) > 180.0).any() or (np.abs(xy[:, 1]) > 90.0).any():
        return
    extent = float(np.max(xy.max(axis=0) - xy.min(axis=0)))
    is_fine = bool((np.abs(xy - np.round(xy, _DECIMALS)) > 1e-9).any(axis=0).all())
    if 0.0 < extent < _NEAREST or (extent == 0.0 and is_fine):
        raise StemMapError(
            path,
            f"the plots around {xy[0, 0]:.5f}, {xy[0, 1]:.5f} would lie within {extent:.2g} m, and seem to be in "
            "degrees: name their system, such as EPSG:4326, in a column crs; if they are metres, say --unit m",
        )
