"""Files that are written whole before they are sent: formats whose beginning depends on their end."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Final

from server.exports.layers import Export
from server.outputs.files import OutputFormat
from server.platform.disk_errors import disk_errors
from server.store.storage import Storage

_PIECE: Final = 1 << 18
"""Bytes that are read and sent at once."""


@dataclass(frozen=True, slots=True)
class Download:
    """A file without a name, which is gone when it is closed, and its size in bytes."""

    file: BufferedReader
    size: int

    def pieces(self) -> Iterator[bytes]:
        """The content. Closes the file."""
        with self.file as file:
            while piece := file.read(_PIECE):
                yield piece


def write_download(database: Storage, made: Export, form: OutputFormat) -> Download:
    """Write an export as a file beside the database, where there is room for data, and open it.

    A database that may not be written has its exports in the system's temporary folder.

    Raises:
        NotAcceptable: the package that writes the format is not installed.
        StorageError: the disk is full, or reports another error.
    """
    beside = None if database.read_only else str(database.path.parent)
    with (
        disk_errors(database.path),
        tempfile.TemporaryDirectory(prefix=".export-", dir=beside, ignore_cleanup_errors=True) as folder,
    ):
        path = Path(folder) / f"export{form.suffix}"
        form.write(path, made.layer, made.rows)
        file = path.open("rb")
        return Download(file, path.stat().st_size)
