"""Progress of the compiler while kernels are compiled, which takes most of a minute at the first start."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import urquhart
from urquhart._kernel import count_kernels

_PATIENCE: Final = 2.0
"""Seconds before anything is said: loading all kernels from the cache takes less."""
_EVERY: Final = 5.0
"""Seconds between two reports."""


def warm_up(say: Callable[[str], object]) -> None:
    """Compile the kernels of the method, or load them from the cache, and `say` how far that is unless it is quick."""
    with reports(say):
        urquhart.warm_up(urquhart.Config())


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
    say("compiling the kernels, which takes about a minute, only at the first start")
    while not done.wait(_EVERY):
        ready, count = count_kernels()
        left = (time.monotonic() - began) * (count - ready) / max(ready, 1)
        say(f"compiling the kernels: {ready} of {count}, about {left:.0f} s left")
    say(f"kernels compiled in {time.monotonic() - began:.0f} s")
