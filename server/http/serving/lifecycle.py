"""Serving the app on a socket: how it begins, and how it ends without losing a request."""

import asyncio
import gc
import logging
import math
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

from fastapi import FastAPI
from uvicorn.server import Server

from server.errors import NotReady
from server.http.admission.admission import AdmissionState
from server.http.admission.readiness import SHUTDOWN
from server.http.serving.connections import ServerConfig, TimedConnection
from server.http.serving.file_descriptors import Complaints
from server.runtime import Service

_LAST_WORDS: Final = 1.0
"""Seconds that requests which take too long have to be answered that the service ends;"""
_CUT: Final = 1.0
"""and those after which their connections are closed, that they have to end."""
_LAST_CALL: Final = 1.0
"""Seconds at most in which those that wait already are accepted;"""
_TICK: Final = 0.1
BACKLOG: Final = 2048
"""Connections that wait to be accepted,"""
_ACCEPTED: Final = 2
"""and those that are accepted at once: who waits for an answer waits while the event loop greets them."""
_SWITCH_SECONDS: Final = 0.0005
"""How long a thread that computes keeps the interpreter while others want it. A small query gives it back and asks for
it again some ten times, so that with Python's 5 ms it waits for large ones most of its time: others' p99 beside large
answers 113 -> 83 ms, beside abandoned batches 99 -> 76 ms (`python -m benchmarks.reliability --only exhaustion`)."""
_COLLECTED: Final = (10_000, 10, 50)
"""When the garbage collector runs: new objects before it looks through the young ones, and how many times that before
it looks through the older ones. Nearly nothing is left to it, and one pass beside large answers holds everybody up for
30 ms."""
_ENDING: Final = "the service is stopping"
_log = logging.getLogger("server")


def serve_app(app: FastAPI, listener: socket.socket, *, single_process: bool) -> None:
    """Answer requests on the socket until a signal says to stop.

    `alone`: a second signal ends the process at once. Otherwise the process is one of several, whose parent decides
    that, and Ctrl-C is for the parent only.
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
        backlog=_ACCEPTED,
        timeout_graceful_shutdown=math.ceil(settings.drain_seconds + _LAST_WORDS + _CUT),
    )
    _GracefulServer(config, app, single_process=single_process).run(sockets=[listener])


class _GracefulServer(Server):
    """Ends in order: /readyz says so, then nothing more is accepted, then what is in progress is finished, or cut off.

    A thread of its own sees to it that the process has ended in time, with exit code 0 all the same: what was
    acknowledged is on the disk, and jobs are resumed at the next start.
    """

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
        """Begin to accept. Many may wait to be accepted, but few are accepted before the first of them is looked at:
        else there may be more connections than files that can be opened.
        """
        asyncio.get_running_loop().set_exception_handler(Complaints())
        await super().startup(sockets)
        for listener in sockets or []:
            listener.listen(BACKLOG)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Signals are ours while it serves, and not raised again after: to end in order is exit code 0."""
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
        """The first signal begins the end, the second is it. One may come while any lock is held: none is taken."""
        if self._signal is None:
            self._signal = sig
        elif self._single_process:
            os._exit(128 + sig)

    async def on_tick(self, counter: int) -> bool:
        """Whether the time has come to accept no more."""
        ended: bool = await super().on_tick(counter)
        if not self._frozen and self._service.readiness.ready:
            self._frozen = True
            _freeze_loaded_objects()
        if self._signal is not None and self._until is None:
            # Who presses Ctrl-C looks at no probe.
            notice = self._service.settings.shutdown_delay_seconds if self._signal == signal.SIGTERM else 0.0
            self._service.readiness.report(SHUTDOWN, _ENDING)
            self._until = time.monotonic() + notice
        return ended or (self._until is not None and time.monotonic() >= self._until)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept who has connected already, then nobody; cut off what is not finished in time."""
        self._service.readiness.report(SHUTDOWN, _ENDING)
        self._service.hand_back()
        loop, drain = asyncio.get_running_loop(), self._service.settings.drain_seconds
        loop.call_later(drain, self._end_requests)
        loop.call_later(drain + _LAST_WORDS, self._cut_off)
        await _accept_all(sockets or [])
        await super().shutdown(sockets)

    def _end_requests(self) -> None:
        """Requests that take too long are refused; that ends queries, streams of results and uploads."""
        for request in list(self._shared.requests):
            request.refuse(NotReady(SHUTDOWN, _ENDING))

    def _cut_off(self) -> None:
        """Those that are slow to send or to read have no connection any more."""
        for connection in list(self.server_state.connections):
            if isinstance(connection, TimedConnection):
                connection.transport.abort()

    def _end_in_time(self) -> None:
        """In a thread, because the event loop may be what does not end."""
        while self._signal is None:
            time.sleep(_TICK)
        time.sleep(self._service.settings.stop_seconds)
        _log.warning("not everything ended in time; ending without it")
        os._exit(0)


async def _accept_all(listeners: list[socket.socket]) -> None:
    """Wait until nobody waits to be accepted, but not for ever: while some come again and again, there is always one.

    Whoever connects between this and the end of listening is reset, without anything having been done.
    """
    waiting, until = select.poll(), time.monotonic() + _LAST_CALL
    for listener in listeners:
        waiting.register(listener, select.POLLIN)
    while waiting.poll(0) and time.monotonic() < until:
        await asyncio.sleep(0)


def _freeze_loaded_objects() -> None:
    """Spare what is loaded by now from the garbage collector, for good: to look through it again and again holds up
    every request for a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_COLLECTED)
