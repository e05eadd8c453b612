"""How the processes of one service know each other's metrics: each writes what it counted to a folder they share.

A scrape reaches one process, which answers with what it counts now and what the others wrote within the last second.
What a process counted outlives it: the one that started it adds that to what is past, so that no counter goes back.
"""

import fcntl
import logging
import os
import shutil
import threading
from collections.abc import Iterator, Set
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import orjson

from server.observability.metric_samples import Family, cumulative, from_json, merged, to_json
from server.observability.metrics import Metrics

_EVERY: Final = 1.0
"""Seconds between two writes of a process."""
_PAST: Final = "past"
_log = logging.getLogger(__name__)


class MetricsExchange:
    """The folder of one service, as one of its processes sees it. Can be sent to a process that is started."""

    def __init__(self, folder: Path) -> None:
        """A folder that is there."""
        self._folder = folder
        self._stop: threading.Event | None = None
        self._thread: threading.Thread | None = None

    def start(self, metrics: Metrics) -> None:
        """Write this process's metrics every second from now on."""
        stop = self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, args=(metrics, stop), name="metrics", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Write them once more, and no more."""
        if self._stop is not None and self._thread is not None:
            self._stop.set()
            self._thread.join()

    def publish(self, metrics: Metrics) -> None:
        """Write this process's metrics now. Raises OSError."""
        self._write(str(os.getpid()), metrics.families())

    def others(self) -> list[list[Family]]:
        """What the other processes wrote, and those that are gone."""
        with self._locked(fcntl.LOCK_SH):
            own = f"{os.getpid()}.json"
            return [self._read(path) for path in sorted(self._folder.glob("*.json")) if path.name != own]

    def fold_exited(self, living: Set[int]) -> None:
        """Add the counters of processes that are not among the `living` to what is past, and forget the rest."""
        dead = [path for path in self._folder.glob("*.json") if path.stem != _PAST and int(path.stem) not in living]
        if not dead:
            return
        with self._locked(fcntl.LOCK_EX):
            past = self._folder / f"{_PAST}.json"
            known = [self._read(past)] if past.exists() else []
            self._write(_PAST, merged([*known, *(cumulative(self._read(path)) for path in dead)]))
            for path in dead:
                path.unlink()

    def remove(self) -> None:
        """Remove the folder, when the service has ended."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _work(self, metrics: Metrics, stop: threading.Event) -> None:
        failed = False
        while True:
            ended = stop.wait(_EVERY)
            try:
                self.publish(metrics)
            except OSError as error:
                if not failed:
                    _log.warning("metrics cannot be written for the other processes; trying again: %s", error)
                failed = True
            if ended:
                return

    def _read(self, path: Path) -> list[Family]:
        return from_json(orjson.loads(path.read_bytes()))

    def _write(self, name: str, told: list[Family]) -> None:
        unfinished = self._folder / f"{name}.part"
        unfinished.write_bytes(orjson.dumps(to_json(told)))
        unfinished.replace(self._folder / f"{name}.json")

    @contextmanager
    def _locked(self, mode: int) -> Iterator[None]:
        with (self._folder / "lock").open("ab") as lock:
            fcntl.flock(lock, mode)
            yield
