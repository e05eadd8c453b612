"""A client of HTTP/1.1 that costs next to nothing, so that what is measured is the service.

It knows what the service sends and nothing else: answers with Content-Length, over a connection that stays open.
"""

import re
import socket
from typing import Final, NamedTuple
from urllib.parse import urlsplit

_LENGTH: Final = re.compile(rb"\r\ncontent-length: *(\d+)\r\n", re.IGNORECASE)
_ENOUGH: Final = 1 << 18
"""Bytes that are read at once."""
_TIMEOUT: Final = 120.0


class HttpAnswer(NamedTuple):
    """Status and body of an answer."""

    status: int
    body: bytes


def address_of(url: str) -> tuple[str, int]:
    """Host and port of a URL. Raises ValueError for one without a port."""
    parts = urlsplit(url)
    if parts.hostname is None or parts.port is None:
        raise ValueError(f"{url} has no host and port")
    return parts.hostname, parts.port


def request_bytes(method: str, path: str, body: bytes = b"", content_type: str = "application/json") -> bytes:
    """A whole request, to be sent as often as one likes."""
    head = f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    if body:
        head += f"Content-Type: {content_type}\r\nContent-Length: {len(body)}\r\n"
    return head.encode() + b"\r\n" + body


def take_answer(received: bytearray) -> HttpAnswer | None:
    """The answer, if it has arrived completely; it is taken out of the buffer.

    Raises:
        ValueError: it has no Content-Length.
    """
    end = received.find(b"\r\n\r\n")
    if end < 0:
        return None
    status = int(received[9:12])
    found = _LENGTH.search(received, 0, end + 2)
    if found is None and status not in (204, 304):
        raise ValueError(f"an answer without Content-Length: {bytes(received[:end])!r}")
    whole = end + 4 + (int(found[1]) if found is not None else 0)
    if len(received) < whole:
        return None
    body = bytes(received[end + 4 : whole])
    del received[:whole]
    return HttpAnswer(status, body)


class Connection:
    """One connection, for one request at a time."""

    def __init__(self, url: str) -> None:
        self._socket = connected(url)
        self._socket.settimeout(_TIMEOUT)
        self._received = bytearray()

    def send(self, request: bytes) -> HttpAnswer:
        """Send a request of `request_bytes`; its answer. Raises ConnectionError."""
        self._socket.sendall(request)
        while (answer := take_answer(self._received)) is None:
            data = self._socket.recv(_ENOUGH)
            if not data:
                raise ConnectionError("the service closed the connection")
            self._received += data
        return answer

    def close(self) -> None:
        """Close it."""
        self._socket.close()

    def __enter__(self) -> "Connection":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def connected(url: str) -> socket.socket:
    """A connected socket that sends at once."""
    opened = socket.create_connection(address_of(url))
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return opened
