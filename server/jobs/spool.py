"""An upload on its way to the disk: never in memory as a whole, and there as a whole or not at all."""

import hashlib
import os
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import BinaryIO, Final, Protocol

import anyio.to_thread

from server.errors import TooLarge
from server.jobs.folder import JobFolder, try_lock
from server.store.database import storage_errors

_PIECE: Final = 1 << 20
"""Bytes that are inflated and written at once."""


class Inflating(Protocol):
    """What turns packed bytes into those that were packed."""

    def feed(self, data: bytes, most: int) -> bytes:
        """Up to `most` bytes more."""

    def finish(self) -> None:
        """Refuse a stream that ended before its end."""


@dataclass(frozen=True, slots=True)
class Spooled:
    """What arrived: bytes and lines of it, and its SHA-256."""

    size: int
    lines: int
    digest: str


async def spool(
    folder: JobFolder, job_id: str, pieces: AsyncIterator[bytes], limit: int, inflater: Inflating | None
) -> Spooled:
    """Write an upload to the job's input, and onto the disk.

    Raises TooLarge, MalformedBody, StorageError, and what ends the pieces; then nothing is left of it.
    """
    path = folder.arriving(job_id)
    with storage_errors(folder.path):
        folder.make()
    try:
        with storage_errors(folder.path), path.open("xb") as file:
            try_lock(file)  # for as long as it comes in, nobody takes it for a left-over
            writer = _Writer(file, limit, inflater)
            async for piece in pieces:
                if piece:
                    await anyio.to_thread.run_sync(writer.write, piece)
            await anyio.to_thread.run_sync(writer.close)
            folder.publish(path, folder.input(job_id))
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return Spooled(writer.size, writer.lines, writer.digest.hexdigest())


class _Writer:
    def __init__(self, file: BinaryIO, limit: int, inflater: Inflating | None) -> None:
        self._file, self._limit, self._inflater = file, limit, inflater
        self.size = self.lines = 0
        self._open_line = False
        self.digest = hashlib.sha256()

    def write(self, piece: bytes) -> None:
        if self._inflater is None:
            self._put(piece)
            return
        while True:
            out = self._inflater.feed(piece, _PIECE)
            self._put(out)
            if len(out) < _PIECE:
                return
            piece = b""

    def close(self) -> None:
        if self._inflater is not None:
            self._inflater.finish()
        self.lines += self._open_line
        self._file.flush()
        os.fsync(self._file.fileno())

    def _put(self, content: bytes) -> None:
        self.size += len(content)
        if self.size > self._limit:
            raise TooLarge("import_bytes", self._limit, None, "Send it in parts; it counts what it is unpacked.")
        if content:
            self.lines += content.count(b"\n")
            self._open_line = not content.endswith(b"\n")
            self.digest.update(content)
            self._file.write(content)
