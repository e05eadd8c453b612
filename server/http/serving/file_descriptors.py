"""The limit of open files: enough for the connections and what they need."""

import logging
import resource
from typing import Final

from server.config.settings import Limits
from server.errors import Conflict

_RESERVE: Final = 256
"""Descriptors for the database (three for each of its connections), segments, jobs, snapshots and the log."""
_EACH: Final = 2
"""Descriptors for a connection: its socket, and a file that is sent or received over it."""
_LEAST: Final = 2
_log = logging.getLogger(__name__)


def reserve_files(limits: Limits) -> Limits:
    """Raise the limit of open files to what `limits.connections` need. Returns the limits that are possible.

    If the system allows fewer files, the service accepts fewer connections and logs that in one line.

    Raises:
        Conflict: not even a few connections are possible.
    """
    needed = _RESERVE + _EACH * limits.connections
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return limits
    connections = (soft - _RESERVE) // _EACH
    if connections < _LEAST:
        raise Conflict(
            f"the process may open only {soft} files and needs at least {_RESERVE + _EACH * _LEAST}: raise the limit "
            "(ulimit -n, LimitNOFILE)"
        )
    _log.warning(
        "the process may open only %d files, so it accepts %d connections instead of %d (limits.connections); raise "
        "the limit of open files (ulimit -n, LimitNOFILE) to %d",
        soft,
        connections,
        limits.connections,
        needed,
    )
    return limits.model_copy(update={"connections": connections})
