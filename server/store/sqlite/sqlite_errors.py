"""What SQLite and the disk report, in the words of the domain."""

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from server import errors


def domain_error(error: sqlite3.Error, path: Path) -> errors.StorageError | None:
    """The error of the domain that an error of SQLite on the database at `path` is; None for one of the program."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None and "Could not decode to UTF-8" in str(error):
        code = sqlite3.SQLITE_CORRUPT  # text whose bytes were damaged; the driver has no code for it
    known = _ERRORS.get(code & 0xFF) if isinstance(code, int) else None
    if known is None:
        return None
    kind, sentence = known
    return kind(f"{sentence} (database {path.name})")


@contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """What the disk and SQLite say about a file, outside of a session, as errors of the domain. Raises StorageError."""
    try:
        yield
    except sqlite3.Error as error:
        known = domain_error(error, path)
        if known is None:
            raise
        raise known from error
    except OSError as error:
        kind, sentence = _ERRORS[_DISK.get(error.errno or 0, sqlite3.SQLITE_IOERR)]
        raise kind(f"{sentence} ({path.name}: {error.strerror or error})") from error


_DISK: Final = {
    errno.ENOSPC: sqlite3.SQLITE_FULL,
    errno.EDQUOT: sqlite3.SQLITE_FULL,
    errno.EROFS: sqlite3.SQLITE_READONLY,
    errno.EACCES: sqlite3.SQLITE_READONLY,
}
BUSY: Final = "Another process is writing for longer than the busy timeout; nothing was stored, try again shortly."
_ERRORS: Final[dict[int, tuple[type[errors.StorageError], str]]] = {
    sqlite3.SQLITE_FULL: (
        errors.StorageFull,
        "The disk is full: nothing of this request was stored, what was stored before is intact. "
        "Free some space and send it again.",
    ),
    sqlite3.SQLITE_READONLY: (
        errors.StorageReadOnly,
        "The database cannot be written: nothing was stored. Make the file and its folder writable for the service.",
    ),
    sqlite3.SQLITE_PERM: (errors.StorageUnavailable, "The database file may not be opened; check its permissions."),
    sqlite3.SQLITE_BUSY: (errors.StorageBusy, BUSY),
    sqlite3.SQLITE_LOCKED: (errors.StorageBusy, BUSY),
    sqlite3.SQLITE_IOERR: (errors.StorageUnavailable, "The disk reports an error; check it before writing more."),
    sqlite3.SQLITE_CORRUPT: (
        errors.StorageDamaged,
        "The database file is damaged. Stop the service, run `urquhart db check`, and restore a backup "
        "if it confirms this.",
    ),
    sqlite3.SQLITE_NOTADB: (
        errors.NotADatabase,
        "The file is not a SQLite database and is left as it is. Give another path.",
    ),
    sqlite3.SQLITE_CANTOPEN: (
        errors.StorageUnavailable,
        "The database cannot be opened: its folder must exist and the service must be allowed to write there.",
    ),
}
