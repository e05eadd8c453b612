"""Polar measurements: azimuth and distance from a plot's centre, and positions within ForestGEO quadrats."""

import re
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.table import StemMapError

RADIANS: Final = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}
_TURN: Final = {"deg": 360.0, "gon": 400.0, "rad": 2 * np.pi}
_ROUNDING: Final = 0.01
_FEW: Final = 10
"""Measurements from which their range says that they are not degrees."""
_STEEPEST: Final = 60.0
"""Degrees. A sight line of a forest plot is not steeper."""
_QUADRAT: Final = 20.0
"""Metres. The side of a ForestGEO quadrat."""


def check_angles(path: Path, azimuth: NDArray[np.float64], unit: str | None, name: str) -> str:
    """The unit of azimuths (N,): `unit`, or degrees if nobody named one and they can be that. Raises StemMapError."""
    known = azimuth[np.isfinite(azimuth)]
    if not len(known):
        return unit or "deg"
    low, high = float(known.min()), float(known.max())
    turn = _TURN[unit or "deg"]
    if low < -turn or high > turn * (1 + _ROUNDING / 100):
        raise StemMapError(
            path,
            f"the column {name!r} reaches {high if high > turn else low:g}, which is more than a full turn in "
            f"{unit or 'deg'}: name the unit with --angle deg, gon or rad",
        )
    if unit is None and len(known) >= _FEW and low >= 0 and high <= _TURN["rad"] + _ROUNDING:
        raise StemMapError(
            path, f"the column {name!r} lies between {low:g} and {high:g}, which looks like radians: say --angle rad, "
            "or --angle deg if it is degrees"
        )  # fmt: skip
    return unit or "deg"


def horizontal(
    path: Path, distance: NDArray[np.float64], slope: NDArray[np.float64], unit: str | None
) -> NDArray[np.float64]:
    """Horizontal distances of distances (N,) along sight lines of `slope` (N,); a missing slope is level.

    Raises:
        StemMapError: slopes are too steep for their unit.
    """
    level = np.nan_to_num(slope)
    angle = np.arctan(level / 100.0) if unit == "percent" else level * RADIANS[unit or "deg"]
    if len(angle) and np.abs(angle).max() > np.radians(_STEEPEST):
        raise StemMapError(
            path, f"slopes reach {np.abs(level).max():g}, which is too steep in {unit or 'deg'}: name the unit with "
            "--slope-unit deg, gon, rad or percent"
        )  # fmt: skip
    return np.asarray(distance * np.cos(angle))


def offsets(azimuth: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """East and north (N, 2) of azimuths (N,), radians clockwise from north, and distances (N,)."""
    return np.column_stack([distance * np.sin(azimuth), distance * np.cos(azimuth)])


def within_quadrats(
    path: Path, quadrats: list[str], local: NDArray[np.float64], size: float | None, unit: str
) -> tuple[NDArray[np.float64], str]:
    """Positions (N, 2) in the plot of positions within quadrats, whose codes are two digits of column and of row.

    All lengths, the side `size` of the quadrats among them, are in `unit`. Returns the positions and one sentence of
    what was assumed. Raises StemMapError.
    """
    if size is None and unit != "m":
        raise StemMapError(
            path, f"lx and ly are in {unit}: give the side of the quadrats in {unit} with --quadrat-size"
        )
    side = size or _QUADRAT
    known = local[np.isfinite(local)]
    if len(known) and (known.min() < -_ROUNDING or known.max() > side + _ROUNDING):
        raise StemMapError(
            path, f"lx and ly lie between {known.min():g} and {known.max():g}, which is not within quadrats of "
            f"{side:g} {unit}: give their side with --quadrat-size"
        )  # fmt: skip
    if size is None and len(known) >= 4 * _FEW and known.max() <= side / 2:
        raise StemMapError(
            path,
            f"lx and ly reach only {known.max():g}, half a quadrat of {side:g} {unit}: give its side with "
            "--quadrat-size",
        )
    cells = np.zeros((len(quadrats), 2))
    for row, code in enumerate(quadrats):
        if not re.fullmatch(r"\d{1,4}", code):
            raise StemMapError(path, f"the quadrat {code!r} is not two digits of column and two of row, such as 0307")
        cells[row] = int(code.zfill(4)[:2]), int(code.zfill(4)[2:])
    first = 0.0 if not len(cells) or (cells == 0).any() else 1.0
    told = f"quadrats of {side:g} {unit}, of which {'0000' if first == 0.0 else '0101'} begins at 0, 0"
    return local + side * (cells - first), told
