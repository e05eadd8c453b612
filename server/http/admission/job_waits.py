"""Callers that wait for the end of a job: a limited number, with one database query for all of them."""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable
from typing import Final

import anyio
import anyio.to_thread

from server.config.settings import Limits
from server.errors import StorageError
from server.http.admission.request_admission import Admission
from server.jobs import queue
from server.store.storage import Storage

_LOOK: Final = 0.2
"""Seconds between two queries for the jobs that callers wait for."""
_READERS: Final = 4
"""Number of callers whose job is read at the same time after their wait, so that they do not take all threads."""
_log = logging.getLogger(__name__)


class JobWaits:
    """The waits of one process, on its event loop."""

    def __init__(self, database: Storage, limits: Limits, is_stopping: Callable[[], bool]) -> None:
        self._database, self._limits, self._is_stopping = database, limits, is_stopping
        self._waiting: dict[str, set[asyncio.Event]] = {}
        self._callers: Counter[str] = Counter()
        self._poller: asyncio.Task[None] | None = None
        self.readers = anyio.Semaphore(_READERS)

    @property
    def count(self) -> int:
        """Number of callers that wait."""
        return self._callers.total()

    async def until_finished(self, job_id: str, seconds: float, request: Admission) -> None:
        """Wait for the end of a job for at most `seconds`, and only while the caller is there.

        Returns at once if `limits.job_waits` callers wait already, or `limits.key_job_waits` of the same key or
        address.
        """
        name = request.name
        if self.count >= self._limits.job_waits or self._callers[name] >= self._limits.key_job_waits:
            return
        over, finished = asyncio.create_task(request.over()), asyncio.Event()
        ended = asyncio.create_task(finished.wait())
        self._callers[name] += 1
        self._waiting.setdefault(job_id, set()).add(finished)
        if self._poller is None or self._poller.done():
            self._poller = asyncio.create_task(self._poll())
        try:
            await asyncio.wait({over, ended}, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        finally:
            over.cancel()
            ended.cancel()
            self._callers[name] -= 1
            self._callers += Counter()  # drops jobs that nobody waits for any more
            waiting = self._waiting.get(job_id, set())
            waiting.discard(finished)
            if not waiting:
                self._waiting.pop(job_id, None)

    async def _poll(self) -> None:
        while self._waiting:
            await asyncio.sleep(_LOOK)
            known = list(self._waiting)
            try:
                unfinished = await anyio.to_thread.run_sync(queue.unfinished, self._database, known)
            except StorageError as error:
                _log.debug("jobs that are waited for cannot be looked at: %s", error)
                unfinished = set()  # each caller reads its job and gets the error
            for job_id in known:
                if job_id not in unfinished or self._is_stopping():
                    for finished in self._waiting.get(job_id, ()):
                        finished.set()
