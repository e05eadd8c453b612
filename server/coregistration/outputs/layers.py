"""Tables as layers of a GeoPackage, with a point for each row."""

import importlib.util
import struct
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError

from server.coregistration.outputs.tables import Table

MISSING: Final = (
    "GeoPackages are not written, because the package pyogrio is not installed: pip install 'urquhart[gis]'"
)
"""Told where layers cannot be written."""


def can_write_layers() -> bool:
    """Whether the package that writes layers is installed."""
    return importlib.util.find_spec("pyogrio") is not None


def write_layers(path: Path, name: str, table: Table, systems: Sequence[str | None]) -> None:
    """Write a table as a GeoPackage, with points at its columns E and N; rows without those have no geometry.

    Args:
        path: the file, which is replaced.
        name: of the layer. Rows of different systems are different layers, whose names have the system's at the end.
        table: the rows.
        systems: the coordinate reference system of each row; None where it is not known.
    """
    raw = importlib.import_module("pyogrio.raw")
    beside = path.with_name(f"{path.stem}.part{path.suffix}")
    beside.unlink(missing_ok=True)
    groups = sorted({system or "" for system in systems}) or [""]
    for system in groups:
        rows = [row for row, own in zip(table.rows, systems, strict=True) if (own or "") == system]
        layer = name if len(groups) == 1 else f"{name} {system or 'without system'}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a system is not known
            raw.write(
                beside,
                _points(table, rows),
                [_column([row[at] for row in rows]) for at in range(len(table.columns))],
                list(table.columns),
                layer=layer,
                driver="GPKG",
                geometry_type="Point",
                crs=_well_known(system),
                append=beside.exists(),
            )
    beside.replace(path)


def _points(table: Table, rows: Sequence[tuple[Any, ...]]) -> Any:
    """Well-known binary of each row's point; None for a row without one."""
    e, n = table.columns.index("E"), table.columns.index("N")
    points = np.empty(len(rows), dtype=object)
    for at, row in enumerate(rows):
        points[at] = None if row[e] is None else struct.pack("<BIdd", 1, 1, row[e], row[n])
    return points


def _column(values: Sequence[Any]) -> Any:
    """A column as an array: float64 with NaN, or objects with None."""
    if all(value is None or isinstance(value, int | float) for value in values) and any(
        value is not None for value in values
    ):
        return np.array(values, dtype=np.float64)
    return np.array([None if value is None else str(value) for value in values], dtype=object)


def _well_known(system: str) -> str | None:
    """Well-known text of a system; None if it is not known."""
    try:
        return CRS.from_user_input(system).to_wkt() if system else None
    except CRSError:
        return None
