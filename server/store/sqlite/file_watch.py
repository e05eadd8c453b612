"""Whether a database file is still the one that was opened, under its name, with its write-ahead log and its content.

SQLite asks this hardly ever: after a `mv` it goes on writing into the file that was moved, and connections that are
opened later use whatever lies at the path. So the service compares before each use of the database, and after each
commit, before it acknowledges it. A look is a few system calls and takes about ten microseconds.

The database is looked at by name only. To open and close it or its `-shm` file would drop the locks of SQLite in
this process (POSIX locks belong to the process), which is why the descriptors of `-shm` and of the log are shared and
kept.
"""

import os
import struct
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from server.store.sqlite import stale_log
from server.store.sqlite.stale_log import Identity, identity

_HEADER: Final = struct.Struct("=I4xIBBHII8x8s8s")
"""Of the wal-index (SQLite's `WalIndexHdr`): version, change, initialised, byte order, page size, frames, pages, salts,
checksum.
"""
_HEADER_BYTES: Final = 48
_BACKFILLED, _ATTEMPTED, _INDEX_BYTES = 96, 128, 136
"""Where the wal-index says how many frames are in the database, and how many a checkpoint began to put there."""
_LOG_HEADER: Final = 32
_LOG_SALTS: Final = slice(16, 24)
_FRAME_HEADER: Final = 24
_FRAME_SALTS: Final = slice(8, 16)
"""Where the log and each of its frames repeat the salts of the wal-index."""
_TRIES: Final = 20
"""Looks at a wal-index that somebody else is changing, before it is taken as it is."""
_WHAT_TO_DO: Final = (
    "Nothing is read or stored until this is mended. Put the same file back where it was, and the service goes on by "
    "itself; to use another file, stop the service, put that file in place, and start the service."
)
_RESTART: Final = (
    "Nothing is read or stored any more. Stop the service, restore the database from a backup or a snapshot if "
    "`urquhart db check` finds fault with it, and start the service."
)
_CHANGED: Final = "was written to by something else than SQLite."


@dataclass(frozen=True, slots=True)
class Trouble:
    """Why the database must not be used.

    Attributes:
        sentence: what is wrong and what to do.
        kind: `moved`: the file and the log that are open are as SQLite left them, though not under their names.
            `apart`: file and log do not belong together any more, and the log must not be written into the file.
            `index`: file and log do belong together, but what SQLite knows of the log was cut off.
    """

    sentence: str
    kind: Literal["moved", "apart", "index"]


@dataclass(frozen=True, slots=True)
class _Index:
    """What the wal-index says: bytes that the log must have, and how far checkpoints came since which start of it."""

    log_bytes: int
    frame_bytes: int
    checkpoints: tuple[bytes, int]
    at_work: bool

    @property
    def salts(self) -> bytes:
        """What marks the log and every frame since it was last restarted."""
        return self.checkpoints[0]


class FileWatch:
    """Compares one database file with what was opened; `bind` says what that is. Thread-safe."""

    def __init__(self, path: Path) -> None:
        """Of the file at `path`, which need not be there yet."""
        self.path = path
        self._file: Identity | None = None
        self._beside: dict[str, tuple[Path, Identity]] = {}
        self._descriptors: dict[str, int] = {}
        self._seen: tuple[int, int, tuple[bytes, int]] | None = None
        self._apart: str | None = None
        self._guard = threading.Lock()

    @property
    def bound(self) -> bool:
        """Whether there is something to compare with."""
        return self._file is not None

    def bind(self) -> None:
        """What lies at the path now, with its log, is what is open; a connection must have read it. Raises OSError."""
        with self._guard:
            real = self.path.resolve()
            self._beside = {}
            for ending in ("-wal", "-shm"):
                path = real.with_name(f"{real.name}{ending}")
                if path.exists():
                    self._beside[ending] = path, identity(path)
            self._descriptors = {ending: _DESCRIPTORS.borrow(*beside) for ending, beside in self._beside.items()}
            self._seen = self._apart = None
            self._file = identity(self.path)

    def release(self) -> None:
        """Compare with nothing any more; no connection may be open."""
        with self._guard:
            for ending in self._descriptors:
                _DESCRIPTORS.give_back(self._beside[ending][1])
            self._file = None
            self._beside, self._descriptors = {}, {}

    def trouble(self) -> Trouble | None:
        """Why the database must not be used now; None where all is well, or nothing was bound."""
        with self._guard:
            return None if self._file is None else self._look()

    def set_log_aside(self) -> Path | None:
        """Take the log from the name at which SQLite would apply it to the file; where it lies then. Raises OSError."""
        with self._guard:
            if "-wal" not in self._beside:
                return None
            aside = stale_log.set_aside(*self._beside["-wal"])
            shared, wanted = self._beside["-shm"]
            if shared.exists() and identity(shared) == wanted:
                shared.unlink()  # whoever opens the file next would read there what was in the log
            return aside

    def _look(self) -> Trouble | None:
        name = self.path.name
        if "-shm" in self._descriptors and os.fstat(self._descriptors["-shm"]).st_size < _INDEX_BYTES:
            return Trouble(f"{name}-shm was cut off. {_RESTART}", "index")
        moved = self._moved()
        try:
            self._apart = self._apart or self._fallen_apart(moved)
            if self._apart is not None:
                return Trouble(f"{self._apart} {self._kept()}{_RESTART}", "apart")
        except OSError as error:
            moved = moved or _missing(error, self.path)
        return None if moved is None else Trouble(f"{moved} {_WHAT_TO_DO}", "moved")

    def _moved(self) -> str | None:
        """What does not lie under its name any more, None where everything does."""
        try:
            for path, opened in ((self.path, self._file), *self._beside.values()):
                if identity(path) != opened:
                    return f"Another file lies where the service opened {path.name}, which was moved or deleted."
        except OSError as error:
            return _missing(error, self.path)
        return None

    def _fallen_apart(self, moved: str | None) -> str | None:
        """Why the log does not belong to the file any more, None where it does. Raises OSError."""
        if len(self._descriptors) < 2:
            return None
        # Looked for after it was missed: another process sets it aside at any moment.
        if moved is not None and stale_log.find(*self._beside["-wal"]) is not None:
            return f"{self.path.name} {_CHANGED}"
        for _ in range(_TRIES):  # others commit and checkpoint between the looks at the several files
            found = self._compare(self._descriptors["-shm"], self._descriptors["-wal"])
            if found is None:
                return None
        return found

    def _kept(self) -> str:
        log, opened = self._beside["-wal"]
        aside = stale_log.find(log, opened)
        if aside is None:
            return ""
        return (
            f"What was stored last is kept in {aside.name} and is not used any more; if nothing but the times of "
            f"the file was changed, stop the service and rename that to {log.name}. "
        )

    def _compare(self, shared: int, log: int) -> str | None:
        name = self.path.name
        before = _read_index(shared)
        if before is None:
            return None
        whole, file = _is_whole(log, before), self.path.stat()
        if (file.st_dev, file.st_ino) != self._file:
            return None
        after = _read_index(shared)
        if after is None:
            return None
        if not whole and before.salts == after.salts and after.log_bytes >= before.log_bytes:
            return f"{name}-wal was cut off, and what it held is gone."
        if file.st_size == 0:
            return f"{name} was cut off."
        if before.checkpoints != after.checkpoints or after.at_work:
            return None  # the file is being written to by SQLite
        seen = file.st_size, file.st_mtime_ns, after.checkpoints
        if self._seen is not None and self._seen[2] == seen[2] and self._seen != seen:
            # SQLite writes to the file in checkpoints only, and there was none.
            return f"{name} {_CHANGED}"
        self._seen = seen
        return None


def _missing(error: OSError, path: Path) -> str:
    return f"{Path(str(error.filename or path)).name} cannot be found: {error.strerror or error}."


def _read_index(shared: int) -> _Index | None:
    """What the wal-index says; None while somebody changes it, or before anything was written to the log."""
    content = os.pread(shared, _INDEX_BYTES, 0)
    if len(content) < _INDEX_BYTES or content[:_HEADER_BYTES] != content[_HEADER_BYTES : 2 * _HEADER_BYTES]:
        return None
    _, _, initialised, _, page, frames, _, salts, _ = _HEADER.unpack_from(content)
    if not initialised:
        return None
    frame_bytes = _FRAME_HEADER + (page & 0xFE00) + ((page & 0x0001) << 16)
    backfilled, attempted = (struct.unpack_from("=I", content, at)[0] for at in (_BACKFILLED, _ATTEMPTED))
    log_bytes = _LOG_HEADER + frames * frame_bytes if frames else 0
    return _Index(log_bytes, frame_bytes, (salts, backfilled), attempted > backfilled)


def _is_whole(log: int, index: _Index) -> bool:
    """Whether a log holds the frames that its index names.

    A log that was cut off may be as long as before: the next commit writes at the end that the index knows. The file
    system fills the rest with a hole, in which no header of the log or of a frame has the salts.
    """
    if not index.log_bytes:
        return True
    if os.fstat(log).st_size < index.log_bytes or os.pread(log, _LOG_HEADER, 0)[_LOG_SALTS] != index.salts:
        return False
    hole = os.lseek(log, 0, os.SEEK_HOLE) if hasattr(os, "SEEK_HOLE") else index.log_bytes
    first = max(hole - _LOG_HEADER, 0) // index.frame_bytes * index.frame_bytes + _LOG_HEADER
    return all(
        os.pread(log, _FRAME_HEADER, at)[_FRAME_SALTS] == index.salts
        for at in (first, first + index.frame_bytes)
        if at < index.log_bytes
    )


class _Descriptors:
    """Open files by identity, shared by all who watch the same database in this process."""

    def __init__(self) -> None:
        self._open: dict[Identity, tuple[int, int]] = {}
        self._guard = threading.Lock()

    def borrow(self, path: Path, identity: Identity) -> int:
        """A descriptor for reading. Raises OSError."""
        with self._guard:
            descriptor, users = self._open.get(identity, (-1, 0))
            if not users:
                descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
            self._open[identity] = descriptor, users + 1
            return descriptor

    def give_back(self, identity: Identity) -> None:
        """One who borrowed it needs it no more."""
        with self._guard:
            descriptor, users = self._open.pop(identity)
            if users > 1:
                self._open[identity] = descriptor, users - 1
            else:
                os.close(descriptor)


_DESCRIPTORS: Final = _Descriptors()
