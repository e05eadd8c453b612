"""What the disk reports, as errors of the domain."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from server import errors

FULL: Final = (
    errors.StorageFull,
    "The disk is full: nothing of this request was stored, what was stored before is intact. "
    "Free some space and send it again.",
)
READ_ONLY: Final = (
    errors.StorageReadOnly,
    "The database cannot be written: nothing was stored. Make the file and its folder writable for the service.",
)
BROKEN: Final = (errors.StorageUnavailable, "The disk reports an error; check it before writing more.")
_KNOWN: Final[dict[int | None, tuple[type[errors.StorageError], str]]] = {
    errno.ENOSPC: FULL,
    errno.EDQUOT: FULL,
    errno.EROFS: READ_ONLY,
    errno.EACCES: READ_ONLY,
}


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Raise what the disk says about a file as StorageError."""
    try:
        yield
    except OSError as error:
        kind, sentence = _KNOWN.get(error.errno, BROKEN)
        raise kind(f"{sentence} ({path.name}: {error.strerror or error})") from error
