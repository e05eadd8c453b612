"""Searches of all constraints of a session or of a map, in a process of their own.

GTSAM keeps Python's lock while it optimises, several seconds for 1,000 submaps, and nothing else of the service would
run meanwhile. Few submaps are searched at once, in less time than a process takes to start.
"""

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Final, Self

from server.errors import PosesPending, WorkerLost
from server.platform.isolated_process import IsolatedProcess
from urquhart.mapping.consistency import MAPPING, MappingNumbers
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_graph import PoseConstraints, PoseGraphError

_SMALL: Final = 60
"""Submaps that are searched at once: they take 0.1 to 0.3 s, of which GTSAM keeps the lock for a third."""
SECONDS: Final = 1800.0
"""That a search of a session may take; one of 1,000 submaps takes 4 to 35 s (docs/maps.md)."""
MEMORY: Final = 4 * 1024**3
"""Bytes that a search of a session may allocate; one of 1,000 submaps needs less than a tenth of it."""

Search = Future[OptimisedPoses]


class WholeSearches:
    """Does one search after the other. The process starts at the first one that needs it, and stays."""

    def __init__(self, seconds: float = SECONDS, memory: int | None = MEMORY) -> None:
        """`seconds`, `memory`: what a search may take, and the bytes that it may allocate."""
        self._process, self._seconds = IsolatedProcess(_load, memory), seconds
        self._thread: ThreadPoolExecutor | None = None
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        """Return the searches."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        self.close()

    def begin(self, count: int, constraints: PoseConstraints, numbers: MappingNumbers = MAPPING) -> Search:
        """Begin to search the constraints of `count` submaps. The result raises PoseGraphError, and WorkerLost where
        the process ends early or takes too long.
        """
        if count <= _SMALL:
            done = Search()
            try:
                done.set_result(optimise(count, constraints, numbers))
            except PoseGraphError as error:
                done.set_exception(error)
            return done
        with self._lock:
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, thread_name_prefix="session-poses")
            return self._thread.submit(self._search, count, constraints, numbers)

    def close(self) -> None:
        """End the process, whatever it is doing."""
        with self._lock:
            thread, self._thread = self._thread, None
        self._process.close()
        if thread is not None:
            thread.shutdown(cancel_futures=True)

    def _search(self, count: int, constraints: PoseConstraints, numbers: MappingNumbers) -> OptimisedPoses:
        outcome = self._process.attempt(_optimise, (count, constraints, numbers), self._seconds)
        if outcome.error is not None:
            raise outcome.error
        if outcome.lost is not None:
            raise WorkerLost(f"The poses of {count} submaps were not optimised: {outcome.lost}.")
        found: OptimisedPoses = outcome.result
        return found


def waited(search: Search, seconds: float) -> OptimisedPoses:
    """The result of a search. Raises PosesPending if it takes longer, and what the search raises."""
    try:
        return search.result(max(seconds, 0.0))
    except TimeoutError:
        if search.done():
            raise
        raise PosesPending(
            "All constraints of this session are being searched, which takes longer than a query may. Ask again in a "
            "few seconds; the search goes on.",
            retry_after=2.0,
        ) from None


def _load() -> None:
    """What the process does before its first search: nothing more than importing this module."""


def _optimise(asked: tuple[int, PoseConstraints, MappingNumbers]) -> OptimisedPoses:
    return optimise(*asked)
