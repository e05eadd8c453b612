"""What SQLite and the disk report, in the words of the domain."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from server import errors
from server.platform.disk_errors import BROKEN, FULL, READ_ONLY, disk_errors


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
    """Raise what the disk and SQLite say about a file, outside of a transaction, as StorageError."""
    try:
        with disk_errors(path):
            yield
    except sqlite3.Error as error:
        known = domain_error(error, path)
        if known is None:
            raise
        raise known from error


BUSY: Final = "Another process is writing for longer than the busy timeout; nothing was stored, try again shortly."
_ERRORS: Final[dict[int, tuple[type[errors.StorageError], str]]] = {
    sqlite3.SQLITE_FULL: FULL,
    sqlite3.SQLITE_READONLY: READ_ONLY,
    sqlite3.SQLITE_PERM: (errors.StorageUnavailable, "The database file may not be opened; check its permissions."),
    sqlite3.SQLITE_BUSY: (errors.StorageBusy, BUSY),
    sqlite3.SQLITE_LOCKED: (errors.StorageBusy, BUSY),
    sqlite3.SQLITE_IOERR: BROKEN,
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
