"""One worker process: its start, its work, and how it notices that its parent is gone.

One pipe connects it with its parent. Tasks are `(number, function, task)`, results `(number, result, error)`. The first
message, all None, says that the worker is ready.
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
_SPAWN: Final = multiprocessing.get_context("spawn")
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def start_worker(
    name: str, warm_up: Callable[[], object], *, memory: int | None = None
) -> tuple[SpawnProcess, Connection]:
    """A new process, which calls `warm_up` first, and the pipe to it.

    `memory`: bytes that it may allocate; beyond that, allocations fail.
    """
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=_work, args=(theirs, warm_up, memory), name=name, daemon=True)
    with _one_thread_each(), _undisturbed():
        process.start()
    theirs.close()  # the worker has the only other end, so each side notices when the other one ends
    return process, ours


def attempt(function: Callable[[_Task], _Result], task: _Task) -> tuple[_Result | None, Exception | None]:
    """The result of the function, or the error that it raised, to be raised when its turn comes."""
    try:
        return function(task), None
    except Exception as error:  # noqa: BLE001  raised by who asked
        return None, error


def _work(connection: Connection, warm_up: Callable[[], object], memory: int | None) -> None:
    """The main loop of a worker. Threads read and send, so that neither side ever blocks the other."""
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
    """Make this process the first to be killed if memory runs out, and not the service."""
    if memory is not None and resource is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    with contextlib.suppress(OSError):  # optional: not every system has it
        Path("/proc/self/oom_score_adj").write_text("1000")


def _read(connection: Connection, tasks: "queue.SimpleQueue[Any]") -> None:
    try:
        while True:
            tasks.put(connection.recv())
    except (EOFError, OSError):
        os._exit(0)  # the parent has ended, so nobody wants the result


def _send(connection: Connection, results: "queue.SimpleQueue[Any]") -> None:
    try:
        while True:
            connection.send(results.get())
    except OSError:
        os._exit(0)


def _fail(failed: threading.ExceptHookArgs) -> None:
    """End the process if a thread fails: the parent would wait for ever for the thread, but notices the end of the
    process.
    """
    traceback.print_exception(failed.exc_value)
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """The error in a form that can be sent, with the place where it was raised."""
    told = "in a worker process:\n" + "".join(traceback.format_exception(error))
    _, refused = attempt(lambda one: pickle.loads(pickle.dumps(one)), error)
    if refused is not None:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(told)
    return error


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Limit thread pools to one thread by the environment, which libraries read when they are loaded."""
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
    """Ignore Ctrl-C, which reaches all processes of a terminal. The parent ends its workers."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
