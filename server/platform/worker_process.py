"""One worker process: how it is started, what it does, and how it notices that nobody needs it any more.

Between it and its parent is one pipe, of which each holds one end. Tasks are `(number, function, task)` and results
`(number, result, error)`; the first message, all None, says that it is ready.
"""

import contextlib
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, Final, TypeVar

try:
    import resource
except ImportError:  # Windows has no such limits
    resource = None  # type: ignore[assignment]

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def start_worker(
    name: str, warm_up: Callable[[], object], *, memory: int | None = None
) -> tuple[SpawnProcess, Connection]:
    """A new process, which calls `warm_up` before anything else, and the pipe to it.

    `memory`: bytes of its own that it may take; beyond that its allocations fail.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, warm_up, memory), name=name, daemon=True)
    with _one_thread_each(), _undisturbed():
        process.start()
    theirs.close()  # the only other end is the worker's: when either is gone, the system tells the other
    return process, ours


def attempt(function: Callable[[_Task], _Result], task: _Task) -> tuple[_Result | None, Exception | None]:
    """What the function returns, or what it raises, to be raised when its turn has come."""
    try:
        return function(task), None
    except Exception as error:  # noqa: BLE001  raised by who asked
        return None, error


def _work(connection: Connection, warm_up: Callable[[], object], memory: int | None) -> None:
    """A worker's life. Threads read and send, so that neither side ever waits for the other to take something."""
    _give_way_to_the_service(memory)
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
    results: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.excepthook = _fail
    threading.Thread(target=_read, args=(connection, tasks), daemon=True).start()
    warm_up()
    threading.Thread(target=_send, args=(connection, results), daemon=True).start()
    results.put((None, None, None))
    while True:
        number, function, task = tasks.get()
        result, error = attempt(function, task)
        results.put((number, result, None if error is None else _portable(error)))


def _give_way_to_the_service(memory: int | None) -> None:
    """Where memory runs out, this process is to end, and not the one that answers requests."""
    if memory is not None and resource is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    with contextlib.suppress(OSError):  # not every system has it, and without it the work is the same
        Path("/proc/self/oom_score_adj").write_text("1000")


def _read(connection: Connection, tasks: "queue.SimpleQueue[Any]") -> None:
    try:
        while True:
            tasks.put(connection.recv())
    except (EOFError, OSError):
        os._exit(0)  # the parent is gone: nobody wants the result that is being made


def _send(connection: Connection, results: "queue.SimpleQueue[Any]") -> None:
    try:
        while True:
            connection.send(results.get())
    except OSError:
        os._exit(0)


def _fail(failed: threading.ExceptHookArgs) -> None:
    """A thread that ends leaves the parent waiting; the end of the process is reported to it."""
    traceback.print_exception(failed.exc_value)
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """The error, as one that arrives, with the place where it was raised."""
    told = "in a worker process:\n" + "".join(traceback.format_exception(error))
    _, refused = attempt(lambda one: pickle.loads(pickle.dumps(one)), error)
    if refused is not None:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(told)
    return error


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Libraries size their thread pools when they are loaded: a new process must find the limit in place."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Ctrl-C reaches all processes of a terminal. One that is started here never sees it: its parent ends it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
