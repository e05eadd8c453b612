"""Signal handlers of commands."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def handled(handler: Callable[[int], object], *numbers: signal.Signals) -> Iterator[None]:
    """Call `handler` with the number of each of these signals within the block. Restores the former handlers."""

    def handle(number: int, frame: FrameType | None) -> None:
        handler(number)

    before = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)
