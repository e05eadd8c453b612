"""Who uses a database file: a lock beside it, shared by all who have the file open, and held exclusively to replace it.

SQLite's own locks come and go with transactions and belong to the file that was opened, not to its name. This one lasts
from the start of a process to its end. The kernel frees it when a process ends, however that comes.
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from server import errors
from server.platform.file_locks import try_lock

_POLL: Final = 0.02
_MAY_NOT_WRITE: Final = frozenset({errno.EACCES, errno.EPERM, errno.EROFS})


def lock_path(database: Path) -> Path:
    """Where the lock of a database file lies. SQLite follows links: all who use the file must meet at one lock."""
    file = database.resolve()
    return file.with_name(f"{file.name}.lock")


def share(database: Path, patience: float, *, read_only: bool = False) -> int | None:
    """Take the lock in shared mode; the open file that holds it, to be closed by `release`.

    None where there is nothing to hold on to: no folder, or one that may not be written and that is only read from.
    Waits up to `patience` seconds for somebody who replaces the file.

    Raises:
        StorageBusy: the file is being replaced.
        OSError: the lock cannot be made.
    """
    path = lock_path(database)
    if not path.parent.is_dir():
        return None  # SQLite says what is wrong with that
    try:
        descriptor = _open(path)
    except OSError as error:
        if read_only and error.errno in _MAY_NOT_WRITE:
            return None
        raise
    deadline = time.monotonic() + patience
    while not try_lock(descriptor, shared=True):
        if time.monotonic() >= deadline:
            os.close(descriptor)
            raise errors.StorageBusy(f"{database.name} is being restored or upgraded; try again when that is done.")
        time.sleep(_POLL)
    return descriptor


def release(descriptor: int) -> None:
    """Release what `share` returned."""
    os.close(descriptor)


@contextmanager
def exclusive(database: Path) -> Iterator[None]:
    """Hold the lock exclusively: nobody else has the file open, or opens it meanwhile.

    Raises:
        Conflict: somebody has it open.
        OSError: the lock cannot be made.
    """
    descriptor = _open(lock_path(database))
    try:
        if not try_lock(descriptor):
            raise errors.Conflict(
                f"{database} is in use: stop the service and every other urquhart command on it, and try again."
            )
        yield
    finally:
        os.close(descriptor)


def _open(path: Path) -> int:
    # To be read is enough for a lock, so that whoever may read the file made by another user can hold it.
    return os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
