"""The files of jobs, in a folder beside the database: what was sent, and what came of it."""

import fcntl
import os
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

from server.store.database import Database

_ARRIVING: Final = ".part"
_GRACE: Final = 60.0
"""Seconds that a file may wait for its job's row."""


class JobFolder:
    """The folder `<database file>.jobs`, made when something is first written to it."""

    def __init__(self, database: Database) -> None:
        file = database.path.resolve()
        self.path = file.with_name(f"{file.name}.jobs")

    def arriving(self, job_id: str) -> Path:
        """Where an input lies while it comes in."""
        return self.path / f"{job_id}{_ARRIVING}"

    def input(self, job_id: str) -> Path:
        """Where a job's input lies."""
        return self.path / f"{job_id}.input"

    def results(self, job_id: str) -> Path:
        """Where what came of it lies."""
        return self.path / f"{job_id}.results"

    def found(self, job_id: str) -> Path:
        """Where a job notes what it has found so far."""
        return self.path / f"{job_id}.found"

    def make(self) -> None:
        """Make the folder. Raises OSError."""
        self.path.mkdir(exist_ok=True)

    def publish(self, written: Path, path: Path) -> None:
        """Give a whole file its name, for good. Raises OSError."""
        written.rename(path)
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def remove(self, job_id: str) -> None:
        """Remove the files of a job. Raises OSError."""
        for path in (self.arriving(job_id), self.input(job_id), self.results(job_id), self.found(job_id)):
            path.unlink(missing_ok=True)

    @contextmanager
    def turn(self, collection_key: int) -> Iterator[bool]:
        """Be the only one, in this process or another, who works for a collection; whether it is so. Raises OSError."""
        self.make()
        # Held by the open file: it is free again when the process ends, however that comes.
        with (self.path / f"{collection_key}.lock").open("a") as file:
            yield try_lock(file)

    def sweep(self, known: Collection[str]) -> int:
        """Remove what belongs to no job of `known`, and what nobody sends any more; how many files. Raises OSError."""
        swept = 0
        for path in list(self.path.iterdir()) if self.path.is_dir() else []:
            if path.suffix not in {_ARRIVING, ".input", ".results", ".found"} or path.stem in known:
                continue
            try:
                if time.time() - path.stat().st_mtime < _GRACE:
                    continue
                with path.open("rb") as file:
                    if try_lock(file):  # who sends it still holds it
                        path.unlink(missing_ok=True)
                        swept += 1
            except FileNotFoundError:
                continue
        return swept


def try_lock(file: "BinaryIO | object") -> bool:
    """Lock an open file for as long as it is open, unless somebody else has; whether it is ours."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # type: ignore[arg-type]
    except BlockingIOError:
        return False
    return True
