"""One way to write a table: by the suffix of a file, or as pieces of a stream."""

import secrets
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from server.errors import NotAcceptable
from server.outputs.csv_text import csv_pieces
from server.outputs.extras import is_installed
from server.outputs.geojson_text import geojson_pieces
from server.outputs.geopackage import write_geopackage
from server.outputs.geoparquet import write_geoparquet
from server.outputs.tables import OutputLayer, OutputRows

FormatName = Literal["csv", "geojson", "gpkg", "parquet"]
Pieces = Callable[[OutputLayer, Iterable[OutputRows]], Iterator[bytes]]
WriteFile = Callable[[Path, OutputLayer, Iterable[OutputRows]], int]


def _text_file(pieces: Pieces) -> WriteFile:
    """What writes the pieces of a text format to a file, and counts rows."""

    def write(path: Path, layer: OutputLayer, batches: Iterable[OutputRows]) -> int:
        counts: list[int] = []

        def counted() -> Iterator[OutputRows]:
            for rows in batches:
                counts.append(len(rows))
                yield rows

        with path.open("wb") as file:
            file.writelines(pieces(layer, counted()))
        return sum(counts)

    return write


@dataclass(frozen=True, slots=True)
class OutputFormat:
    """A format: its name in options, the suffix of its files, its media type, and what writes it.

    `pieces` makes text that can be sent while it is made; None for formats that need a file. `package` is what must be
    installed, None if nothing more.
    """

    name: FormatName
    suffix: str
    media_type: str
    write: WriteFile
    pieces: Pieces | None = None
    package: str | None = None

    @property
    def is_there(self) -> bool:
        """Whether the format can be written here."""
        return self.package is None or is_installed(self.package)


FORMATS: Final = (
    OutputFormat("csv", ".csv", "text/csv", _text_file(csv_pieces), csv_pieces),
    OutputFormat("geojson", ".geojson", "application/geo+json", _text_file(geojson_pieces), geojson_pieces),
    OutputFormat("gpkg", ".gpkg", "application/geopackage+sqlite3", write_geopackage, package="pyogrio"),
    OutputFormat("parquet", ".parquet", "application/vnd.apache.parquet", write_geoparquet, package="pyarrow"),
)


def format_of(path: Path) -> OutputFormat:
    """The format of a file with this suffix. Raises NotAcceptable if there is none."""
    for one in FORMATS:
        if one.suffix == path.suffix.lower():
            return one
    suffixes = ", ".join(one.suffix for one in FORMATS)
    raise NotAcceptable(f"{path}: no table is written as {path.suffix or 'a file without a suffix'}: use {suffixes}",
                        [one.media_type for one in FORMATS])  # fmt: skip


def write_table(path: Path, layer: OutputLayer, batches: Iterable[OutputRows]) -> int:
    """Write a layer to the file `path`, in the format of its suffix. Returns the number of rows.

    The file appears when it is complete, in the place of one that was there before.

    Raises:
        NotAcceptable: no format has this suffix, or the package that writes it is not installed.
        OSError: the file cannot be written.
    """
    form = format_of(path)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(6)}{form.suffix}")
    try:
        count = form.write(temporary, layer, batches)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return count
