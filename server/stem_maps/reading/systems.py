"""Coordinate reference systems of files: their unit, their area of use, and projection to another one."""

import math
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from server.stem_maps.formats.table import StemMapError

_SLACK: Final = 2.0
"""Degrees that trees may lie outside a system's area of use: maps do not end at the border of a UTM zone."""
_METRE: Final = 1e-9


def system_of(path: Path, name: str, option: str) -> CRS:
    """The horizontal system that `name` means. Raises StemMapError."""
    try:
        crs = CRS.from_user_input(name)
    except CRSError as error:
        raise StemMapError(
            path, f"{option} is {name[:60]!r}, which is no known coordinate reference system: give a code such as "
            "EPSG:25832"
        ) from error  # fmt: skip
    if crs.is_compound:
        crs = crs.sub_crs_list[0]
    return crs.source_crs if crs.is_bound and crs.source_crs is not None else crs


def describe_system(crs: CRS) -> str:
    """Its code, or its name if it has none."""
    authority = crs.to_authority(min_confidence=70)
    return ":".join(authority) if authority else crs.name


def agreed_system(path: Path, in_file: str | None, named: str | None) -> CRS | None:
    """The system of a file that may name one, and whose caller may. Raises StemMapError if both differ."""
    own = None if in_file is None else system_of(path, in_file, "the file's system")
    if named is None:
        return own
    given = system_of(path, named, "--crs")
    if own is not None and not own.is_exact_same(given) and not own.equals(given, ignore_axis_order=True) and (
        describe_system(own) != describe_system(given)
    ):  # fmt: skip
        raise StemMapError(
            path, f"the file is in {describe_system(own)}, but --crs says {describe_system(given)}: drop --crs, or "
            f"convert with --project {describe_system(given)}"
        )  # fmt: skip
    return given


def metres_per_unit(crs: CRS) -> float:
    """Metres in one unit of a system's first two axes."""
    return float(crs.axis_info[0].unit_conversion_factor) if crs.axis_info else 1.0


def is_close(metres: float, other: float) -> bool:
    """Whether two lengths of a unit in metres are those of one unit: two kinds of feet differ by 2 in a million."""
    return abs(metres - other) <= 1e-6 * other


def is_metric(crs: CRS) -> bool:
    """Whether a system's unit is the metre."""
    return abs(metres_per_unit(crs) - 1.0) < _METRE


def utm_zone(longitude: float, latitude: float) -> str:
    """The code of the UTM zone of a place on WGS 84."""
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return f"EPSG:{(32600 if latitude >= 0 else 32700) + zone}"


def projected(path: Path, xy: NDArray[np.float64], crs: CRS, target: CRS) -> NDArray[np.float64]:
    """Positions (N, 2) of `crs`, in `target`, a projected system. Raises StemMapError."""
    if not target.is_projected:
        raise StemMapError(path, f"--project must name a projected system, and {describe_system(target)} is none")
    if not len(xy):
        return xy
    try:
        x, y = Transformer.from_crs(crs, target, always_xy=True).transform(xy[:, 0], xy[:, 1], errcheck=True)
    except ProjError as error:
        raise StemMapError(path, f"cannot be converted to {describe_system(target)}: {error}") from error
    return np.column_stack([x, y])


def check_system(path: Path, xy: NDArray[np.float64], crs: CRS, told: str) -> None:
    """Raise StemMapError if positions (N, 2), in the system's unit, are degrees, or far from where the system is used.

    `told` says in words where the system comes from.
    """
    if not crs.is_projected and not crs.is_engineering:
        middle = np.median(xy, axis=0) if len(xy) else np.zeros(2)
        near = utm_zone(float(middle[0]), float(middle[1])) if abs(middle[0]) <= 180 else "EPSG:32633"
        raise StemMapError(
            path,
            f"{told} {describe_system(crs)} gives degrees, and distances between trees need metres: convert with "
            f"--project {near}, or the national grid",
        )
    area = crs.area_of_use
    if area is None or not len(xy):
        return
    middle = np.median(xy, axis=0)
    longitude, latitude = _on_earth(crs, float(middle[0]), float(middle[1]))
    east_of = (longitude - area.west + _SLACK) % 360.0
    width = (area.east - area.west) % 360.0 or 360.0
    is_inside = area.south - _SLACK <= latitude <= area.north + _SLACK and east_of <= width + 2 * _SLACK
    if not (math.isfinite(longitude) and is_inside):
        raise StemMapError(
            path,
            f"{told} {describe_system(crs)} is used in {area.name[:80]}, but the trees around {middle[0]:.0f}, "
            f"{middle[1]:.0f} would lie outside: name their system with --crs, and check that x is east and y north",
        )


def _on_earth(crs: CRS, x: float, y: float) -> tuple[float, float]:
    try:
        longitude, latitude = Transformer.from_crs(crs, CRS.from_epsg(4326), always_xy=True).transform(x, y)
    except ProjError:
        return math.inf, math.inf
    return float(longitude), float(latitude)
