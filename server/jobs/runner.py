"""The thread that runs jobs: it takes them, whichever process left them, and runs them to their end.

Jobs of one key on one collection run in the order they came; keys, and collections of a key, take turns. The runner of
a job holds the collection's file lock, which the kernel releases when the process ends. So if a job is `running` but
its lock is free, its process has ended, and the process that gets the lock resumes it. The lock decides, not a timeout.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from server.errors import DomainError, StorageBusy, StorageError, StorageFull, WorkerLost, forget_frames
from server.jobs.folder import ARRIVING, FILES, FOUND, INPUT, RESULTS, UNPACKED
from server.jobs.running_job import Dismissed, Interrupted, JobContext, JobFunction, RunningJob, Yielded
from server.platform.precedence import give_way_by
from server.platform.thread_limits import pin_threads, run_in_background
from server.problem_types import INTERNAL, document
from server.store.service_records import JobChanges, Queue
from urquhart import Abandoned, Budget

_LOOK: Final = 0.5
"""Seconds between two checks for jobs that other processes accepted."""
_CLEAN_UP_SECONDS: Final = 600.0
_PATIENCE: Final = 3.0
"""Seconds that the job in progress has to stop when the service stops."""
_LONGEST_PAUSE: Final = 60.0
"""Seconds between two checks while they fail."""
_STARTS: Final = 5
"""Starts of a job that end its process, or a worker's, before the job is given up."""
_log = logging.getLogger(__name__)


class Runner:
    """Runs the jobs of a database, one at a time in this process."""

    def __init__(self, context: JobContext, job_types: Mapping[str, JobFunction]) -> None:
        self._context, self._job_types = context, job_types
        self._stopping, self._news = threading.Event(), threading.Event()
        self._cleaned_up = -_CLEAN_UP_SECONDS
        self._thread: threading.Thread | None = None
        self._pace = context.precedence.pace()
        self._budget = Budget()
        self._turns = 0
        self._served: dict[Queue | str, int] = {}

    def start(self) -> None:
        """Start in the background."""
        if self._context.database.read_only:
            return
        self._stopping.clear()
        self._budget = Budget(give_way=self._pace)
        self._thread = threading.Thread(target=self._run, name="jobs", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Check at once: a job was accepted or cancelled."""
        self._news.set()

    def hand_back(self) -> None:
        """Tell the job in progress to stop soon. It continues when a service is started again.

        A job that writes segments also stops when `stopping` of the indexes is set. Set that first.
        """
        self._stopping.set()
        self._budget.abandon()
        self._news.set()

    def stop(self) -> None:
        """Hand back the job in progress and wait until that is done, for a limited time; otherwise its lock does it."""
        self.hand_back()
        if self._thread is not None:
            self._thread.join(_PATIENCE)

    def _run(self) -> None:
        pin_threads()
        run_in_background()
        give_way_by(self._pace)
        pause = _LOOK
        while not self._stopping.is_set():
            try:
                busy, pause = self.run_once(), _LOOK
                if time.monotonic() - self._cleaned_up >= _CLEAN_UP_SECONDS:
                    self._cleaned_up = time.monotonic()
                    self.clean_up()
            except Exception:  # noqa: BLE001  a thread that ended would leave all jobs undone, and nobody would know
                _log.exception("jobs cannot be looked at; trying again")
                busy, pause = False, min(2.0 * pause, _LONGEST_PAUSE)
            if not busy:
                self._news.wait(pause)
                self._news.clear()

    def run_once(self) -> bool:
        """Give the next job that no other process runs its turn. Returns whether a job made progress.

        Callers take turns, and so do the collections of one caller: however many jobs a caller has, another's job waits
        for one turn of each caller.
        """
        with self._context.database.read() as tx:
            queues = tx.jobs.queues()
        callers = {queue.caller for queue in queues}
        self._served = {one: turn for one, turn in self._served.items() if one in callers or one in queues}
        for queue in sorted(queues, key=self._last_served):
            with self._context.folder.turn(queue.collection_key) as ours:
                if ours and self._take(queue):
                    return True
            if self._stopping.is_set():
                return False
        return False

    def _last_served(self, queue: Queue) -> tuple[int, int]:
        return self._served.get(queue.caller, 0), self._served.get(queue, 0)

    def clean_up(self) -> None:
        """Delete the files of jobs that finished long ago, and rows beyond those that are kept.

        Raises OSError and StorageError.
        """
        with self._context.database.read() as tx:
            surplus = tx.jobs.surplus(self._context.settings.jobs.keep_jobs)
        if surplus:
            with self._context.database.write() as tx:
                tx.jobs.remove(surplus)
        self._context.folder.clean_up(self._unwanted)

    def _unwanted(self, paths: Sequence[Path]) -> list[Path]:
        since = datetime.now(UTC) - timedelta(days=self._context.settings.jobs.keep_days)
        with self._context.database.read() as tx:
            unfinished, with_results = tx.jobs.unfinished_ids(), tx.jobs.with_results(since)
        wanted = {INPUT: unfinished, FOUND: unfinished, UNPACKED: unfinished, ARRIVING: set[str]()}
        wanted |= {RESULTS: with_results, FILES: with_results}
        return [path for path in paths if path.suffix in wanted and path.stem not in wanted[path.suffix]]

    def _take(self, queue: Queue) -> bool:
        self._turns += 1
        self._served[queue.caller] = self._served[queue] = self._turns
        with self._context.database.write() as tx:
            jobs = tx.jobs
            row = jobs.next(queue)
            if row is None:
                return False
            starts = int(row.progress.get("starts", 0)) + 1
            changes: JobChanges = {
                "state": "running",
                "started": row.started or datetime.now(UTC),
                "progress": {**row.progress, "starts": starts},
            }
            jobs.change(row.id, **changes)
            row = replace(row, **changes)
            turn = self._context.settings.jobs.slice_seconds
            job = RunningJob(row, self._context.database, self._stopping, turn, self._budget)
            dismissed = row.dismissed
        if dismissed:
            self._finish(row.id, "dismissed")
        elif starts > _STARTS:
            self._finish(row.id, "failed", _given_up(starts))
        else:
            return self._do(row.kind, job)
        return True

    def _do(self, kind: str, job: RunningJob) -> bool:
        """Run a job to its end, or as far as possible now. Returns whether it has ended or had its turn."""
        try:
            self._job_types[kind](job, self._context)
        except Yielded:
            self._put_back(job.id, starts=-1)
            return True
        except (Interrupted, Abandoned):
            self._put_back(job.id, starts=-1)
            return False
        except Dismissed:
            self._finish(job.id, "dismissed")
        except (StorageBusy, WorkerLost) as error:
            _log.warning("job %s (%s) will be continued later: %s", job.id, kind, error)
            # A busy database will be free; what ended a process may end another one.
            self._put_back(job.id, starts=0 if isinstance(error, WorkerLost) else -1)
            return False
        except DomainError as error:
            _log.warning("job %s (%s) failed: %s", job.id, kind, error)
            forget_frames(error)
            self._finish(job.id, "failed", document(error))
        except Exception:  # noqa: BLE001  whatever happens to one job, the others are done
            _log.exception("job %s (%s) failed", job.id, kind)
            self._finish(job.id, "failed", _internal("The log of the service tells why."))
        else:
            self._finish(job.id, "successful")
        return True

    def _finish(self, job_id: str, state: str, problem: dict[str, Any] | None = None) -> None:
        def note() -> None:
            with self._context.database.write() as tx:
                changes: JobChanges = {"state": state, "finished": datetime.now(UTC)}
                if state != "dismissed":  # whoever cancelled it may have stored a reason
                    changes["problem"] = problem
                tx.jobs.change(job_id, **changes)

        def make_room() -> None:
            self._context.folder.clear(job_id)

        # Until the outcome is stored, another process may resume the job. It finds that nothing is left to do, or fails
        # because the upload is missing, which does no harm. On a full disk, the upload may be what leaves no room for
        # the outcome.
        if _persistently(note, self._stopping, make_room):
            make_room()

    def _put_back(self, job_id: str, starts: int) -> None:
        """Leave a job to the next runner, with this many more starts on its count."""

        def note() -> None:
            with self._context.database.write() as tx:
                jobs = tx.jobs
                # The job's progress may be from a transaction that was undone.
                if (row := jobs.get(job_id)) is not None:
                    count = max(int(row.progress.get("starts", 0)) + starts, 0)
                    jobs.change(job_id, state="accepted", progress={**row.progress, "starts": count})

        _persistently(note, self._stopping)


def _persistently(
    note: Callable[[], None], stopping: threading.Event, make_room: Callable[[], None] | None = None
) -> bool:
    """Store the outcome of a job, again and again while the database is full or busy. Returns whether it is stored."""
    while True:
        try:
            note()
        except StorageError as error:
            _log.warning("the outcome of a job cannot be stored yet: %s", error)
            if make_room is not None and isinstance(error, StorageFull):
                make_room()
            if stopping.wait(1.0):
                return False  # another runner takes it, finds nothing left to do, and ends it
        else:
            return True


def _given_up(starts: int) -> dict[str, Any]:
    return _internal(
        f"It was begun {starts - 1} times, each time a process ended, and it never got on; perhaps memory is short."
    )


def _internal(detail: str) -> dict[str, Any]:
    kind = INTERNAL
    return {"type": f"/problems/{kind.slug}", "title": kind.title, "status": kind.status, "detail": detail}
