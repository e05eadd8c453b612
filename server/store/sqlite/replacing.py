"""Another file put in the place of a database, in one step: whenever this ends, the old one is there or the new one.

The new file is made in a folder beside the database. The old one stays there under a name of its own. Whoever does this
holds the lock of `database_lock` exclusively.
"""

import os
import shutil
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal

from server.errors import Conflict, StorageFull, StorageUnavailable
from server.platform.ids import moment_name
from urquhart.index.segment_file import sync

Purpose = Literal["restore", "upgrade"]
_WORKSHOPS: Final[dict[Purpose, str]] = {"restore": "restoring", "upgrade": "upgrading"}
_BESIDE: Final = ("-wal", "-journal", "-shm")
"""Files that SQLite keeps beside a database, and would apply to any other that comes to its name."""
_PATIENCE: Final = 2.0
_SPARE: Final = 1 << 20


@contextmanager
def workshop(path: Path, purpose: Purpose) -> Iterator[Path]:
    """A folder beside a database to make the new file in; it is removed in the end. Raises OSError."""
    folder = path.with_name(f"{path.name}.{_WORKSHOPS[purpose]}")
    folder.mkdir(0o700)  # what is made in it has the old database's permissions only at the end
    try:
        yield folder
    finally:
        shutil.rmtree(folder)


def swap(fresh: Path, path: Path, purpose: Purpose, *, discard: bool = False) -> Path | None:
    """Put the file `fresh` in the place of the database at `path`, with the old one's owner and permissions.

    Returns where the old one lies now (`<file>.before-<purpose>-<time>`), None if there was none or `discard` is said.
    Raises OSError, Conflict for a database that another program has open, and StorageUnavailable.
    """
    _belong(fresh, path)
    sync(fresh)
    aside = path.with_name(f"{path.name}.before-{purpose}-{moment_name(datetime.now(UTC))}")
    there = path.exists()
    if there:
        fold(path)  # what SQLite cannot read keeps its log, and both go
        if not discard:
            aside.hardlink_to(path)
    for ending in _BESIDE:
        beside = path.with_name(path.name + ending)
        if beside.exists():
            if discard or ending == "-shm":
                beside.unlink()
            else:
                beside.rename(aside.with_name(aside.name + ending))
    sync(path.parent)
    fresh.replace(path)
    sync(path.parent)
    return aside if there and not discard else None


def require_room(path: Path, folder: Path, what: str, advice: str) -> None:
    """Raise StorageFull unless a copy of the database at `path` fits into a folder.

    `what` begins the error's sentence and says what needs the room; `advice` ends it.
    """
    # Checked beforehand, because a disk that a copy fills up fails everybody's writes.
    needed, free = path.stat().st_size + _SPARE, shutil.disk_usage(folder).free
    if free < needed:
        raise StorageFull(f"{what} needs {needed:,} bytes, but {free:,} are free, so nothing was changed. {advice}")


def mend(path: Path) -> None:
    """Undo what an interrupted replacement has begun: the database has two names for a moment, and must have one."""
    for ending in _WORKSHOPS.values():
        folder = path.with_name(f"{path.name}.{ending}")
        if folder.exists():
            shutil.rmtree(folder)
    prefixes = tuple(f"{path.name}.before-{purpose}-" for purpose in _WORKSHOPS)
    for aside in list(path.parent.iterdir()):
        if aside.name.startswith(prefixes) and path.exists() and aside.samefile(path):
            for ending in _BESIDE:
                beside = aside.with_name(aside.name + ending)
                if beside.exists():
                    beside.rename(path.with_name(path.name + ending))
            aside.unlink()


def fold(file: Path) -> bool:
    """Bring a log into its database, which only works for who is alone with it; whether SQLite can read it at all.

    Raises Conflict for a database that another program has open, and StorageUnavailable.
    """
    if not _has_header(file):
        return False
    try:
        with closing(sqlite3.connect(f"{file.as_uri()}?mode=rw", uri=True, timeout=_PATIENCE)) as connection:
            return bool(connection.execute("PRAGMA journal_mode = DELETE").fetchone()[0] == "delete")
    except sqlite3.DatabaseError as error:
        code = (error.sqlite_errorcode or 0) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise Conflict(f"{file} is open in another program. Close it and try again.") from error
        if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
            return False
        raise StorageUnavailable(f"{file} cannot be written: {error}.") from error


def has_content(file: Path) -> bool:
    """Whether a file is there and not empty."""
    return file.exists() and file.stat().st_size > 0


def _has_header(file: Path) -> bool:
    """Whether a file begins like a database that has the log beside it: what has not, SQLite robs of its log."""
    log = file.with_name(f"{file.name}-wal")
    with file.open("rb") as opened:
        header = opened.read(20)
    return header.startswith(b"SQLite format 3\0") and (header[18:] == b"\2\2" or not has_content(log))


def _belong(fresh: Path, path: Path) -> None:
    """Give the new file the owner and the permissions of the old one."""
    if not path.exists():
        return
    old = path.stat()
    fresh.chmod(stat.S_IMODE(old.st_mode))
    if (old.st_uid, old.st_gid) != (os.getuid(), os.getgid()) and os.geteuid() == 0:
        os.chown(fresh, old.st_uid, old.st_gid)
