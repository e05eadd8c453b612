"""Maintenance of the segments of all collections in the background: flush, merge, check, clean up.

Every process has such a thread. Each task is done by one process at a time; the others see the result in the database's
list of segments and use it.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from server.index.flushing import Progress, Stopped, count_uncovered, flush, flush_state
from server.index.live_index import LiveIndex, UnusableSegment
from server.index.live_indexes import LiveIndexes
from server.index.segment_merging import due, merge
from server.observability.metrics import Metrics
from server.platform.thread_limits import pin_threads, run_in_background
from server.store.records import SegmentRecord
from server.store.storage import Storage
from urquhart.index.collection_index import LiveSegment

_CLEAN_UP_SECONDS: Final = 60.0
"""Seconds between two searches for left-over files and for segments that could not be read."""
_REST: Final = 30.0
"""Pause after a round, as a multiple of its duration: with very many collections, even a round without work is
costly.
"""
_PATIENCE: Final = 300.0
"""Most seconds before a failed task is tried again."""
_AGAIN: Final = 600.0
"""Seconds between two checks of a segment against its checksums."""
_SHARE: Final = 100.0
"""Pause after such a check, as a multiple of its duration."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _FailedTask:
    """A failed task: how often in a row it failed, and when to try again (`time.monotonic`)."""

    cause: str
    times: int
    again: float


class Maintenance:
    """Maintenance of one database's segments, as a thread or at once with `run`."""

    def __init__(self, database: Storage, indexes: LiveIndexes, metrics: Metrics) -> None:
        self._database, self._indexes, self._metrics = database, indexes, metrics
        self._up_to_date: dict[int, tuple[int, tuple[SegmentRecord, ...]]] = {}
        """Revision and segments at which there was nothing to do for a collection, by key."""
        self._checked: dict[str, float] = {}
        """When each segment that is mapped was compared with its checksums last (`time.monotonic`), by name."""
        self._next_check = 0.0
        self._failures: dict[str, _FailedTask] = {}
        self._cleaned_up = -_CLEAN_UP_SECONDS
        self._look_seconds = 0.0
        self._thread: threading.Thread | None = None

    def start(self, ready: threading.Event) -> None:
        """Start maintenance in the background as soon as `ready` is set."""
        self._indexes.stopping.clear()
        self._thread = threading.Thread(target=self._work, args=(ready,), name="maintenance", daemon=True)
        self._thread.start()

    def stop(self, patience: float = 1.0) -> None:
        """Stop maintenance within about `patience` seconds. A merge in progress is given up and done again later."""
        self._indexes.stopping.set()
        if self._thread is not None:
            self._thread.join(patience)

    def run(self) -> bool:
        """Do all due work now. Returns whether nothing is left. Failures are logged and tried again by a later call.

        Raises StorageError if due work cannot be determined. Raises Stopped.
        """
        began = time.monotonic()
        with self._database.read() as tx:
            revisions = tx.collections.revisions(least=1)
            chains = tx.all_segments.chains()
        self._look_seconds = time.monotonic() - began
        for key, collection_id, revision in revisions:
            seen = (revision, chains.get(key, ()))
            if self._up_to_date.get(key) != seen:
                self._up_to_date.pop(key, None)
                if self._try(f"collection {collection_id}", partial(self._tend, collection_id)):
                    self._up_to_date[key] = seen
        there = {key for key, _, _ in revisions}
        self._up_to_date = {key: seen for key, seen in self._up_to_date.items() if key in there}
        self._try("checks of segments", self._check_again)
        if time.monotonic() - self._cleaned_up >= _CLEAN_UP_SECONDS:
            self._cleaned_up = time.monotonic()
            self._try("left-over segments", self._clean_up)
        return len(self._up_to_date) == len(there)

    def flush_and_merge(self, collection_id: str, *, least: int = 1, progress: Progress | None = None) -> int:
        """Write the submaps that are in no segment if there are at least `least`, and do due merges. Returns how many
        were written.

        Raises OSError, StorageError.
        """
        with self._metrics.maintenance("flush"):
            written = flush(self._indexes.flush_context, collection_id, least=least, progress=progress)
        self.merge_all(collection_id)
        return written

    def merge_all(self, collection_id: str) -> None:
        """Do the due merges of a collection. Raises NotFound, OSError, StorageError."""
        with self._indexes.view(collection_id):
            pass
        self._merge(collection_id)

    def _work(self, ready: threading.Event) -> None:
        pin_threads()
        run_in_background()
        while not self._indexes.stopping.wait(
            max(self._indexes.settings.maintenance_seconds, _REST * self._look_seconds)
        ):
            try:
                if ready.is_set():
                    self._try("all collections", self.run)
            except Stopped:
                return

    def _try(self, task: str, work: Callable[[], bool]) -> bool:
        """Do a task unless it failed recently. Returns whether it is done."""
        failure = self._failures.get(task)
        if failure is not None and time.monotonic() < failure.again:
            return False
        try:
            done = work()
        except Stopped:
            raise
        except Exception as error:  # noqa: BLE001  whatever happens to one collection, the others are looked after
            what = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
            cause = f"{type(error).__name__}: {what}"
            times = 1 if failure is None else failure.times + 1
            if failure is None or failure.cause != cause:
                _log.warning("segments, %s: %s; trying again later", task, cause, exc_info=error)
            self._failures[task] = _FailedTask(cause, times, time.monotonic() + min(2.0**times, _PATIENCE))
            return False
        self._failures.pop(task, None)
        return done

    def _tend(self, collection_id: str) -> bool:
        self._indexes.refresh(collection_id)
        done = self._database.read_only or (self._flush(collection_id) and self._merge(collection_id))
        live = self._indexes.live(collection_id)
        if live is not None:
            self._check(live)
        return done

    def _flush(self, collection_id: str) -> bool:
        most = self._indexes.settings.flush_submaps
        if count_uncovered(self._database, collection_id, most + 1) <= most:
            return True
        live = self._indexes.live(collection_id)
        state = live.state if live is not None else None
        with self._metrics.maintenance("flush"):
            if live is not None and state is not None and sum(part.living for part in state.delta) > most // 2:
                written = flush_state(self._indexes.flush_context, live.key, state)
            else:
                written = flush(self._indexes.flush_context, collection_id, least=most + 1, wait=False)
        self._indexes.refresh(collection_id)
        return written > 0

    def _merge(self, collection_id: str) -> bool:
        live = self._indexes.live(collection_id)
        if live is None or live.state is None:
            return True  # nobody has used it in this process
        while (state := live.state) is not None and (runs := due(state)):
            try:
                with self._metrics.maintenance("merge"):
                    if not merge(self._indexes.flush_context, live.key, state, runs[0]):
                        return False
            except UnusableSegment as obstacle:
                self._indexes.quarantine(live, obstacle)
                return False
            self._indexes.refresh(collection_id)
            if live.state is state:
                return False
        return True

    def _check(self, live: LiveIndex) -> None:
        """Check every segment that this process has mapped against its checksums, once."""
        state = live.state
        for listed, part in zip(state.chain, state.files, strict=False) if state is not None else ():
            if listed.name not in self._checked and not self._verify(live, listed, part):
                return

    def _check_again(self) -> bool:
        """Check one segment at a time again and again, because bytes on a disk can change without a write.

        A segment that was checked within `_AGAIN` seconds is skipped, and checks take one hundredth of the time.
        """
        if time.monotonic() < self._next_check:
            return True
        mapped = [
            (live, listed, part)
            for live in self._indexes.all_live()
            if (state := live.state) is not None
            for listed, part in zip(state.chain, state.files, strict=False)
        ]
        names = {listed.name for _, listed, _ in mapped}
        self._checked = {name: at for name, at in self._checked.items() if name in names}
        due = [one for one in mapped if self._checked.get(one[1].name, 0.0) < time.monotonic() - _AGAIN]
        if due:
            began = time.monotonic()
            self._verify(*min(due, key=lambda one: self._checked.get(one[1].name, 0.0)))
            self._next_check = time.monotonic() + _SHARE * (time.monotonic() - began)
        return True

    def _verify(self, live: LiveIndex, listed: SegmentRecord, part: LiveSegment) -> bool:
        self._indexes.flush_context.check()
        with self._metrics.maintenance("check"):
            sound = self._indexes.verify(live, listed, part)
        self._checked[listed.name] = time.monotonic()
        return sound

    def _clean_up(self) -> bool:
        for live in self._indexes.all_live():
            if live.left_out:
                live.left_out.clear()
                self._indexes.refresh(live.id)
        self._up_to_date.clear()
        if not self._database.read_only:
            with self._metrics.maintenance("clean_up"):
                self._indexes.folder.clean_up()
        return True
