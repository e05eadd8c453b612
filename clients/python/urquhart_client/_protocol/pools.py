"""The connections that a call may use: only those that its own process and its own event loop have opened.

A process that forks shares its open sockets with its children. Two processes that use one socket read each other's
answers, so a child must never use an inherited one. Connections of an event loop are bound to that loop in the same
way.
"""

import asyncio
import os
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import httpx

Http = TypeVar("Http", httpx.Client, httpx.AsyncClient)


class Pools(Generic[Http]):
    """One HTTP client for each process and event loop, created at the first call from there.

    No lock guards the table: a lock that another thread held during a fork would stay locked in the child.
    """

    def __init__(self, make: Callable[[], Http], place: Callable[[], Hashable], *, shared: bool) -> None:
        """`make` opens a client; `place` identifies the caller's process and loop.

        `shared`: all clients that `make` returns use one transport, which cannot be opened again.
        """
        self._make: Callable[[], Http] = make
        self._place = place
        self._owner = os.getpid() if shared else None
        self._open: dict[Hashable, Http] = {}
        self._is_closed = False

    def here(self) -> Http:
        """The client of the calling process and loop. Raises RuntimeError if there cannot be one."""
        if self._is_closed:
            raise RuntimeError("the client is closed")
        if self._owner not in (None, os.getpid()):
            raise RuntimeError(
                "a client that was given a transport cannot be used after a fork: make a client in each process"
            )
        place = self._place()
        found = self._open.get(place)
        if found is None:
            self._forget_ended_loops()
            # Two threads may both get here. `setdefault` is atomic and gives both the same client.
            found = self._open.setdefault(place, self._make())
        return found

    def close(self) -> Http | None:
        """Refuse further calls. Returns the client of the calling process and loop, which the caller closes."""
        self._is_closed = True
        self._forget_ended_loops()
        return self._open.pop(self._place(), None)

    def _forget_ended_loops(self) -> None:
        # Only those of this process: inherited connections belong to the parent.
        for place in list(self._open):
            loop = place[-1] if isinstance(place, tuple) and place[:2] == this_process() else None
            if isinstance(loop, asyncio.AbstractEventLoop) and loop.is_closed():
                self._open.pop(place, None)


def this_process() -> tuple[int, int]:
    """The place of a call of the blocking client: its process."""
    # Both, because a fork that Python does not notice changes only the process id, and a reused process id would not
    # change.
    return os.getpid(), _forks


def this_loop() -> tuple[int, int, asyncio.AbstractEventLoop]:
    """The place of a call of the asynchronous client: its process and event loop."""
    return (*this_process(), asyncio.get_running_loop())


_forks = 0


def _count_fork() -> None:
    global _forks
    _forks += 1


os.register_at_fork(after_in_child=_count_fork)
