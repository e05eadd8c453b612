"""Worker processes for computations: started when they are worth it, and ended after use.

Starting a process takes seconds, mostly to load the numerical libraries. So work begins in this process, and others are
started only after it has gone on for a while: short work never waits for them. This process keeps computing whenever it
has nothing else to do.
"""

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Any, Final, Generic, Self, TypeVar

from server.errors import WorkerLost
from server.platform.isolated_process import IsolatedProcess, Outcome
from server.platform.worker_process import attempt, start_worker

_Given = TypeVar("_Given")
_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
_AHEAD: Final = 2
"""Tasks given to each process: one in progress, and one so that it need not wait for the next."""
_LOOK: Final = 1.0
"""Seconds between two checks whether a process has worked on a task for too long."""
PATIENCE: Final = 1.0
"""Seconds of work before processes are started."""


@dataclass(frozen=True, slots=True)
class PoolTask(Generic[_Given, _Task, _Result]):
    """How an input becomes a result, in this process or in another.

    Attributes:
        here: makes the result in this process.
        pack: what is sent to another process.
        there: makes the result of what was sent; a function that the other process can import.
        apart: how to go on where a task ends the process that does it; None where that is an error.
    """

    here: Callable[[_Given], _Result]
    pack: Callable[[_Given], _Task]
    there: Callable[[_Task], _Result]
    apart: "IsolationPolicy[_Given, _Result] | None" = None


@dataclass(frozen=True, slots=True)
class IsolationPolicy(Generic[_Given, _Result]):
    """How a task that is too much for a process is split, so that only the part at fault is refused.

    Attributes:
        is_light: whether it can do no harm, and may be done in this process.
        singles: its parts, to be done one by one.
        refuse: the result of a part that ends the process, or takes too long, and why.
        seconds: that a part may take; a whole task may take twice as many.
    """

    is_light: Callable[[_Given], bool]
    singles: Callable[[_Given], list[_Given]]
    refuse: Callable[[_Given, str], _Result]
    seconds: float


@dataclass(slots=True)
class _Worker:
    process: SpawnProcess
    connection: Connection
    ready: bool = False
    tasks: dict[int, Any] = field(default_factory=dict)
    since: float = 0.0


class ProcessPool:
    """A pool of processes for all that needs one. It can be used again after it was closed.

    Processes are spawned, not forked, so a program that uses them must be importable, with its work behind `if __name__
    == "__main__"`. They end with this process, even if it is killed.
    """

    def __init__(
        self, processes: int | None = None, *, warm_up: Callable[[], object], patience: float = PATIENCE
    ) -> None:
        """Nothing is started yet.

        Args:
            processes: how many compute, this one among them; None for one a core.
            warm_up: called in each process before its first task, to load what it needs.
            patience: seconds of work before processes are started.
        """
        self.processes = processes if processes is not None else _cores()
        self._warm_up = warm_up
        self._patience = patience
        self._spent = 0.0
        self._workers: list[_Worker] = []
        self._sequence = self._first = 0
        self._busy = threading.Lock()
        self._isolated = IsolatedProcess(warm_up)

    def __enter__(self) -> Self:
        """Return the pool."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pool."""
        self.close()

    @property
    def pids(self) -> list[int]:
        """Process ids of the workers."""
        return [worker.process.pid for worker in self._workers if worker.process.pid is not None]

    def close(self) -> None:
        """End the processes, whatever they are doing. No `map` may be in progress."""
        workers, self._workers = self._workers, []
        self._isolated.close()
        for worker in workers:
            worker.process.terminate()
            worker.connection.close()
        for worker in workers:
            worker.process.join()
            worker.process.close()

    def map(self, work: PoolTask[_Given, _Task, _Result], given: Iterable[_Given]) -> Generator[_Result, None, None]:
        """Results in the order of the inputs, of which only a few are taken in advance.

        If `given` ends with an exception, it is raised after the results of all inputs before it. While another thread
        uses the processes, this one does everything itself.

        Raises WorkerLost if a process ends early and `work` cannot be split, and what `work` raises.
        """
        if not self._busy.acquire(blocking=False):
            yield from map(work.here, given)
            return
        try:
            yield from self._map(work, _TaskSource(given))
        finally:
            self._busy.release()

    def _map(self, work: PoolTask[_Given, _Task, _Result], source: "_TaskSource[_Given]") -> Iterator[_Result]:
        done: dict[int, list[tuple[Any, Exception | None]]] = {}
        following = self._first = self._sequence
        while True:
            self._receive(work, done, timeout=0.0)
            room = self._sequence - following < _AHEAD * self.processes
            idle = self._idle() if room else None
            if idle is not None and (found := source.take()) is not None:
                self._give(idle, work, found[0], done)
            elif following in done:
                for result, error in done.pop(following):
                    if error is not None:
                        raise error
                    yield result
                following += 1
            elif room and (found := source.take()) is not None:
                done[self._sequence] = self._here(work, found[0])
                self._sequence += 1
            elif following < self._sequence:
                self._receive(work, done, timeout=_LOOK)
            else:
                source.check()
                return

    def _give(self, idle: _Worker, work: PoolTask[_Given, _Task, _Result], given: _Given, done: dict[int, Any]) -> None:
        task, error = attempt(work.pack, given)
        if error is not None:
            done[self._sequence] = [(None, error)]
        else:
            if not idle.tasks:
                idle.since = time.monotonic()
            idle.tasks[self._sequence] = given
            try:
                idle.connection.send((self._sequence, work.there, task))
            except OSError as gone:
                self._replace(idle, work, done, gone)
        self._sequence += 1

    def _here(self, work: PoolTask[_Given, _Task, _Result], given: _Given) -> list[tuple[Any, Exception | None]]:
        if work.apart is not None and not work.apart.is_light(given):
            return self._apart(work, work.apart, given)
        began = time.perf_counter()
        made = attempt(work.here, given)
        self._spent += time.perf_counter() - began
        if not self._workers and self._spent >= self._patience:
            for number in range(1, self.processes):
                self._workers.append(_Worker(*start_worker(f"worker-{number}", self._warm_up)))
        return [made]

    def _apart(
        self, work: PoolTask[_Given, _Task, _Result], apart: IsolationPolicy[_Given, _Result], given: _Given
    ) -> list[tuple[Any, Exception | None]]:
        """The results of a task that may be too much for a process: of the whole if possible, else part by part."""
        whole = self._isolated.attempt(work.there, work.pack(given), 2.0 * apart.seconds)
        if whole.lost is None:
            return [(whole.result, whole.error)]
        results = list[tuple[Any, Exception | None]]()
        for one in apart.singles(given):
            outcome = self._isolated.attempt(work.there, work.pack(one), apart.seconds)
            if outcome.lost is not None and outcome.in_time:
                # The first failure may be bad luck: memory was short for another reason.
                outcome = self._isolated.attempt(work.there, work.pack(one), apart.seconds)
            if outcome.lost is not None:
                outcome = Outcome(apart.refuse(one, outcome.lost))
            results.append((outcome.result, outcome.error))
        return results

    def _idle(self) -> _Worker | None:
        """The process with the fewest tasks; None if each has enough or none is ready."""
        free = [worker for worker in self._workers if worker.ready and len(worker.tasks) < _AHEAD]
        return min(free, key=lambda worker: len(worker.tasks), default=None)

    def _receive(self, work: PoolTask[_Given, _Task, _Result], done: dict[int, Any], timeout: float) -> None:
        """Wait for processes and collect their results. Results of inputs before the first belong to a map that was
        given up.
        """
        by_connection = {worker.connection: worker for worker in self._workers}
        for connection in wait(list(by_connection), timeout):
            assert isinstance(connection, Connection)
            worker = by_connection[connection]
            try:
                sequence, result, error = connection.recv()
            except (EOFError, OSError) as gone:
                self._replace(worker, work, done, gone)
                continue
            if sequence is None:
                worker.ready = True
                continue
            given, worker.since = worker.tasks.pop(sequence), time.monotonic()
            if sequence >= self._first:
                too_much = work.apart is not None and isinstance(error, MemoryError)
                done[sequence] = self._apart(work, work.apart, given) if too_much and work.apart else [(result, error)]
        if work.apart is not None:
            late = time.monotonic() - 2.0 * work.apart.seconds
            for worker in [one for one in self._workers if one.tasks and one.since < late]:
                worker.process.kill()  # noticed like any other end of the process

    def _replace(
        self, worker: _Worker, work: PoolTask[_Given, _Task, _Result], done: dict[int, Any], gone: Exception
    ) -> None:
        """Replace a process that ended, and do its tasks in isolation. Raises WorkerLost if that is not possible."""
        if work.apart is None or not worker.ready:
            raise self._lost(worker) from gone
        self._workers.remove(worker)
        worker.process.join()
        worker.connection.close()
        self._workers.append(_Worker(*start_worker(worker.process.name, self._warm_up)))
        for sequence, given in worker.tasks.items():
            if sequence >= self._first:
                done[sequence] = self._apart(work, work.apart, given)

    def _lost(self, worker: _Worker) -> WorkerLost:
        worker.process.join()
        code = worker.process.exitcode or 0
        how = f"was ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        name = worker.process.name
        self.close()
        return WorkerLost(
            f"The process {name} of {self.processes} {how}. The memory may be too small. What was reported as done is "
            "stored; repeat the rest, perhaps with fewer processes."
        )


class _TaskSource(Generic[_Given]):
    """An iterator whose exception is raised only after everything before it is done."""

    def __init__(self, given: Iterable[_Given]) -> None:
        self._iterator = iter(given)
        self._error: Exception | None = None
        self._ended = False

    def take(self) -> tuple[_Given] | None:
        """The next item, None at the end."""
        if self._ended:
            return None
        try:
            return (next(self._iterator),)
        except StopIteration:
            pass
        except Exception as error:  # noqa: BLE001  raised by `check`, once its time has come
            self._error = error
        self._ended = True
        return None

    def check(self) -> None:
        """Raise the exception that ended the iterator."""
        if self._error is not None:
            raise self._error


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
