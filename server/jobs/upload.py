"""An upload on its way to the disk: never in memory as a whole, and stored completely or not at all."""

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
from server.platform.disk_errors import disk_errors
from server.platform.file_locks import try_lock

_PIECE: Final = 1 << 20
"""Bytes that are decompressed and written at once."""


class Inflating(Protocol):
    """A decompressor."""

    def feed(self, data: bytes, most: int) -> bytes:
        """Decompress at most `most` bytes."""

    def finish(self) -> None:
        """Raise if the stream is not complete."""


@dataclass(frozen=True, slots=True)
class UploadForm:
    """How an upload is packed, and whether it is text whose lines are counted and limited."""

    inflater: Inflating | None = None
    has_lines: bool = True


@dataclass(frozen=True, slots=True)
class ReceivedUpload:
    """A received upload: its size in bytes and lines, and its SHA-256."""

    size: int
    lines: int
    digest: str


@asynccontextmanager
async def receive_upload(
    folder: JobFolder, job_id: str, pieces: AsyncIterator[bytes], limits: Limits, form: UploadForm
) -> AsyncIterator[ReceivedUpload]:
    """Write an upload to the job's input, durably. The caller accepts the job within the block.

    Raises TooLarge, MalformedBody, StorageError, and what the stream raises. Then, or if the block raises, nothing of
    the upload is left.
    """
    path = folder.arriving(job_id)
    try:
        with ExitStack() as held:
            with disk_errors(folder.path):
                folder.make()
                file = held.enter_context(path.open("xb"))
                try_lock(file)  # until its job exists, so that it is not removed as a left-over
                writer = _Writer(file, limits, form)
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
        # The block was interrupted, perhaps after the job was stored. If it was not, the input is removed later.
        path.unlink(missing_ok=True)
        raise


class _Writer:
    def __init__(self, file: BinaryIO, limits: Limits, form: UploadForm) -> None:
        self._file, self._limits, self._inflater, self._has_lines = file, limits, form.inflater, form.has_lines
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
            place = f"in line {self.lines + 1}" if self._has_lines else f"after {self.size} bytes"
            where = f"It breaks off {place}; nothing was taken on."
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
            if self._has_lines and self.lines + self._open_line > self._limits.import_lines:
                raise TooLarge(
                    "import_lines", self._limits.import_lines, None, "Send the upload in parts. Blank lines count, too."
                )
            self.digest.update(content)
            self._file.write(content)
