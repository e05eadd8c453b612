"""Which connections a call may use: those that its own process, and its own event loop, opened.

A process that forks hands its open sockets to its children. Two processes that send on one socket read each other's
answers, so a child must never send on what it inherited. Connections of an event loop are bound to that loop alike.
"""

import asyncio
import os
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import httpx

Http = TypeVar("Http", httpx.Client, httpx.AsyncClient)


class Pools(Generic[Http]):
    """An HTTP client for each place that calls come from, made at the first call from there.

    No lock guards the table: a lock that another thread held at the moment of a fork would stay locked in the child.
    """

    def __init__(self, make: Callable[[], Http], place: Callable[[], Hashable], *, shared: bool) -> None:
        """`make` opens a client, `place` says where the caller is.

        `shared`: every client that `make` returns sends through one transport, which cannot be opened again.
        """
        self._make: Callable[[], Http] = make
        self._place = place
        self._owner = os.getpid() if shared else None
        self._open: dict[Hashable, Http] = {}
        self._is_closed = False

    def here(self) -> Http:
        """The client of the calling process and loop. Raises RuntimeError where there cannot be one."""
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
            # Two threads may both get here; `setdefault` is atomic and gives both the same one.
            found = self._open.setdefault(place, self._make())
        return found

    def close(self) -> Http | None:
        """Let nobody send any more. The client of the calling process and loop, which the caller closes."""
        self._is_closed = True
        self._forget_ended_loops()
        return self._open.pop(self._place(), None)

    def _forget_ended_loops(self) -> None:
        # Only loops of this process: what was inherited is kept as it is, because to end it is the parent's business.
        for place in list(self._open):
            loop = place[-1] if isinstance(place, tuple) and place[:2] == this_process() else None
            if isinstance(loop, asyncio.AbstractEventLoop) and loop.is_closed():
                self._open.pop(place, None)


def this_process() -> tuple[int, int]:
    """Where a call of the blocking client comes from."""
    # Both: a fork that Python does not see changes the one, a process id that is used again does not change the other.
    return os.getpid(), _forks


def this_loop() -> tuple[int, int, asyncio.AbstractEventLoop]:
    """Where a call of the awaiting client comes from: a process, and an event loop in it."""
    return (*this_process(), asyncio.get_running_loop())


_forks = 0


def _count_fork() -> None:
    global _forks
    _forks += 1


os.register_at_fork(after_in_child=_count_fork)
