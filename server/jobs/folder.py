"""The files of jobs, in a folder beside the database: uploads and results."""

import os
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

from server.errors import StorageUnavailable
from server.platform.file_locks import try_lock
from server.store.storage import Storage
from urquhart.index.segment_file import sync

ARRIVING: Final = ".part"
INPUT: Final = ".input"
RESULTS: Final = ".results"
FOUND: Final = ".found"
UNPACKED: Final = ".unpacked"
FILES: Final = ".files"
_GRACE: Final = 60.0
"""Seconds for which no file is removed, because most are young and need no closer look."""

Unwanted = Callable[[Sequence[Path]], list[Path]]
"""A function that says which of some files are no longer needed."""


class JobFolder:
    """The folder `<database file>.jobs`, created when something is first written to it."""

    def __init__(self, database: Storage) -> None:
        file = database.path.resolve()
        self.path = file.with_name(f"{file.name}.jobs")

    def arriving(self, job_id: str) -> Path:
        """Path of an upload while it arrives."""
        return self.path / f"{job_id}{ARRIVING}"

    def input(self, job_id: str) -> Path:
        """Path of a job's upload."""
        return self.path / f"{job_id}{INPUT}"

    def results(self, job_id: str) -> Path:
        """Path of a job's results."""
        return self.path / f"{job_id}{RESULTS}"

    def found(self, job_id: str) -> Path:
        """Path of what a job has found so far."""
        return self.path / f"{job_id}{FOUND}"

    def unpacked(self, job_id: str) -> Path:
        """Path of the folder with the files of a job's upload."""
        return self.path / f"{job_id}{UNPACKED}"

    def files(self, job_id: str) -> Path:
        """Path of the folder with the files that a job writes."""
        return self.path / f"{job_id}{FILES}"

    def make(self) -> None:
        """Create the folder. Raises OSError."""
        self.path.mkdir(exist_ok=True)

    def publish(self, written: Path, path: Path) -> None:
        """Give a complete file its final name, durably. Raises OSError."""
        written.rename(path)
        self.sync()

    def sync(self) -> None:
        """Write the names of the files to the disk. Raises OSError."""
        sync(self.path)

    def clear(self, job_id: str) -> None:
        """Remove the files that a job needs only until it ends. Raises OSError."""
        for path in (self.input(job_id), self.found(job_id), self.unpacked(job_id)):
            _remove(path)

    def remove(self, job_id: str) -> None:
        """Remove the files of a job. Raises OSError."""
        self.clear(job_id)
        for path in (self.arriving(job_id), self.results(job_id), self.files(job_id)):
            _remove(path)

    @contextmanager
    def turn(self, collection_key: int) -> Iterator[bool]:
        """Lock the work on a collection, across processes. Yields whether the lock was free. Raises OSError."""
        self.make()
        path = self.path / f"{collection_key}.lock"
        # The open file holds the lock, so it is free when the process ends, however it ends.
        with path.open("a") as file:
            # The holder removes the file: a lock on a file that was removed excludes nobody.
            ours = try_lock(file) and _is_at(path, file)
            try:
                yield ours
            finally:
                if ours:
                    path.unlink(missing_ok=True)

    def clean_up(self, unwanted: Unwanted) -> int:
        """Remove files that are not wanted, and uploads that nobody sends any more. Returns their number. Raises
        OSError.
        """
        removed = 0
        for path in unwanted([path for path in self.path.iterdir() if _is_old(path)] if self.path.is_dir() else []):
            if path.is_dir():  # a job that has a row made it
                _remove(path)
                removed += 1
                continue
            try:
                with path.open("rb") as file:
                    # Whoever writes to a file, or reads it, has it locked until its row exists. So the rows are read
                    # again once the lock is free.
                    if try_lock(file) and unwanted([path]):
                        path.unlink(missing_ok=True)
                        removed += 1
            except FileNotFoundError:
                continue
        return removed


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it, if it is there. Raises OSError."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _is_old(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime >= _GRACE
    except FileNotFoundError:
        return False


def _is_at(path: Path, file: IO[Any]) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def cut(file: BinaryIO, written: int) -> None:
    """Cut off what was written but not committed. Raises StorageUnavailable if even committed data are missing."""
    if file.seek(0, os.SEEK_END) < written:
        raise StorageUnavailable(
            "The results of this job are missing from the folder of jobs. The submaps that it stored are still there."
        )
    file.truncate(written)
    file.seek(written)
