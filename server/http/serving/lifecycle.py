"""Serve the app on a socket: start, and stop without losing a request."""

import asyncio
import gc
import logging
import math
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any, Final

from fastapi import FastAPI
from uvicorn.server import Server

from server.errors import NotReady
from server.http.admission.readiness import SHUTDOWN
from server.http.admission.request_admission import AdmissionState
from server.http.serving.acceptor import Acceptor
from server.http.serving.connections import ServerConfig, TimedConnection
from server.service_parts import Service

_LAST_WORDS: Final = 1.0
"""Seconds for answering the requests that were cut off, after `drain_seconds`."""
_CUT: Final = 1.0
"""Seconds after which their connections are closed."""
_TICK: Final = 0.1
BACKLOG: Final = 2048
"""Connections that may wait to be accepted."""
_SWITCH_SECONDS: Final = 0.0001
"""Seconds that a computing thread keeps the interpreter while others want it. A small query releases it and takes it
again some ten times, so with Python's default of 5 ms it mostly waits for large ones. p99 of other callers beside large
answers: 113 ms with 5 ms, 83 ms with 0.5 ms; beside a revoked key: 45 ms with 0.5 ms, 33 ms with 0.1 ms
(`python -m benchmarks.reliability --only exhaustion`).
"""
_COLLECTED: Final = (10_000, 10, 50)
"""Thresholds of the garbage collector: new objects before a collection of the young ones, and collections before one of
older ones. It has almost nothing to collect, and one pass during large answers delays everybody by 30 ms."""
_ENDING: Final = "the service is stopping"
_log = logging.getLogger("server")


def serve_app(app: FastAPI, listener: socket.socket, *, single_process: bool) -> None:
    """Answer requests on the socket until a signal says to stop.

    `single_process`: a second signal ends the process at once. Otherwise the process is one of several: their parent
    decides that, and Ctrl-C is for the parent only.
    """
    service: Service = app.state.service
    settings = service.settings
    sys.setswitchinterval(_SWITCH_SECONDS)
    config = ServerConfig(
        app,
        settings.limits,
        lambda reason: service.metrics.rejected.labels(reason).inc(),
        log_config=None,
        access_log=False,
        timeout_graceful_shutdown=math.ceil(settings.drain_seconds + _LAST_WORDS + _CUT),
    )
    _GracefulServer(config, app, single_process=single_process).run(sockets=[listener])


class _GracefulServer(Server):
    """Stops in order: first /readyz says so, then no connection is accepted, then requests in progress finish or are
    cut off.

    A thread ends the process when the time is over, with exit code 0: acknowledged writes are on the disk, and the next
    start resumes jobs.
    """

    config: ServerConfig
    _acceptor: Acceptor

    def __init__(self, config: ServerConfig, app: FastAPI, *, single_process: bool) -> None:
        super().__init__(config)
        service: Service = app.state.service
        self._service, self._single_process = service, single_process
        self._shared: AdmissionState = app.state.shared
        self._signal: int | None = None
        self._until: float | None = None
        self._frozen = False
        connections = self.server_state.connections
        service.metrics.open_connections.set_function(lambda: len(connections))

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen. The web server is given no socket, because the acceptor limits how fast connections come."""
        await super().startup([])
        make = partial(TimedConnection, self.config, self.server_state, self.lifespan.state)
        self._acceptor = Acceptor(sockets or [], make)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Handle signals while serving, and do not raise them again: after an orderly stop the exit code is 0."""
        ours: dict[int, Any] = {signal.SIGTERM: self.handle_exit}
        ours[signal.SIGINT] = self.handle_exit if self._single_process else signal.SIG_IGN
        before = {number: signal.signal(number, handler) for number, handler in ours.items()}
        threading.Thread(target=self._end_in_time, name="end-watch", daemon=True).start()
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """The first signal begins the stop, the second one ends the process. A signal may come while any lock is held,
        so no lock is taken here.
        """
        if self._signal is None:
            self._signal = sig
        elif self._single_process:
            os._exit(128 + sig)

    async def on_tick(self, counter: int) -> bool:
        """Whether to stop accepting now."""
        ended: bool = await super().on_tick(counter)
        if not self._frozen and self._service.readiness.ready:
            self._frozen = True
            _freeze_loaded_objects()
        if self._signal is not None and self._until is None:
            # After Ctrl-C nobody reads /readyz, so there is no notice period.
            notice = self._service.settings.shutdown_delay_seconds if self._signal == signal.SIGTERM else 0.0
            self._service.readiness.report(SHUTDOWN, _ENDING)
            self._until = time.monotonic() + notice
        return ended or (self._until is not None and time.monotonic() >= self._until)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept the connections that wait already and no others. Cut off what is not finished in time."""
        self._service.readiness.report(SHUTDOWN, _ENDING)
        self._service.hand_back()
        loop, drain = asyncio.get_running_loop(), self._service.settings.drain_seconds
        loop.call_later(drain, self._end_requests)
        loop.call_later(drain + _LAST_WORDS, self._cut_off)
        await self._acceptor.finish()
        await super().shutdown(sockets)

    def _end_requests(self) -> None:
        """Refuse requests that take too long. That ends queries, streams of results and uploads."""
        for request in list(self._shared.requests):
            request.refuse(NotReady(SHUTDOWN, _ENDING))

    def _cut_off(self) -> None:
        """Reset the connections of callers that are slow to send or to read."""
        for connection in list(self.server_state.connections):
            if isinstance(connection, TimedConnection):
                connection.transport.abort()

    def _end_in_time(self) -> None:
        """End the process in time. Runs in a thread, because the event loop may be what hangs."""
        while self._signal is None:
            time.sleep(_TICK)
        time.sleep(self._service.settings.stop_seconds)
        _log.warning("the process did not stop in time (stop_seconds), so it exits now")
        os._exit(0)


def _freeze_loaded_objects() -> None:
    """Exclude the objects that exist now from garbage collection. Scanning them again and again would hold up every
    request for a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_COLLECTED)
