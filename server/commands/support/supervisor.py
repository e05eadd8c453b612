"""Several processes that answer on one socket, and their supervisor, which keeps them running and stops them."""

import logging
import multiprocessing
import multiprocessing.connection
import os
import signal
import socket
import sys
import tempfile
import threading
import time
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Final

from server.app import create_app
from server.commands.support.signals import handled
from server.config.settings import Settings
from server.http.serving.lifecycle import serve_app
from server.observability import kernel_progress, logs
from server.observability.metrics_exchange import MetricsExchange

_SPAWN: Final = multiprocessing.get_context("spawn")
_TICK: Final = 0.1
_AGAIN: Final = 1.0
"""Least seconds between the start of a process and of its replacement."""
_SPARE: Final = 0.5
"""Seconds that a process has to stop after its time is over. Then it is killed."""
_STARTUP_FAILURE: Final = 3
_log = logging.getLogger(__name__)


def supervise(workers: int, settings: Settings, listener: socket.socket) -> int:
    """Run `workers` processes until a signal says to stop. Returns the exit code.

    A process that ends is replaced. One signal lets them finish the requests in progress, a second one ends them at
    once.
    """
    exchange = MetricsExchange(Path(tempfile.mkdtemp(prefix="urquhart-metrics-")))
    try:
        return _Supervisor(workers, settings, listener, exchange).run()
    finally:
        exchange.remove()


class _Supervisor:
    def __init__(self, workers: int, settings: Settings, listener: socket.socket, exchange: MetricsExchange) -> None:
        self._settings, self._listener, self._exchange = settings, listener, exchange
        self._running: list[tuple[SpawnProcess, float]] = []
        self._workers = workers
        self._signals: list[int] = []

    def run(self) -> int:
        """Run until no process is left."""
        second = kernel_progress.start_second_process()
        try:
            return self._run()
        finally:
            if second is not None:
                second.kill()
                second.wait()

    def _run(self) -> int:
        with handled(self._signals.append, signal.SIGTERM, signal.SIGINT):
            while not self._signals:
                self._fill()
                _rest([one for one, _ in self._running])
                if self._failed_to_start():
                    _log.error("a process cannot start; stopping")
                    self._end()
                    return _STARTUP_FAILURE
                self._exchange.fold_exited(
                    {one.pid for one, _ in self._running if one.pid is not None and one.is_alive()}
                )
            return self._end()

    def _fill(self) -> None:
        """Start the missing processes, none too soon after the one that it replaces."""
        for process, began in [*self._running]:
            if process.is_alive():
                continue
            if time.monotonic() - began < _AGAIN:
                return
            _log.warning("process %s ended with %s; starting another", process.pid, process.exitcode)
            self._running.remove((process, began))
        while len(self._running) < self._workers and not self._signals:
            process = _SPAWN.Process(target=_work, args=(self._settings, self._listener, self._exchange))
            process.start()
            self._running.append((process, time.monotonic()))

    def _failed_to_start(self) -> bool:
        return any(process.exitcode == _STARTUP_FAILURE for process, _ in self._running)

    def _end(self) -> int:
        """Let the processes finish. The exit code is 0 if all did."""
        # When the last process closes the socket, further connections are refused. This process accepts none.
        self._listener.close()
        processes = [process for process, _ in self._running]
        for process in processes:
            if process.is_alive() and process.pid is not None:
                os.kill(process.pid, signal.SIGTERM)
        last, late = time.monotonic() + self._settings.stop_seconds + _SPARE, set[int | None]()
        while any(process.is_alive() for process in processes):
            if len(self._signals) > 1 or time.monotonic() > last:
                for process in processes:
                    if process.is_alive():
                        late.add(process.pid)
                        process.kill()
            _rest(processes)
        if len(self._signals) > 1:
            return 128 + self._signals[-1]
        # Being killed for stopping too slowly is not a failure: acknowledged writes are on the disk.
        return 0 if all(process.exitcode == 0 or process.pid in late for process in processes) else 1


def _rest(processes: list[SpawnProcess]) -> None:
    """Wait for a moment, or until a process ends."""
    if all(process.is_alive() for process in processes):
        multiprocessing.connection.wait([process.sentinel for process in processes], _TICK)
    else:
        time.sleep(_TICK)


def _work(settings: Settings, listener: socket.socket, exchange: MetricsExchange) -> None:
    """One process. It stops when its supervisor has ended, however it ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logs.configure(settings.log)
    threading.Thread(target=_stop_with_parent, name="parent-watch", daemon=True).start()
    try:
        serve_app(create_app(settings, exchange, create_database=False), listener, single_process=False)
    finally:
        parent = multiprocessing.parent_process()
        if parent is not None and not parent.is_alive():
            exchange.remove()
    sys.exit(0)


def _stop_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)
