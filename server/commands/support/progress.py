"""Progress of long work: a bar on a terminal; lines elsewhere, so that a log shows that the work goes on."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

_FIRST: Final = 1.0
"""Seconds of work before the first line. Shorter work leaves no line in a log."""
_EVERY: Final = 5.0
"""Seconds between lines."""
_LARGE: Final = 4_000_000
"""Bytes of a file that may take more than a second to read."""


class _Rate(ProgressColumn):
    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g} {self._unit}/s")


class ProgressReport:
    """Tells how far work is. Counted work is a `task`; work of unknown length is `busy`."""

    def __init__(self, console: Console, unit: str) -> None:
        """`console`: where to tell it; `unit`: what is counted, in the plural."""
        self._console, self._unit = console, unit
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(unit),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,  # otherwise it leaves an empty line in every log
        )

    def task(self, what: str, total: int | None) -> Callable[[int], None]:
        """Begin to count `what`, up to `total` if that is known; what is returned is called with each advance."""
        if self._console.is_terminal:
            bar = self._bar.add_task(what, total=total)
            return lambda count: self._bar.advance(bar, count)
        began, told, done = time.monotonic(), time.monotonic() + _FIRST - _EVERY, 0

        def advance(count: int) -> None:
            nonlocal told, done
            done += count
            now = time.monotonic()
            if now - told >= _EVERY:
                told = now
                self._line(f"{what}: {_counted(done, total, self._unit, now - began)}")

        return advance

    @contextmanager
    def busy(self, what: str) -> Iterator[None]:
        """Tell that `what` goes on, from its first second to the end of the block."""
        if self._console.is_terminal:
            bar = self._bar.add_task(what, total=None)
            try:
                yield
            finally:
                self._bar.remove_task(bar)
            return
        ended = threading.Event()

        def tell() -> None:
            wait, began = _FIRST, time.monotonic()
            while not ended.wait(wait):
                wait = _EVERY
                self._line(f"{what}: {time.monotonic() - began:.0f} s")

        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            yield
        finally:
            ended.set()
            teller.join()

    def _line(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def __enter__(self) -> "ProgressReport":
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()


def _counted(done: int, total: int | None, unit: str, seconds: float) -> str:
    if total is None:
        return f"{done} {unit}"
    left = f", about {_duration((total - done) * seconds / done)} left" if 0 < done < total else ""
    return f"{done} of {total} {unit}{left}"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def reading(path: Path, console: Console | None = None) -> AbstractContextManager[None]:
    """Tell, within the block, that a file is read, if it is large; by default on standard error."""
    try:
        size = path.stat().st_size
    except OSError:
        size = 0
    if size < _LARGE:
        return nullcontext()
    return _reading(path, size, console or Console(stderr=True))


@contextmanager
def _reading(path: Path, size: int, console: Console) -> Iterator[None]:
    with ProgressReport(console, "files") as progress, progress.busy(f"reading {path.name}, {size / 1e6:.0f} MB"):
        yield
