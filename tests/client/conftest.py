"""The service that the client's tests talk to: the real one, in this process and over a socket."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
import uvicorn
from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastapi import FastAPI

from server.app import create_app
from server.config.settings import Settings
from urquhart import Config, warm_up
from urquhart_client import Client


@pytest.fixture(params=["in process", "over a socket"])
def client(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Client]:
    """A client of a fresh, empty service."""
    app = create_app(Settings(database=str(tmp_path / "client.db")))
    if request.param == "in process":
        lifespan = app.router.lifespan_context(app)
        with start_blocking_portal() as portal, portal.wrap_async_context_manager(lifespan):
            yield Client("http://service", transport=_Inside(portal, app))
        return
    with _listening(app) as url, Client(url) as over_a_socket:
        yield over_a_socket


@pytest.fixture
def service_url(tmp_path: Path) -> Iterator[str]:
    """Where a fresh, empty service listens, whose kernels are loaded: no first query waits for the compiler."""
    warm_up(Config())
    with _listening(create_app(Settings(database=str(tmp_path / "client.db")))) as url:
        yield url


@contextmanager
def _listening(app: FastAPI) -> Iterator[str]:
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning"))
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            while not server.started and thread.is_alive():
                time.sleep(0.01)
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()


class _Inside(httpx.BaseTransport):
    """Hands requests to an app in this process, whose event loop runs behind a portal."""

    def __init__(self, portal: BlockingPortal, app: FastAPI) -> None:
        self._portal = portal
        self._app = httpx.ASGITransport(app, raise_app_exceptions=False)

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        # Whole, because what is read from a file can be read by one side only.
        headers = {name: value for name, value in request.headers.items() if name != "transfer-encoding"}
        whole = httpx.Request(request.method, request.url, headers=headers, content=request.read())
        return self._portal.call(self._handle, whole)

    async def _handle(self, request: httpx.Request) -> httpx.Response:
        answered = await self._app.handle_async_request(request)
        body = b"".join([chunk async for chunk in answered.aiter_raw()])
        return httpx.Response(answered.status_code, headers=answered.headers, content=body)
