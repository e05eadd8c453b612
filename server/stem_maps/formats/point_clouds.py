"""Point clouds (LAS, LAZ) whose points carry the number of their tree: each tree becomes a row."""

import struct
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from server.stem_maps.formats.extras import import_extra
from server.stem_maps.formats.table import ColumnValues, FileTable, StemMapError

TREE_DIMENSIONS: Final = (
    "treeid",
    "tree_id",
    "treeno",
    "tree",
    "predinstance",
    "instance_id",
    "instance",
    "tree_instance",
)
"""Names, in lower case, of the dimension that numbers a point's tree, in order of preference."""
_DAMAGED: Final = (ArithmeticError, EOFError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError,
                   struct.error)  # fmt: skip
"""What reading a damaged point cloud may raise, beside laspy's own errors."""
_SHORTEST: Final = 227
"""Bytes of the header of LAS 1.0 to 1.2. That of LAS 1.4 has 375."""
_RECORD: Final = 54
_EXTENDED_RECORD: Final = 60
"""Bytes of the shortest variable-length record, and of the shortest extended one."""
_CHUNK: Final = 1_000_000
_BREAST: Final = (1.0, 1.6)
"""Metres above a tree's lowest point: the slice of stem around breast height, 1.3 m."""
_FEWEST: Final = 5
"""Points in that slice from which their median is the stem's position."""
_FOOT: Final = 0.5
"""Metres above the lowest point: the points that are taken where the slice has too few."""


def read_point_cloud(path: Path, tree_dimension: str | None) -> FileTable:
    """The trees of a point cloud: number, position, and every extra dimension with one value for each tree.

    A tree's position is the median of its points around breast height, or of the lowest ones if there are too few. Of
    a tree with one point it is that point. Points with the number 0, or a negative one, belong to no tree.

    Raises:
        StemMapError: the file is damaged, or its points do not say which tree they belong to.
    """
    _check_header(path)
    laspy = import_extra(path, "las", "laspy")
    if path.suffix.lower() == ".laz":
        import_extra(path, "las", "lazrs")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with laspy.open(path) as file:
                name = _dimension(path, file.header, tree_dimension)
                extra = [one for one in file.header.point_format.extra_dimension_names if one != name]
                crs = file.header.parse_crs()
                expected = file.header.point_count
                points = _read(file, [name, *extra])
    except StemMapError:
        raise
    except (laspy.errors.LaspyException, *_DAMAGED) as error:
        raise StemMapError(path, f"is no point cloud that can be read: {' '.join(str(error).split())}") from error
    if points["count"] != expected:
        raise StemMapError(path, f"is cut off: {points['count']} of {expected} points are there")
    if crs is not None and crs.axis_info and not crs.is_geographic:
        points["above"] = points["z"] * crs.axis_info[0].unit_conversion_factor
    return _table(path, name, extra, points, None if crs is None else crs.to_wkt())


def _check_header(path: Path) -> None:
    """Raise StemMapError if the header promises more than the file holds, which laspy would look for one by one."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(375)
    if not header.startswith(b"LASF"):
        raise StemMapError(
            path, "is empty" if not header else f"is no point cloud, although its suffix is {path.suffix}"
        )
    if len(header) < _SHORTEST:
        raise StemMapError(path, "is cut off within its header")
    header_size, points_at, records = struct.unpack_from("<HII", header, 94)
    extended_at, extended = struct.unpack_from("<QI", header, 235) if header[25] >= 4 and len(header) == 375 else (0, 0)
    fits = points_at <= size and records * _RECORD <= points_at - header_size
    if not (fits and (extended == 0 or extended * _EXTENDED_RECORD <= size - extended_at)):
        raise StemMapError(path, "is cut off, or its header is damaged: it promises more records than the file holds")


def _dimension(path: Path, header: Any, wanted: str | None) -> str:
    names = list(header.point_format.dimension_names)
    by_name = {name.lower(): name for name in reversed(names)}
    candidates = (wanted.lower(),) if wanted else TREE_DIMENSIONS
    for one in candidates:
        if one in by_name:
            return str(by_name[one])
    extra = ", ".join(map(repr, header.point_format.extra_dimension_names)) or "none beyond the standard ones"
    raise StemMapError(
        path,
        f"has no dimension {wanted or 'treeID'!r} that says which tree a point belongs to: segment the trees first, or "
        f"name the dimension with --id; its extra dimensions are {extra}",
    )


def _read(file: Any, names: list[str]) -> dict[str, Any]:
    """Coordinates and dimensions of the points that belong to a tree, and the number of all points."""
    parts: dict[str, list[NDArray[np.float64]]] = {key: [] for key in ("x", "y", "z", *names)}
    count = 0
    for chunk in file.chunk_iterator(_CHUNK):
        count += len(chunk)
        number = np.asarray(chunk[names[0]], dtype=np.float64)
        of_tree = np.isfinite(number) & (number > 0)
        for key, values in parts.items():
            values.append(np.asarray(chunk[key], dtype=np.float64)[of_tree])
    read: dict[str, Any] = {key: np.concatenate(values) if values else np.zeros(0) for key, values in parts.items()}
    return read | {"count": count}


def _table(path: Path, name: str, extra: list[str], points: dict[str, Any], crs: str | None) -> FileTable:
    order = np.argsort(points[name], kind="stable")
    numbers, starts, counts = np.unique(points[name][order], return_index=True, return_counts=True)
    columns: list[ColumnValues] = [numbers]
    names, varying = [name], []
    for one in extra if len(numbers) else ():
        values = points[one][order]
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        if np.array_equal(low, high, equal_nan=True):
            names.append(one)
            columns.append(low)
        else:
            varying.append(one)
    heights = points.get("above", points["z"])  # metres, also where x and y are in feet
    xyz = np.column_stack([points["x"][order], points["y"][order], heights[order]])
    xy, at_breast = _positions(xyz, starts, counts)
    told = [f"{points['count']} points", f"{points['count'] - len(order)} of no tree"]
    if len(counts) and counts.max() > 1:
        told.append(f"{at_breast} trees stand where their stem is at breast height, {len(counts) - at_breast} where "
                    "their lowest points are")  # fmt: skip
    if varying:
        told.append(f"not used, because they differ within a tree: {', '.join(map(repr, varying))}")
    return FileTable(path, names, columns, np.arange(1, len(numbers) + 1), xy=xy, crs=crs, notes=[", ".join(told)])


def _positions(
    xyz: NDArray[np.float64], starts: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.float64], int]:
    """Positions (T, 2) float64 of trees whose points (N, 3) are grouped, and how many are of the stem."""
    if not len(starts) or counts.max() == 1:
        return xyz[starts, :2], 0
    xy, at_breast = np.empty((len(starts), 2)), 0
    lowest = np.minimum.reduceat(xyz[:, 2], starts)
    for tree, (start, count) in enumerate(zip(starts.tolist(), counts.tolist(), strict=True)):
        points = xyz[start : start + count]
        above = points[:, 2] - lowest[tree]
        chosen = (above >= _BREAST[0]) & (above <= _BREAST[1])
        if chosen.sum() >= _FEWEST:
            at_breast += 1
        else:
            chosen = above <= _FOOT
        xy[tree] = np.median(points[chosen, :2], axis=0)
    return xy, at_breast
