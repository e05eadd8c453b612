"""A file read as a table, by the format that its suffix names."""

import hashlib
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.stem_maps.formats.parquet_files import PARQUET_SUFFIX, read_parquet
from server.stem_maps.formats.point_clouds import read_point_cloud
from server.stem_maps.formats.table import FileTable, StemMapError
from server.stem_maps.formats.text import read_text
from server.stem_maps.formats.vector_files import VECTOR_FORMATS, read_vector
from server.stem_maps.formats.workbooks import read_workbook

TEXT_SUFFIXES: Final = (".csv", ".tsv", ".txt", ".asc", ".xyz", ".dat")
WORKBOOK_SUFFIXES: Final = (".xlsx", ".xlsm")
CLOUD_SUFFIXES: Final = (".las", ".laz")
_ADVICE: Final = {
    ".xls": "is an old Excel file: save it as xlsx",
    ".ods": "is an OpenDocument sheet, which is not read: save it as xlsx or CSV",
    ".rds": "is R's own format: write the table with write.csv or sf::st_write",
    ".rdata": "is R's own format: write the table with write.csv or sf::st_write",
    ".rda": "is R's own format: write the table with write.csv or sf::st_write",
    ".zip": "is an archive: unpack it, and give the file in it",
    ".gz": "is compressed: unpack it",
    ".kmz": "is a compressed KML file: unpack it, and give the kml file in it",
    ".gdb": "is a file geodatabase, which is not read: export the layer as a GeoPackage",
    ".dbf": "has the attributes of a Shapefile: give the shp file beside it",
    ".ply": "is a point cloud without trees: write the trees as CSV, or the cloud as LAZ with tree ids",
    ".e57": "is a point cloud without trees: write the trees as CSV, or the cloud as LAZ with tree ids",
}
_SIDECARS: Final = (".dbf", ".shx", ".prj", ".cpg")
_CHUNK: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class FilePart:
    """What to read of a file that may hold several tables.

    Attributes:
        layer: name of a layer or sheet; None for the only one.
        tree_dimension: the dimension of a point cloud that numbers the trees; None for a well-known one.
        is_header: recognises the names of a header, where titles may stand above it.
    """

    layer: str | None
    tree_dimension: str | None
    is_header: Callable[[list[str]], bool]


def read_table(path: Path, part: FilePart) -> FileTable:
    """The table in `path`. A suffix that no format has is read as text. Raises StemMapError."""
    check_file(path)
    suffix = path.suffix.lower()
    if suffix in _ADVICE:
        raise StemMapError(path, _ADVICE[suffix])
    if suffix == PARQUET_SUFFIX:
        return read_parquet(path, part.layer)
    if suffix in VECTOR_FORMATS:
        return read_vector(path, part.layer)
    if suffix in WORKBOOK_SUFFIXES:
        return read_workbook(path, part.layer, part.is_header)
    if part.layer is not None:
        raise StemMapError(path, f"has no layers, but --layer names {part.layer!r}: drop it")
    if suffix in CLOUD_SUFFIXES:
        return read_point_cloud(path, part.tree_dimension)
    return read_text(path, path.read_bytes(), part.is_header)


def check_file(path: Path) -> None:
    """Raise StemMapError unless `path` is a file that can be opened."""
    try:
        if path.is_dir():
            raise StemMapError(path, _ADVICE.get(path.suffix.lower(), "is a directory: give a file"))
        if not stat.S_ISREG(path.stat().st_mode):
            raise StemMapError(path, "is no regular file: give the file itself")
        with path.open("rb"):
            return
    except FileNotFoundError:
        raise StemMapError(path, "no such file") from None
    except OSError as error:
        raise StemMapError(path, f"cannot be read: {error.strerror or error}") from None


def file_digest(path: Path) -> str:
    """A short hex hash of a file, and of those that belong to a Shapefile. Equals `digest` of one file's bytes."""
    hasher = hashlib.blake2b(digest_size=12)
    sidecars = [path.with_suffix(end) for end in _SIDECARS] if path.suffix.lower() == ".shp" else []
    for one in (path, *(sidecar for sidecar in sidecars if sidecar.exists())):
        hasher.update(one.stat().st_size.to_bytes(8, "little"))
        with one.open("rb") as file:
            while chunk := file.read(_CHUNK):
                hasher.update(chunk)
    return hasher.hexdigest()
