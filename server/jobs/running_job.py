"""A job as its runner sees it: its progress, and when it must stop or give way."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from server.config.settings import Settings
from server.errors import NotFound
from server.index.live_indexes import LiveIndexes
from server.jobs.folder import JobFolder
from server.observability.metrics import Metrics
from server.platform.precedence import Precedence
from server.store.records import CollectionRecord
from server.store.service_records import JobRecord, Queue
from server.store.storage import ReadTransaction, Storage, WriteTransaction
from urquhart import Budget

_CHANCES: Final = 2
"""Starts of a job without progress after which it is assumed to end its processes. A service that is killed soon after
its start says nothing about its jobs, and an isolated process takes seconds to start.
"""


class Interrupted(Exception):
    """The service stops. The job continues another time."""


class Yielded(Exception):
    """The job's turn is over, and another job waits."""


class Dismissed(Exception):
    """Somebody cancelled the job."""


@dataclass(frozen=True, slots=True)
class JobContext:
    """What jobs need from the service. `precedence`: of the requests that jobs give way to."""

    settings: Settings
    database: Storage
    indexes: LiveIndexes
    metrics: Metrics
    folder: JobFolder
    precedence: Precedence = field(default_factory=Precedence)


class JobFunction(Protocol):
    """The function of a type of job: it does a job from where it stands to its end.

    It calls `job.report` regularly, best in the transaction of what it reports. `report` raises if the job must
    stop, which undoes that transaction. Where the job could continue another time, it then calls
    `job.yield_turn`. It keeps what it needs after a restart in `progress`. A `DomainError` that it raises
    becomes the reason why the job failed.
    """

    def __call__(self, job: "RunningJob", context: JobContext) -> None: ...


class RunningJob:
    """A job as its runner sees it."""

    def __init__(
        self, row: JobRecord, database: Storage, stopping: threading.Event, turn: float, budget: Budget
    ) -> None:
        """`budget` is abandoned when the service stops. Long work checks it and may raise Abandoned."""
        self.budget = budget
        self._queue, self._turn = Queue(row.caller, row.collection_key), turn
        self.id, self.collection_id, self.collection_key = row.id, row.collection_id, row.collection_key
        self.parameters: Mapping[str, Any] = row.parameters
        self.total, self.done, self.counts = row.total, row.done, dict(row.counts)
        self.progress: dict[str, Any] = dict(row.progress)
        self._database, self._stopping = database, stopping
        self._is_suspect = int(row.progress.get("starts", 0)) > _CHANCES
        self._reported = time.monotonic()
        self._began, self._before = self._reported, float(row.progress.get("worked", 0.0))

    def collection(self, tx: ReadTransaction) -> CollectionRecord:
        """The collection of the job. Raises NotFound, also if another collection has its name by now."""
        collection = tx.collections.get(self.collection_id)
        if collection is None or collection.key != self.collection_key:
            raise NotFound("collection", self.collection_id)
        return collection

    def report(self, tx: WriteTransaction | None = None, **progress: Any) -> None:
        """Store `done`, `total`, `counts` and the progress. Raises Interrupted, Dismissed and StorageError."""
        if self._stopping.is_set():
            raise Interrupted
        self.progress.update(progress, starts=0, worked=self._before + time.monotonic() - self._began)
        self._reported = time.monotonic()
        if tx is not None:
            self._note(tx)
        else:
            with self._database.write() as own:
                self._note(own)

    @property
    def is_suspect(self) -> bool:
        """Whether several processes in a row ended that had started the job, without any progress."""
        return self._is_suspect

    @property
    def since_report(self) -> float:
        """Seconds since the last report."""
        return time.monotonic() - self._reported

    def yield_turn(self) -> None:
        """Raise Yielded if the job's turn is over and a job of another key or collection waits.

        The job continues from its last report. Raises StorageError.
        """
        if time.monotonic() - self._began < self._turn:
            return
        with self._database.read() as tx:
            if tx.jobs.others_wait(self._queue):
                raise Yielded

    def _note(self, tx: WriteTransaction) -> None:
        jobs = tx.jobs
        if jobs.is_dismissed(self.id):
            raise Dismissed
        if self.total is not None:
            # Submaps that are stored in the meantime are included, so there may be more than were counted first.
            self.total = max(self.total, self.done)
        jobs.change(self.id, done=self.done, total=self.total, counts=self.counts, progress=self.progress)
