"""Serving the app on a socket: how it begins, and how it ends without losing a request."""

import asyncio
import gc
import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

from fastapi import FastAPI
from uvicorn.server import Server

from server.http.dependencies import Service
from server.http.protocol import ServerConfig
from server.http.readiness import SHUTDOWN

_SPARE: Final = 10.0
"""Seconds after `drain_seconds` that the parts have to stop; then the process ends all the same."""
_log = logging.getLogger("server")


def serve_app(app: FastAPI, listener: socket.socket, *, alone: bool) -> None:
    """Answer requests on the socket until a signal says to stop.

    `alone`: a second signal ends the process at once. Otherwise the process is one of several, whose parent decides
    that, and Ctrl-C is for the parent only.
    """
    service: Service = app.state.service
    settings = service.settings
    config = ServerConfig(
        app,
        settings.limits,
        lambda reason: service.metrics.rejected.labels(reason).inc(),
        log_config=None,
        access_log=False,
        timeout_graceful_shutdown=max(1, round(settings.drain_seconds)),
    )
    _Drained(config, service, alone=alone).run(sockets=[listener])


class _Drained(Server):
    """Ends in order: first /readyz says so, then nothing more is accepted, then what is at hand is finished."""

    def __init__(self, config: ServerConfig, service: Service, *, alone: bool) -> None:
        super().__init__(config)
        self._service, self._alone = service, alone
        self._signal: int | None = None
        self._until: float | None = None
        self._settled = False
        connections = self.server_state.connections
        service.metrics.open_connections.set_function(lambda: len(connections))

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Signals are ours while it serves, and not raised again after: to end in order is exit code 0."""
        ours: dict[int, Any] = {signal.SIGTERM: self.handle_exit}
        ours[signal.SIGINT] = self.handle_exit if self._alone else signal.SIG_IGN
        before = {number: signal.signal(number, handler) for number, handler in ours.items()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """The first signal begins the end, the second is it. One may come while any lock is held: none is taken."""
        if self._signal is None:
            self._signal = sig
        elif self._alone:
            os._exit(128 + sig)

    async def on_tick(self, counter: int) -> bool:
        """Whether the time has come to accept no more."""
        ended: bool = await super().on_tick(counter)
        if not self._settled and self._service.readiness.ready:
            self._settled = True
            _settle()
        if self._signal is not None and self._until is None:
            self._until = self._begin_to_end(self._signal)
        return ended or (self._until is not None and time.monotonic() >= self._until)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept who has connected already, then nobody."""
        self._service.readiness.report(SHUTDOWN, _ENDING)
        for _ in range(3):
            await asyncio.sleep(0)
        await super().shutdown(sockets)

    def _begin_to_end(self, sig: int) -> float:
        """Say so; until when requests are still taken."""
        settings = self._service.settings
        # Who presses Ctrl-C looks at no probe.
        notice = settings.notice_seconds if sig == signal.SIGTERM else 0.0
        self._service.readiness.report(SHUTDOWN, _ENDING)
        last = threading.Timer(notice + settings.drain_seconds + _SPARE, _give_up)
        last.daemon = True
        last.start()
        return time.monotonic() + notice


def _settle() -> None:
    """Spare what is loaded by now from the garbage collector, for good: to look through it again and again holds up
    every request for a tenth of a second.
    """
    gc.collect()
    gc.freeze()


_ENDING: Final = "the service is stopping"


def _give_up() -> None:
    _log.error("requests at hand did not end in time; ending without them")
    os._exit(1)
