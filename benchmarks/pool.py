"""Work shared among processes, one thread each, with a progress bar."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Final, TypeVar

from rich.progress import Progress

Job = TypeVar("Job")
Result = TypeVar("Result")
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class Pool(AbstractContextManager["Pool"]):
    """Worker processes that outlive one experiment; with one worker everything runs in this process."""

    def __init__(self, workers: int, progress: Progress) -> None:
        self._progress = progress
        self._executor: ProcessPoolExecutor | None = None
        if workers > 1:
            # Libraries size their thread pools when they are loaded: children must find the limit in place.
            os.environ.update(dict.fromkeys(_THREADS, "1"))
            self._executor = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)

    def map(self, function: Callable[[Job], Result], jobs: Sequence[Job], title: str) -> list[Result]:
        """Results in the order of `jobs`; `function` must be one that another process can import."""
        task = self._progress.add_task(title, total=len(jobs))
        if self._executor is None:
            results = []
            for job in jobs:
                results.append(function(job))
                self._progress.advance(task)
            return results
        futures: list[Future[Result]] = [self._executor.submit(function, job) for job in jobs]
        for future in as_completed(futures):
            future.result()
            self._progress.advance(task)
        return [future.result() for future in futures]

    def alone(self, title: str, steps: int) -> Callable[[], None]:
        """A bar for work in this process while the others are idle (timings); call the result at each step."""
        task = self._progress.add_task(title, total=steps)
        return lambda: self._progress.advance(task)
