"""The trees of a map as a file: CSV, or GeoPackage with a layer for each part of the map."""

import csv
import secrets
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from server.collections.crud import get_collection
from server.errors import NotAcceptable
from server.maps.building import BuiltMap
from server.maps.documents import trees_of
from server.schemas.maps import MapTree
from server.store.records import FrameReference
from server.store.storage import ReadTransaction

SUFFIXES: Final = (".csv", ".gpkg")
_COLUMNS: Final = ("id", "part", "dbh_cm", "height_m", "observed", "missed", "first_seen", "last_seen")


def check_suffix(path: Path) -> None:
    """Raise NotAcceptable if no file of trees has this suffix, or if the package that writes it is not installed."""
    if path.suffix.lower() not in SUFFIXES:
        raise NotAcceptable(
            f"{path}: no map is written as {path.suffix or 'a file without a suffix'}: use {' or '.join(SUFFIXES)}",
            ["text/csv", "application/geopackage+sqlite3"],
        )
    if path.suffix.lower() == ".gpkg":
        _pyogrio()


def write_trees(tx: ReadTransaction, collection_id: str, built: BuiltMap, path: Path) -> int:
    """Write the trees of all parts that have a map frame. Returns their number; the file appears when it is complete.

    Coordinates are those of the frame, plus its origin where the frame has a coordinate reference system. Raises
    NotFound, NotAcceptable and OSError.
    """
    frames = {frame for frame in built.frames if frame is not None}
    references = tx.map_frames(get_collection(tx, collection_id)).some(sorted(frames))
    by_frame: dict[str, list[MapTree]] = {frame: [] for frame in sorted(frames)}
    frame_of = dict(zip(built.part_numbers, built.frames, strict=True))
    for tree in trees_of(built):
        frame = frame_of[tree.part]
        if frame is not None:
            by_frame[frame].append(_placed(tree, references.get(frame)))
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(6)}{path.suffix}")
    try:
        if path.suffix.lower() == ".csv":
            _write_csv(temporary, by_frame, references)
        else:
            _write_geopackage(temporary, by_frame, references)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return sum(map(len, by_frame.values()))


def _placed(tree: MapTree, reference: FrameReference | None) -> MapTree:
    """The tree with full coordinates of its system."""
    if reference is None or reference.origin is None:
        return tree
    return tree.model_copy(update={"x": tree.x + reference.origin[0], "y": tree.y + reference.origin[1]})


def _write_csv(path: Path, by_frame: dict[str, list[MapTree]], references: dict[str, FrameReference]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*_COLUMNS[:2], "frame", "x", "y", "sigma_m", *_COLUMNS[2:], "crs"])
        for frame, trees in by_frame.items():
            crs = references[frame].crs if frame in references else ""
            for tree in trees:
                values = ["" if value is None else value for value in _values(tree)]
                place = [frame, f"{tree.x:.4f}", f"{tree.y:.4f}", f"{_sigma(tree):.4f}"]
                writer.writerow([*values[:2], *place, *values[2:], crs])


def _write_geopackage(path: Path, by_frame: dict[str, list[MapTree]], references: dict[str, FrameReference]) -> None:
    raw = _pyogrio().raw
    for number, (frame, trees) in enumerate(by_frame.items()):
        shapes = np.array([struct.pack("<BIdd", 1, 1, tree.x, tree.y) for tree in trees], object)
        columns = list(zip(*map(_values, trees), strict=True)) or [()] * len(_COLUMNS)
        data = [_column(name, values) for name, values in zip(_COLUMNS, columns, strict=True)]
        sigmas = np.array([_sigma(tree) for tree in trees], np.float64)
        raw.write(
            path,
            shapes,
            [*data, sigmas],
            [*_COLUMNS, "sigma_m"],
            layer=f"trees {frame}",
            driver="GPKG",
            geometry_type="Point",
            crs=references[frame].crs if frame in references else _local_system(frame),
            append=number > 0,
        )


def _local_system(frame: str) -> str:
    """An engineering CRS for a frame that nobody has placed on Earth, as WKT: metres, named after the frame."""
    name = frame.replace('"', '""')
    return (
        f'ENGCRS["{name} (local frame)",EDATUM["{name}"],CS[Cartesian,2],AXIS["x",unspecified,ORDER[1]],'
        'AXIS["y",unspecified,ORDER[2]],LENGTHUNIT["metre",1]]'
    )


def _column(name: str, values: Sequence[Any]) -> np.ndarray[Any, Any]:
    if name in ("dbh_cm", "height_m"):
        return np.array([np.nan if value is None else value for value in values], np.float64)
    if name in ("first_seen", "last_seen"):
        return np.array(values, object)
    return np.array(values, np.int64)


def _values(tree: MapTree) -> list[Any]:
    return [getattr(tree, name) for name in _COLUMNS]


def _sigma(tree: MapTree) -> float:
    """Metres: the standard deviation of the position along its worst direction."""
    return float(np.sqrt(np.linalg.eigvalsh(np.reshape(tree.covariance, (2, 2)))[-1]))


def _pyogrio() -> Any:
    try:
        import pyogrio.raw
    except ImportError as error:
        raise NotAcceptable(
            "GeoPackage needs the package pyogrio, which is not installed here: pip install 'urquhart[gis]'. CSV needs "
            "none.",
            ["text/csv"],
        ) from error
    return pyogrio
