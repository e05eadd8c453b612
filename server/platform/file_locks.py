"""Locks on open files. The kernel releases them when a process ends, however it ends."""

import fcntl
from typing import IO, Any


def try_lock(file: IO[Any] | int, *, shared: bool = False) -> bool:
    """Lock an open file until it is closed, exclusively or shared. Returns whether the lock was free."""
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
