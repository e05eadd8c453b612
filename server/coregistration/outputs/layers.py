"""Tables as layers of a GeoPackage, with a point for each row."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from server.collections.frame_systems import frame_system
from server.coregistration.outputs.tables import Table
from server.coregistration.results import PlotPose
from server.outputs.extras import is_installed
from server.outputs.geopackage import write_geopackage
from server.outputs.tables import ColumnKind, OutputColumn, OutputLayer, OutputRows

MISSING: Final = (
    "GeoPackages are not written, because the package pyogrio is not installed: pip install 'urquhart[gis]'"
)
"""Told where layers cannot be written."""
_TEXT: Final = frozenset(
    ("plot", "verdict", "reason", "map", "crs", "searched", "rival", "look_at", "sentence", "file", "tag", "partner")
)
_INTEGER: Final = frozenset(("trees", "inliers", "places"))


def can_write_layers() -> bool:
    """Whether the package that writes layers is installed."""
    return is_installed("pyogrio")


def write_layers(path: Path, name: str, table: Table, poses: Sequence[PlotPose | None]) -> None:
    """Write a table as a GeoPackage, with points at its columns E and N; rows without those have no geometry.

    Args:
        path: the file, which is replaced.
        name: of the layer. Rows of different systems are different layers, whose names have the system's at the end.
        table: the rows.
        poses: of each row's plot, whose system E and N are in; None where it is not placed.
    """
    beside = path.with_name(f"{path.stem}.part{path.suffix}")
    beside.unlink(missing_ok=True)
    # Rows without a place have no geometry, so they go with the first that has one.
    first = next((pose for pose in poses if pose is not None), None)
    of_row = [first if pose is None else pose for pose in poses]
    systems = ["" if pose is None or pose.crs is None else pose.crs for pose in of_row]
    groups = sorted(set(systems)) or [""]
    columns = tuple(OutputColumn(column, _kind(column)) for column in table.columns)
    for system in groups:
        chosen = [at for at, own in enumerate(systems) if own == system]
        frames = {pose.frame_id for at in chosen if (pose := of_row[at]) is not None}
        frame_id = frames.pop() if len(frames) == 1 else "map"
        title = name if len(groups) == 1 else f"{name} {system or 'without system'}"
        layer = OutputLayer(title, columns, frame_system(frame_id, system or None))
        write_geopackage(beside, layer, [_rows(table, chosen)])
    beside.replace(path)


def _kind(column: str) -> ColumnKind:
    return "text" if column in _TEXT else "integer" if column in _INTEGER else "real"


def _rows(table: Table, chosen: Sequence[int]) -> OutputRows:
    """Some rows, with the points at E and N."""
    rows = [table.rows[at] for at in chosen]
    values = [[row[at] for row in rows] for at in range(len(table.columns))]
    places = [values[table.columns.index(axis)] for axis in ("E", "N")]
    xy = np.array([[math.nan if value is None else value for value in axis] for axis in places], dtype=np.float64)
    return OutputRows(values, xy.T)
