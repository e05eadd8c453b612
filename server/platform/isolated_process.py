"""A process for work that may end its process or never finish."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, Final

from server.errors import WorkerLost
from server.platform.worker_process import start_worker

_LOOK: Final = 0.5
"""Seconds between two checks whether the time is over."""
_TO_START: Final = 120.0
"""Seconds that a process may take to start. If it takes longer, the task is not to blame."""
_MEMORY: Final = 2 * 1024**3
"""Bytes of memory that the process may allocate: several times the need of the largest submap."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a task: a result, an error to raise, or in `lost` why there is neither."""

    result: Any = None
    error: Exception | None = None
    lost: str | None = None
    in_time: bool = True


class IsolatedProcess:
    """A process that does one task at a time. If a task ends it or takes too long, a new one replaces it."""

    def __init__(self, warm_up: Callable[[], object], memory: int | None = _MEMORY) -> None:
        """Nothing is started yet. `memory`: bytes that the process may allocate; None for any number."""
        self._warm_up, self._memory = warm_up, memory
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None

    def attempt(self, function: Callable[[Any], Any], task: object, seconds: float) -> Outcome:
        """Do a task in the process, within a number of seconds. Raises WorkerLost if no process can be started."""
        connection = self._started()
        connection.send((0, function, task))
        try:
            message = _receive(connection, seconds)
        except (EOFError, OSError):
            return Outcome(lost=self._ended())
        if message is None:
            self.close()
            return Outcome(lost=f"it took longer than {seconds:g} s", in_time=False)
        _, result, error = message
        if isinstance(error, MemoryError):
            self.close()  # its state is not worth finding out
            return Outcome(lost="it needed too much memory")
        return Outcome(result, error)

    def close(self) -> None:
        """End the process, whatever it is doing."""
        process, connection = self._process, self._connection
        self._process = self._connection = None
        if connection is not None:
            connection.close()
        if process is not None:
            process.kill()
            process.join()
            process.close()

    def _started(self) -> Connection:
        if self._connection is None:
            self._process, self._connection = start_worker("worker-apart", self._warm_up, memory=self._memory)
            try:
                ready = _receive(self._connection, _TO_START)
            except (EOFError, OSError) as error:
                raise WorkerLost(f"No worker process can be started: {self._ended()}.") from error
            if ready is None:
                self.close()
                raise WorkerLost(f"No worker process could be started within {_TO_START:g} s.")
        return self._connection

    def _ended(self) -> str:
        """How the process ended. Cleans up after it."""
        if self._process is None:
            return "it was closed"
        self._process.join()
        code = self._process.exitcode or 0
        self.close()
        return f"the process was ended by signal {-code}" if code < 0 else f"the process ended with exit code {code}"


def _receive(connection: Connection, seconds: float) -> Any:
    """The next message, None if none came in time. Raises EOFError and OSError if the process has ended."""
    deadline = time.monotonic() + seconds
    while not connection.poll(min(_LOOK, max(deadline - time.monotonic(), 0.0))):
        if time.monotonic() >= deadline:
            return None
    return connection.recv()
