"""Searches of all constraints of a session, in a process of their own.

GTSAM keeps Python's lock while it optimises, several seconds for 1,000 submaps, and nothing else of the service would
run meanwhile. Small sessions are searched at once, in less time than a process takes to start.
"""

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from server.errors import PosesPending, WorkerLost
from server.platform.isolated_process import IsolatedProcess
from urquhart.mapping.optimisation import OptimisedPoses, optimise
from urquhart.mapping.pose_graph import PoseConstraints

_SMALL: Final = 60
"""Submaps that are searched at once: they take 0.1 to 0.3 s, of which GTSAM keeps the lock for a third."""
_SECONDS: Final = 1800.0
"""That a search may take; one of 1,000 submaps takes 4 to 35 s (docs/maps.md)."""

Search = Future[OptimisedPoses]


class WholeSearches:
    """Does one search after the other. The process starts at the first one that needs it, and stays."""

    def __init__(self) -> None:
        self._process = IsolatedProcess(_load)
        self._thread: ThreadPoolExecutor | None = None
        self._lock = threading.Lock()

    def begin(self, count: int, constraints: PoseConstraints) -> Search:
        """Begin to search the constraints of `count` submaps. The result raises WorkerLost where the process ends early
        or takes too long.
        """
        if count <= _SMALL:
            done = Search()
            done.set_result(optimise(count, constraints))
            return done
        with self._lock:
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, thread_name_prefix="session-poses")
            return self._thread.submit(self._search, count, constraints)

    def close(self) -> None:
        """End the process, whatever it is doing."""
        with self._lock:
            thread, self._thread = self._thread, None
        self._process.close()
        if thread is not None:
            thread.shutdown(cancel_futures=True)

    def _search(self, count: int, constraints: PoseConstraints) -> OptimisedPoses:
        outcome = self._process.attempt(_optimise, (count, constraints), _SECONDS)
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


def _optimise(asked: tuple[int, PoseConstraints]) -> OptimisedPoses:
    return optimise(*asked)
