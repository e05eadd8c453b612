"""The files of jobs, in a folder beside the database: what was sent, and what came of it."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

from server.errors import StorageUnavailable
from server.platform.file_locks import try_lock
from server.store.sqlite.database import Database
from urquhart.index.segment_file import sync

ARRIVING: Final = ".part"
INPUT: Final = ".input"
RESULTS: Final = ".results"
FOUND: Final = ".found"
_GRACE: Final = 60.0
"""Seconds for which a file is left alone, whatever it is: most are young, and not worth a closer look."""

Unwanted = Callable[[Sequence[Path]], list[Path]]
"""Which of some files nobody will ask for any more."""


class JobFolder:
    """The folder `<database file>.jobs`, made when something is first written to it."""

    def __init__(self, database: Database) -> None:
        file = database.path.resolve()
        self.path = file.with_name(f"{file.name}.jobs")

    def arriving(self, job_id: str) -> Path:
        """Where an input lies while it comes in."""
        return self.path / f"{job_id}{ARRIVING}"

    def input(self, job_id: str) -> Path:
        """Where a job's input lies."""
        return self.path / f"{job_id}{INPUT}"

    def results(self, job_id: str) -> Path:
        """Where what came of it lies."""
        return self.path / f"{job_id}{RESULTS}"

    def found(self, job_id: str) -> Path:
        """Where a job notes what it has found so far."""
        return self.path / f"{job_id}{FOUND}"

    def make(self) -> None:
        """Make the folder. Raises OSError."""
        self.path.mkdir(exist_ok=True)

    def publish(self, written: Path, path: Path) -> None:
        """Give a whole file its name, for good. Raises OSError."""
        written.rename(path)
        self.sync()

    def sync(self) -> None:
        """Put the names of the files onto the disk. Raises OSError."""
        sync(self.path)

    def clear(self, job_id: str) -> None:
        """Remove what a job needs only until its end. Raises OSError."""
        for path in (self.input(job_id), self.found(job_id)):
            path.unlink(missing_ok=True)

    def remove(self, job_id: str) -> None:
        """Remove the files of a job. Raises OSError."""
        for path in (self.arriving(job_id), self.input(job_id), self.results(job_id), self.found(job_id)):
            path.unlink(missing_ok=True)

    @contextmanager
    def turn(self, collection_key: int) -> Iterator[bool]:
        """Be the only one, in this process or another, who works for a collection; whether it is so. Raises OSError."""
        self.make()
        path = self.path / f"{collection_key}.lock"
        # Held by the open file: it is free again when the process ends, however that comes.
        with path.open("a") as file:
            # Who held it removes it: a lock on a file that is there no more keeps nobody out.
            ours = try_lock(file) and _is_at(path, file)
            try:
                yield ours
            finally:
                if ours:
                    path.unlink(missing_ok=True)

    def clean_up(self, unwanted: Unwanted) -> int:
        """Remove what is not wanted, and what nobody sends any more; how many files. Raises OSError."""
        removed = 0
        for path in unwanted([path for path in self.path.iterdir() if _is_old(path)] if self.path.is_dir() else []):
            try:
                with path.open("rb") as file:
                    # Whoever sends it, or works with it, holds it until its row tells of it: so the rows are looked at
                    # once more when it is free.
                    if try_lock(file) and unwanted([path]):
                        path.unlink(missing_ok=True)
                        removed += 1
            except FileNotFoundError:
                continue
        return removed


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
    """Drop what was written and never committed. Raises StorageUnavailable where more is gone than that."""
    if file.seek(0, os.SEEK_END) < written:
        raise StorageUnavailable(
            "The results of this job are missing from the folder of jobs. The submaps that it stored are still there."
        )
    file.truncate(written)
    file.seek(written)
