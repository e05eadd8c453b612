"""The results of a season so far, on disk: a second run goes on where the first one was."""

import os
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final

from server.coregistration.results import PlotResult, from_json
from server.platform.file_locks import try_lock

JOURNAL: Final = "results.jsonl"


class FolderError(ValueError):
    """A folder that results cannot be written to. The message is one line that says what to do."""


class Journal:
    """One line for each plot that was looked up. Used in a `with` block, in which no other run uses the folder.

    A line that was cut off by a kill, or written by another version, does not count.
    """

    def __init__(self, folder: Path) -> None:
        """Open the journal of `folder`, which is created if it does not exist.

        Raises:
            FolderError: the folder holds files of something else, or another run uses it.
            OSError: it cannot be written to.
        """
        self._file: BinaryIO = _opened(folder)
        self._known: dict[str, PlotResult] = {}
        whole = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            whole += len(line)
            try:
                result = from_json(line)
            except ValueError:
                continue
            self._known[result.key] = result
        self._file.truncate(whole)
        self._file.seek(0, os.SEEK_END)

    def find(self, key: str) -> PlotResult | None:
        """The result with that key, if there is one."""
        return self._known.get(key)

    def add(self, result: PlotResult) -> None:
        """Store a result; it is in the file when this returns, whatever becomes of the process."""
        self._file.write(result.to_json() + b"\n")
        self._file.flush()
        self._known[result.key] = result

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _opened(folder: Path) -> BinaryIO:
    """The locked file. Raises FolderError."""
    path = folder / JOURNAL
    if folder.exists() and not folder.is_dir():
        raise FolderError(f"{folder}: is a file, and results need a folder: choose another one")
    if folder.is_dir() and not path.exists() and any(folder.iterdir()):
        raise FolderError(f"{folder}: holds files that are not results of coregister: choose an empty or a new folder")
    folder.mkdir(parents=True, exist_ok=True)
    file = path.open("a+b")
    if not try_lock(file):
        file.close()
        raise FolderError(f"{folder}: another run writes its results there: wait for it, or choose another folder")
    file.seek(0)
    return file
