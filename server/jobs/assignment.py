"""A job in the hands of who does it: how far it is, and when it has to stop or to give way."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

from sqlalchemy.orm import Session

from server.config.settings import Settings
from server.errors import NotFound
from server.index.catalog import Catalog
from server.jobs.folder import JobFolder
from server.observability.metrics import Metrics
from server.store.repositories.collections import Collections
from server.store.repositories.jobs import Jobs, Queue
from server.store.sqlite.database import Database
from server.store.tables import CollectionRow, JobRow
from urquhart import Budget

_CHANCES: Final = 2
"""Times that a job is begun without getting on before it is taken for what ends the process. A service that is killed
soon after its start says nothing of its jobs, and a process apart takes seconds to start."""


class Interrupted(Exception):
    """The service stops: the job goes on another time."""


class Yielded(Exception):
    """The job had its turn, and another one waits."""


class Dismissed(Exception):
    """Somebody asked for the end of the job."""


@dataclass(frozen=True, slots=True)
class JobContext:
    """What jobs work with."""

    settings: Settings
    database: Database
    catalog: Catalog
    metrics: Metrics
    folder: JobFolder


class JobFunction(Protocol):
    """A kind of job: a function that does one from where it stands to its end.

    It calls `assignment.report` now and then, best in the transaction of what it reports; that raises when it is to
    stop, and undoes that transaction. After that it calls `assignment.give_way`, where it can go on from there another
    time. What it needs to go on after a restart it leaves in `progress`. What it raises
    of `DomainError` is the reason given for the job's failure.
    """

    def __call__(self, assignment: "Assignment", context: JobContext) -> None: ...


class Assignment:
    """A job in the hands of who does it."""

    def __init__(self, row: JobRow, database: Database, stopping: threading.Event, turn: float, budget: Budget) -> None:
        """`budget` is abandoned when the service stops; work that takes long asks it, and may raise Abandoned."""
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

    def collection(self, session: Session) -> CollectionRow:
        """The collection that the job was accepted for. Raises NotFound, also where another has its name by now."""
        collection = Collections(session).get(self.collection_id)
        if collection is None or collection.key != self.collection_key:
            raise NotFound("collection", self.collection_id)
        return collection

    def report(self, session: Session | None = None, **progress: Any) -> None:
        """Note `done`, `total`, `counts` and where to go on. Raises Interrupted, Dismissed and StorageError."""
        if self._stopping.is_set():
            raise Interrupted
        self.progress.update(progress, starts=0, worked=self._before + time.monotonic() - self._began)
        self._reported = time.monotonic()
        if session is not None:
            self._note(session)
        else:
            with self._database.write() as own:
                self._note(own)

    @property
    def is_suspect(self) -> bool:
        """Whether several processes in a row ended that began the job, and none of them got on with it."""
        return self._is_suspect

    @property
    def since_report(self) -> float:
        """Seconds since the last report."""
        return time.monotonic() - self._reported

    def yield_turn(self) -> None:
        """Raise GaveWay when the job's turn is over and a job of another key, or on another collection, waits.

        What was reported is where it goes on. Raises StorageError.
        """
        if time.monotonic() - self._began < self._turn:
            return
        with self._database.read() as session:
            if Jobs(session).others_wait(self._queue):
                raise Yielded

    def _note(self, session: Session) -> None:
        jobs = Jobs(session)
        if jobs.is_dismissed(self.id):
            raise Dismissed
        if self.total is not None:
            # Submaps that others store meanwhile are worked on, too: there is more to do than was counted at first.
            self.total = max(self.total, self.done)
        jobs.change(self.id, done=self.done, total=self.total, counts=self.counts, progress=self.progress)
