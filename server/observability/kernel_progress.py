"""Progress of the compiler while kernels are compiled, which takes half a minute at the first start."""

import atexit
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import urquhart
from urquhart._kernel import are_cached, count_kernels
from urquhart.warming import warm_up_paper

_PATIENCE: Final = 2.0
"""Seconds before anything is said: loading all kernels from the cache takes less."""
_EVERY: Final = 5.0
"""Seconds between two reports."""


def warm_up(say: Callable[[str], object], *, alone: bool = True) -> Callable[[], None]:
    """Compile the kernels of the default method, or load them from the cache, and `say` how far that is unless it is
    quick.

    `alone`: let a second process compile at the same time, because no other one does.

    Returns:
        What loads the kernels of `method="paper"`, which fewer queries need.
    """
    second = start_second_process() if alone else None
    with reports(say):
        urquhart.warm_up(urquhart.Config())

    def load_the_others() -> None:
        if second is not None:
            second.wait()
        warm_up_paper(urquhart.Config())

    return load_the_others


def start_second_process() -> subprocess.Popen[bytes] | None:
    """A process that compiles the largest kernels while this one compiles the others, None if all are cached.

    It ends by itself, or with this process. The first start takes about half as long with it.
    """
    if are_cached():
        return None
    # Without the working folder on its path, where something else may have the package's name.
    command = [sys.executable, "-P", "-m", "urquhart.warming"]
    second = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    atexit.register(second.kill)
    return second


@contextmanager
def reports(say: Callable[[str], object]) -> Iterator[None]:
    """Call `say` with the progress of kernels that are compiled within the block, unless it is quick."""
    done = threading.Event()
    reporter = threading.Thread(target=_report, args=(say, done), name="kernel-progress", daemon=True)
    reporter.start()
    try:
        yield
    finally:
        done.set()
        reporter.join()


def _report(say: Callable[[str], object], done: threading.Event) -> None:
    began = time.monotonic()
    if done.wait(_PATIENCE):
        return
    say("compiling the kernels, which takes up to a minute, only at the first start")
    while not done.wait(_EVERY):
        ready, count = count_kernels()
        left = (time.monotonic() - began) * (count - ready) / max(ready, 1)
        say(f"compiling the kernels: {ready} of {count}, about {left:.0f} s left")
    say(f"kernels compiled in {time.monotonic() - began:.0f} s")
