"""An upload on its way to the disk: never in memory as a whole, and there as a whole or not at all."""

import hashlib
import os
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import BinaryIO, Final, Protocol

import anyio.to_thread

from server.config.settings import Limits
from server.errors import MalformedBody, TooLarge
from server.jobs.folder import JobFolder
from server.platform.file_locks import try_lock
from server.store.sqlite.sqlite_errors import storage_errors

_PIECE: Final = 1 << 20
"""Bytes that are inflated and written at once."""


class Inflating(Protocol):
    """What turns packed bytes into those that were packed."""

    def feed(self, data: bytes, most: int) -> bytes:
        """Up to `most` bytes more."""

    def finish(self) -> None:
        """Refuse a stream that ended before its end."""


@dataclass(frozen=True, slots=True)
class ReceivedUpload:
    """What arrived: bytes and lines of it, and its SHA-256."""

    size: int
    lines: int
    digest: str


@asynccontextmanager
async def receive_upload(
    folder: JobFolder, job_id: str, pieces: AsyncIterator[bytes], limits: Limits, inflater: Inflating | None
) -> AsyncIterator[ReceivedUpload]:
    """Write an upload to the job's input, and onto the disk; within the block its job is taken on.

    Raises TooLarge, MalformedBody, StorageError, and what ends the pieces. Then, and where the block raises, nothing is
    left of it.
    """
    path = folder.arriving(job_id)
    try:
        with ExitStack() as held:
            with storage_errors(folder.path):
                folder.make()
                file = held.enter_context(path.open("xb"))
                try_lock(file)  # until its job is there, nobody takes it for a left-over
                writer = _Writer(file, limits, inflater)
                async for piece in pieces:
                    if piece:
                        await anyio.to_thread.run_sync(writer.write, piece)
                await anyio.to_thread.run_sync(writer.close)
                folder.publish(path, folder.input(job_id))
            yield ReceivedUpload(writer.size, writer.lines, writer.digest.hexdigest())
    except Exception:
        folder.remove(job_id)
        raise
    except BaseException:
        # Cut short, with the job perhaps there already: its input is removed if it is not.
        path.unlink(missing_ok=True)
        raise


class _Writer:
    def __init__(self, file: BinaryIO, limits: Limits, inflater: Inflating | None) -> None:
        self._file, self._limits, self._inflater = file, limits, inflater
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
        try:
            if self._inflater is not None:
                self._inflater.finish()
        except MalformedBody as error:
            where = f"It breaks off in line {self.lines + 1}; nothing was taken on."
            raise MalformedBody(f"{error} {where}") from error
        self.lines += self._open_line
        self._file.flush()
        os.fsync(self._file.fileno())

    def _put(self, content: bytes) -> None:
        self.size += len(content)
        if self.size > self._limits.import_bytes:
            raise TooLarge(
                "import_bytes",
                self._limits.import_bytes,
                None,
                "Send the upload in parts. The limit applies to its size when unpacked.",
            )
        if content:
            self.lines += content.count(b"\n")
            self._open_line = not content.endswith(b"\n")
            if self.lines + self._open_line > self._limits.import_lines:
                raise TooLarge(
                    "import_lines", self._limits.import_lines, None, "Send the upload in parts. Blank lines count, too."
                )
            self.digest.update(content)
            self._file.write(content)
