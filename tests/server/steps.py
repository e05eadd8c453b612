"""A process that is killed at the n-th thing it does to a file, for every n."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any

_EVENTS = frozenset(
    {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "fcntl.flock", "sqlite3.connect"}
)


def killed_at_every_step(work: Callable[[], Any], *, most: int = 400) -> Iterator[int]:
    """Do `work` in a process of its own, killed (SIGKILL) at its first step, its second, ...; until it gets through.

    Yields after each of them how many steps it got.
    """
    for step in range(1, most):
        process = multiprocessing.get_context("fork").Process(target=_run, args=(work, step), daemon=True)
        process.start()
        process.join()
        assert process.exitcode in (0, -signal.SIGKILL), process.exitcode
        yield step
        if process.exitcode == 0:
            return
    raise AssertionError("it never got through")


def _run(work: Callable[[], Any], left: int) -> None:
    def count(name: str, _: tuple[Any, ...]) -> None:
        nonlocal left
        if name in _EVENTS:
            left -= 1
            if left <= 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(count)
    work()
    left = sys.maxsize
