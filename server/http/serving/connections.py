"""Connections: their number, how long each may take to send a request, and how they end."""

import asyncio
import logging
import select
from collections.abc import Callable, Mapping
from typing import Any, Final

import h11
import orjson
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from server.config.settings import Limits
from server.errors import Overloaded, TooSlow
from server.http.admission.request_admission import ABORT
from server.http.browser_protection import safe_headers
from server.http.problems import MEDIA_TYPE
from server.http.request_logging import new_request_id
from server.problem_types import OTHER, document, plain

_LAST_WORD = 0.25
"""Seconds that an idle connection has to send a request that is on its way when the service stops."""
_FLUSH = 30.0
"""Seconds that a caller has to read the rest of an answer after its connection was closed."""

_UNREAD: Final = 0.1
"""Seconds between two checks whether a caller has gone that sent its next request before it got the answer."""
_log = logging.getLogger("server")
_HUNG_UP: Final = getattr(select, "POLLRDHUP", 0) | select.POLLHUP | select.POLLERR


class ServerConfig(Config):
    """The web server's configuration, with the limits of connections."""

    def __init__(self, app: Any, limits: Limits, reject: Callable[[str], None], **options: Any) -> None:
        """`reject` gets the reason when a connection is refused or closed to protect others."""
        self.limits, self.reject = limits, reject
        self.idle: dict[TimedConnection, None] = {}
        """Connections without a request in progress, the one that is idle for longest first."""
        super().__init__(app, http=TimedConnection, timeout_keep_alive=limits.idle_seconds, **options)  # type: ignore[arg-type]


class _HeadWithBody(h11.Connection):
    """Writes the head of an answer together with what follows it, so that both leave in one system call."""

    _head = b""

    def send(self, event: h11.Event) -> bytes | None:  # type: ignore[override]
        """The bytes of an event; none yet of the head of an answer."""
        data = super().send(event)
        if data is None:
            return None
        if isinstance(event, h11.Response):
            self._head = data
            return b""
        data, self._head = self._head + data, b""
        return data


class TimedConnection(H11Protocol):
    """A connection whose caller has `header_seconds` for the head of each request.

    If there are too many connections, the one that was idle for longest is closed. If none is idle, the new one is
    refused.
    """

    config: ServerConfig

    def __init__(
        self,
        config: ServerConfig,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, {**app_state, ABORT: self.abort}, _loop)
        self.conn = _HeadWithBody(h11.SERVER)
        self._head_timer: asyncio.TimerHandle | None = None
        self._leaving = False
        self._unread_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A caller has connected."""
        super().connection_made(transport)
        if len(self.connections) > self.config.limits.connections and not self._make_room():
            self.config.reject("connections")
            most = self.config.limits.connections
            self._refuse(document(Overloaded(f"All {most} connections are in use. Try again in a moment.", 1.0)))
            return
        self._sort()
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """The caller has gone."""
        self._head_arrived()
        self.config.idle.pop(self, None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes of a request. The rest of a body that was answered already has as much time as a head."""
        if self.transport.is_closing():
            return
        super().data_received(data)
        self._sort()
        if self.is_idle:
            self._await_head()
        else:
            self._head_arrived()
            if self._leaving:
                self.cycle.keep_alive = False

    def handle_events(self) -> None:
        """Requests in the received bytes. If the next request came before the answer, no more is read, so the end of
        the connection is not noticed here.
        """
        super().handle_events()
        if self._is_unread and self._unread_timer is None:
            self._unread_timer = self.loop.call_later(_UNREAD, self._look_for_end)

    def on_response_complete(self) -> None:
        """The answer is complete."""
        super().on_response_complete()
        self._sort()

    def shutdown(self) -> None:
        """The service stops: finish requests in progress. An idle connection has a moment for a request on its way."""
        if not self.is_idle:
            self.cycle.keep_alive = False
            return
        self._leaving = True
        self.loop.call_later(_LAST_WORD, self._close_if_idle)

    def abort(self) -> None:
        """Reset the connection and drop what was not sent."""
        self.transport.abort()

    def timeout_keep_alive_handler(self) -> None:
        """The connection was idle for too long after an answer."""
        super().timeout_keep_alive_handler()
        self._abort_later()

    @property
    def is_idle(self) -> bool:
        """Whether no request is in progress."""
        return self.cycle is None or self.cycle.response_complete

    @property
    def _is_unread(self) -> bool:
        """Whether a request is in progress while nothing more is read from its caller."""
        return self.flow.read_paused and not self.is_idle and not self.cycle.more_body

    def _look_for_end(self) -> None:
        self._unread_timer = None
        if self.transport.is_closing() or not self._is_unread:
            return
        poll = select.poll()
        poll.register(self.transport.get_extra_info("socket").fileno(), _HUNG_UP)
        if poll.poll(0):
            self.transport.abort()
        else:
            self._unread_timer = self.loop.call_later(_UNREAD, self._look_for_end)

    def _sort(self) -> None:
        """Update the list of idle connections. One that sends the head of a request piece by piece keeps its place in
        it.
        """
        if self.is_idle and not self.transport.is_closing():
            self.config.idle.setdefault(self)
        else:
            self.config.idle.pop(self, None)

    def _make_room(self) -> bool:
        oldest = next(iter(self.config.idle), None)
        if oldest is None:
            return False
        self.config.reject("connections")
        del self.config.idle[oldest]
        oldest.transport.abort()
        self.connections.discard(oldest)
        return True

    def _await_head(self) -> None:
        if self._head_timer is None:
            self._head_timer = self.loop.call_later(self.config.limits.header_seconds, self._head_is_late)

    def _head_arrived(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None

    def _head_is_late(self) -> None:
        self._head_timer = None
        if self.transport.is_closing() or not self.is_idle:
            return
        self.config.reject("slow_head")
        seconds = self.config.limits.header_seconds
        self._refuse(document(TooSlow(f"The head of a request must arrive within {seconds:g} s (header_seconds).")))

    def send_400_response(self, msg: str) -> None:
        """Answer what is not valid HTTP with a problem document, like all other errors."""
        self._refuse(plain(OTHER, msg))

    def _refuse(self, said: Mapping[str, Any]) -> None:
        """Answer a request that is incomplete or was never sent, if that is still possible, and close the
        connection.
        """
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            request_id = new_request_id()
            if said["status"] < 500:  # refused connections are only counted, because there may be very many
                _log.info("request %s: %s", request_id, said["detail"])
            body = orjson.dumps({**said, "request_id": request_id})
            headers = safe_headers(MEDIA_TYPE) | {
                "Content-Type": MEDIA_TYPE,
                "Content-Length": str(len(body)),
                "Connection": "close",
                "X-Request-Id": request_id,
            }
            if said["status"] == 503:
                headers["Retry-After"] = "1"
            head = h11.Response(
                status_code=said["status"], headers=list(headers.items()), reason=said["title"].encode()
            )
            for event in (head, h11.Data(data=body), h11.EndOfMessage()):
                self.transport.write(self.conn.send(event) or b"")
        if not self.is_idle:  # the rest of the request is invalid, and its handler must not answer, too
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.close()
        self._abort_later()

    def _close_if_idle(self) -> None:
        if self.is_idle and not self.transport.is_closing():
            self.transport.close()
            self._abort_later()

    def _abort_later(self) -> None:
        """Reset the connection later, because a caller that does not read the answer must not hold it for ever."""
        self.loop.call_later(_FLUSH, self.transport.abort)
