"""A write-ahead log that must not be applied to the database at its name any more: it gets another name, for good.

SQLite applies whatever log lies beside a database to it. Where that was overwritten, the log holds changes of the
content that was there before.
"""

from pathlib import Path

Identity = tuple[int, int]
"""Device and inode of a file."""


def identity(path: Path) -> Identity:
    """Device and inode of what lies at a path. Raises OSError."""
    found = path.stat()
    return found.st_dev, found.st_ino


def find(log: Path, wanted: Identity) -> Path | None:
    """Where a log lies that was set aside, by this process or another; None where it was not. Raises OSError."""
    return next((path for path in _others(log) if identity(path) == wanted), None)


def set_aside(log: Path, wanted: Identity) -> Path | None:
    """Rename a log, unless that is done already; its new name, None where it is at neither.

    The log is the file `wanted`, of any length. Raises OSError.
    """
    try:
        if identity(log) == wanted:
            taken = [int(path.name.rpartition("-")[2]) for path in _others(log)]
            log.rename(log.with_name(f"{log.name}.set-aside-{max(taken, default=0) + 1}"))
    except FileNotFoundError:
        pass  # another process was faster
    return find(log, wanted)


def _others(log: Path) -> list[Path]:
    prefix = f"{log.name}.set-aside-"
    beside = [path for path in log.parent.iterdir() if path.name.startswith(prefix)]
    return [path for path in beside if path.name.removeprefix(prefix).isdecimal()]
