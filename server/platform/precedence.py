"""Short requests go first: few work at a time, and long work pauses while a short request is in progress."""

import asyncio
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

_SHORT: Final = 0.05
"""Seconds of work after which a request is no longer short. A query takes a tenth of that."""
_LONGEST: Final = 0.02
"""Most seconds of one pause."""

_pace: ContextVar["Pace | None"] = ContextVar("pace", default=None)
"""Of the request or job that this thread works for. The threads of a request inherit it."""


def give_way() -> None:
    """Pause if the work of this thread is long and a short request is in progress.

    For work that has no budget, such as reading a large body or the lines of an import.
    """
    pace = _pace.get()
    if pace is not None:
        pace()


@contextmanager
def turn() -> Iterator[None]:
    """Wait until few enough others work, and work. For what keeps a core busy, such as a search.

    A thread that waits here must hold no lock that a working thread may want.
    """
    pace = _pace.get()
    if pace is None:
        yield
        return
    began = pace.begin()
    try:
        yield
    finally:
        if began:
            pace.end()


def give_way_by(pace: "Pace") -> None:
    """Set what `give_way` and `turn` go by from now on in this context."""
    _pace.set(pace)


class Precedence:
    """The requests in progress in this process, by the time when each began to work, and turns at the processor.

    On a few cores, long work would otherwise delay every small request several times: they share the cores, their
    caches and the interpreter. Without pauses, p99 of other callers beside a crowd of slow queries is 45 ms instead of
    33 ms, and beside constraints jobs 43 ms instead of 36 ms (`python -m benchmarks.reliability --only exhaustion`).
    And more threads than cores that want the interpreter cost more than they do: 32 clients got 50 answers a second
    with as many searches at a time as there were places, at 26 ms of processor time each, and 90 with one for each
    core, at 14 ms (`python -m benchmarks.service --only crowd`).
    """

    def __init__(self, turns: int | None = None) -> None:
        """`turns`: requests that may work at the same time; None for one on each core."""
        self._began: dict[int, float] = {}
        self._turns = threading.Semaphore(turns or len(os.sched_getaffinity(0)))
        self._changed = threading.Condition()

    def enter(self, request: object) -> None:
        """A request begins to work."""
        with self._changed:
            self._began[id(request)] = time.monotonic()

    def leave(self, request: object) -> None:
        """A request is done, or gives its place back. Does nothing if it never entered."""
        with self._changed:
            if self._began.pop(id(request), None) is not None and not self._has_short(time.monotonic()):
                self._changed.notify_all()

    def pace(self, request: object | None = None) -> "Pace":
        """What the work for a request, or for a job, goes by."""
        return Pace(self, request)

    def take_turn(self, request: object) -> None:
        """Wait for a turn. The work of the request begins now: it has only waited before."""
        self._turns.acquire()
        with self._changed:
            if id(request) in self._began:
                self._began[id(request)] = time.monotonic()

    def return_turn(self) -> None:
        """Let the next one work."""
        self._turns.release()

    def is_short(self, request: object, now: float) -> bool:
        """Whether a request has not worked for long yet; also one that has not entered."""
        return now - self._began.get(id(request), now) < _SHORT

    def wait_for_short_ones(self, until: float) -> None:
        """Wait while a short request is in progress, at most until then."""
        with self._changed:
            while (now := time.monotonic()) < until and self._has_short(now):
                self._wait(until - now)

    def _has_short(self, now: float) -> bool:
        return any(now - began < _SHORT for began in self._began.values())

    def _wait(self, seconds: float) -> None:
        self._changed.wait(seconds)


class Pace:
    """How the work for one request or job shares the cores with others. One thread works for it at a time."""

    def __init__(self, precedence: Precedence, request: object | None) -> None:
        """`request`: for whom the work is done. It is long once the request is no longer short; without a request, as
        in a job, it always is, and takes no turns."""
        self._precedence, self._request = precedence, request
        self._since = time.monotonic()
        self._has_turn = False

    def __call__(self) -> None:
        """Called regularly by long work, on its own thread. Returns after the pause, if there is one.

        No pause is longer than the work since the last one, so long work keeps at least half of its speed.
        """
        now = time.monotonic()
        if self._request is not None and self._precedence.is_short(self._request, now):
            return
        if _on_event_loop():
            return  # a pause here would stop the very request that it is for
        self.end()
        self._precedence.wait_for_short_ones(now + min(now - self._since, _LONGEST))
        self._since = time.monotonic()

    def begin(self) -> bool:
        """Wait for a turn. False if there is no need: it has one, or it is a job."""
        if self._request is None or self._has_turn or _on_event_loop():
            return False
        self._precedence.take_turn(self._request)
        self._has_turn, self._since = True, time.monotonic()
        return True

    def end(self) -> None:
        """Return the turn, if it has one. Long work does so and goes on without, for others must not wait for it."""
        if self._has_turn:
            self._has_turn = False
            self._precedence.return_turn()


def _on_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
