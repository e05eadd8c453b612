"""Connections are accepted at a limited rate, and none that waits is lost at the end."""

import asyncio
import errno
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from server.http.serving import acceptor
from server.http.serving.acceptor import Acceptor

_LOOKS = 1000
"""Passes of the event loop after which nothing more is expected to happen."""


@contextmanager
def _callers(count: int) -> Iterator[socket.socket]:
    """A listening socket with callers that wait to be accepted."""
    with socket.create_server(("127.0.0.1", 0), backlog=2 * count) as listener:
        callers = [socket.create_connection(listener.getsockname()) for _ in range(count)]
        yield listener
        for caller in callers:
            caller.close()


class _Counted(asyncio.Protocol):
    """Counts connections, and closes them."""

    def __init__(self, made: list[asyncio.BaseTransport]) -> None:
        self._made = made

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._made.append(transport)
        transport.close()


async def _pass() -> None:
    for _ in range(_LOOKS):
        await asyncio.sleep(0)


def test_a_crowd_waits_and_is_accepted_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acceptor, "_BURST", 3.0)
    monkeypatch.setattr(acceptor, "_PER_SECOND", 1e-3)
    made = list[asyncio.BaseTransport]()

    async def serve(listener: socket.socket) -> tuple[int, int]:
        accepting = Acceptor([listener], lambda: _Counted(made))
        await _pass()
        before = len(made)
        await accepting.finish()
        await _pass()
        return before, len(made)

    with _callers(10) as listener:
        assert asyncio.run(serve(listener)) == (3, 10)


def test_the_rate_lets_them_in_one_after_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acceptor, "_BURST", 1.0)
    monkeypatch.setattr(acceptor, "_PER_SECOND", 1e3)
    made = list[asyncio.BaseTransport]()
    everyone = 20

    async def serve(listener: socket.socket) -> None:
        Acceptor([listener], lambda: _Counted(made))
        async with asyncio.timeout(60.0):
            while len(made) < everyone:
                await asyncio.sleep(0)

    with _callers(everyone) as listener:
        asyncio.run(serve(listener))


def test_what_cannot_be_accepted_is_one_line(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(acceptor, "_RETRY", 0.0)

    class Full(socket.socket):
        tries = 0

        def accept(self) -> tuple[socket.socket, object]:
            self.tries += 1
            raise OSError(errno.EMFILE, "Too many open files")

    async def serve(listener: Full) -> None:
        Acceptor([listener], asyncio.Protocol)
        async with asyncio.timeout(60.0):
            while listener.tries < 100:
                await asyncio.sleep(0)

    with _callers(1) as listener, Full(fileno=socket.dup(listener.fileno())) as full, caplog.at_level(logging.ERROR):
        asyncio.run(serve(full))
    assert [record.name for record in caplog.records] == [acceptor.__name__]
