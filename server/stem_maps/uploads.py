"""Files that callers of the service send, read by the one reader in a process of its own.

Libraries of many formats parse them, some written in C. A file that ends the process, needs more memory than it may, or
takes too long is refused, and the service goes on.
"""

import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from server.errors import InvalidFile, Overloaded
from server.platform.isolated_process import IsolatedProcess
from server.stem_maps.formats.files import TEXT_SUFFIXES
from server.stem_maps.reader import StemMap, StemMapError, read_stem_map
from server.stem_maps.reading.options import ReadOptions

_SECONDS: Final = 60.0
"""That a file may take. A million trees as CSV take 17 s (docs/files.md)."""
_PATIENCE: Final = 15.0
"""Seconds that a file waits for those before it."""
_SMALL: Final = 1 << 20
"""Bytes of text that are read in the process of the service, in less time than a process takes to start."""
_SHOWN: Final = 100
"""Most rows at fault in an answer."""


@dataclass(frozen=True, slots=True)
class UploadedFile:
    """A file as it was sent: its name, which says the format, its bytes, and what is known of it."""

    name: str
    data: bytes = field(repr=False)
    options: ReadOptions


class UploadReader:
    """Reads one file after the other. The process starts at the first file that needs it, and stays."""

    def __init__(self) -> None:
        self._process = IsolatedProcess(_load)
        self._busy = threading.Lock()

    def read(self, upload: UploadedFile) -> StemMap:
        """The trees of a file, at least one.

        Raises:
            InvalidFile: the file cannot be read, or not within the limits, or holds no tree.
            Overloaded: other files take too long.
            WorkerLost: no process can be started.
        """
        if Path(upload.name).suffix.lower() == ".shp":
            raise InvalidFile("A Shapefile is several files. Send the layer as a GeoPackage.")
        if Path(upload.name).suffix.lower() in TEXT_SUFFIXES and len(upload.data) <= _SMALL:
            return _result(_read(upload))
        if not self._busy.acquire(timeout=_PATIENCE):
            raise Overloaded("Other files are being read. Send this one again later.", retry_after=5.0)
        try:
            outcome = self._process.attempt(_read, upload, _SECONDS)
        finally:
            self._busy.release()
        if outcome.error is not None:
            raise outcome.error
        if outcome.lost is not None:
            raise InvalidFile(
                f"The file {upload.name!r} was not read: {outcome.lost}. It is damaged, or too large to be sent; "
                "`urquhart index` on the host reads larger files."
            )
        return _result(outcome.result)

    def close(self) -> None:
        """End the process. No file may be read at that time."""
        self._process.close()


def _load() -> None:
    """What the process does before its first file: nothing more than importing this module."""


def _read(upload: UploadedFile) -> StemMap | tuple[str, list[dict[str, Any]]]:
    """The trees of a file, or why it cannot be read and the rows at fault."""
    with tempfile.TemporaryDirectory(prefix="urquhart-") as folder:
        path = Path(folder) / upload.name
        path.write_bytes(upload.data)
        try:
            return read_stem_map(path, upload.options)
        except StemMapError as error:
            rows = [
                {"line": row.line, "code": "bad_row", "detail": f"{row.column}: {row.what}" if row.column else row.what}
                for row in sorted(error.bad_rows, key=lambda row: row.line)[:_SHOWN]
            ]
            return str(error).replace(f"{folder}/", ""), rows


def _result(read: StemMap | tuple[str, list[dict[str, Any]]]) -> StemMap:
    if isinstance(read, StemMap):
        return read
    raise InvalidFile(*read)
