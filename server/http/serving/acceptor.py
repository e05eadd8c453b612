"""Accept connections at a limited rate, so that a crowd of new ones does not hold up those that are there."""

import asyncio
import logging
import select
import socket
import time
from collections.abc import Callable, Sequence
from typing import Final

_PER_SECOND: Final = 100.0
"""New connections a second, of each process: about as many queries as it answers. A connection and its first request
take 2 to 3 ms, so 4,000 of them at once made p99 of other callers six times as long, and at this rate twice
(`python -m benchmarks.reliability --only exhaustion`)."""
_BURST: Final = 50.0
"""New connections that are accepted without a pause after a quiet moment."""
_RETRY: Final = 1.0
"""Seconds until the next try after the system had no descriptor or memory for a connection."""
_QUIET: Final = 60.0
"""Seconds between two log lines that say so."""
_LAST_CALL: Final = 1.0
"""Most seconds for accepting the connections that wait already when the service stops."""
_log = logging.getLogger(__name__)


class Acceptor:
    """Accepts the connections of listening sockets on the running event loop."""

    def __init__(self, listeners: Sequence[socket.socket], make_protocol: Callable[[], asyncio.Protocol]) -> None:
        self._listeners, self._make_protocol = listeners, make_protocol
        self._loop = asyncio.get_running_loop()
        self._tokens, self._counted = _BURST, time.monotonic()
        self._not_before = 0.0
        self._pause: asyncio.TimerHandle | None = None
        self._finishing = False
        self._opening: set[asyncio.Task[object]] = set()
        for listener in listeners:
            listener.setblocking(False)
        self._resume()

    async def finish(self) -> None:
        """Accept the connections that wait already, without a limit of the rate but for a limited time, because new
        ones may keep coming; then no more.

        Connections that come after this and before the sockets are closed are reset, and nothing was done for them.
        """
        self._finishing = True
        self._stop_reading()
        waiting, until = select.poll(), time.monotonic() + _LAST_CALL
        for listener in self._listeners:
            waiting.register(listener, select.POLLIN)
        while waiting.poll(0) and time.monotonic() < until:
            for listener in self._listeners:
                self._accept_one(listener)
            await asyncio.sleep(0)

    def _resume(self) -> None:
        self._pause = None
        for listener in self._listeners:
            self._loop.add_reader(listener, self._on_ready, listener)

    def _stop_reading(self) -> None:
        for listener in self._listeners:
            self._loop.remove_reader(listener)
        if self._pause is not None:
            self._pause.cancel()
            self._pause = None

    def _rest(self, seconds: float) -> None:
        if self._finishing:
            return
        self._stop_reading()
        self._pause = self._loop.call_later(seconds, self._resume)

    def _on_ready(self, listener: socket.socket) -> None:
        now = time.monotonic()
        self._tokens = min(_BURST, self._tokens + (now - self._counted) * _PER_SECOND)
        self._counted = now
        if self._tokens < 1.0:
            self._rest((1.0 - self._tokens) / _PER_SECOND)
            return
        self._tokens -= 1.0
        self._accept_one(listener)

    def _accept_one(self, listener: socket.socket) -> None:
        try:
            connection, _ = listener.accept()
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            return  # another process took it, or the caller has gone
        except OSError as error:
            self._complain(error)
            self._rest(_RETRY)
            return
        connection.setblocking(False)
        task = self._loop.create_task(self._open(connection))
        self._opening.add(task)
        task.add_done_callback(self._opening.discard)

    async def _open(self, connection: socket.socket) -> None:
        await self._loop.connect_accepted_socket(self._make_protocol, connection)

    def _complain(self, error: OSError) -> None:
        """Log one line in a while, not one for each try."""
        now = time.monotonic()
        if now >= self._not_before:
            self._not_before = now + _QUIET
            _log.error("no connection can be accepted: %s; trying again every second", error)
