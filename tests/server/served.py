"""Servers on real sockets: `urquhart serve` as an operator starts it, and the app in a thread of this process."""

import os
import queue
import re
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
from fastapi import FastAPI
from uvicorn.server import Server

from server.app import create_app
from server.commands.serve import bind
from server.config.settings import Limits, Settings
from server.http.serving.connections import ServerConfig, TimedConnection
from server.service_parts import Service
from tests.server.forked import Forked
from tests.server.processes import spawned

_ROOT = Path(__file__).parents[2]
_SERVING = re.compile(r"serving on (http://127\.0\.0\.1:(\d+))")
PATIENCE = 120.0
_ASKED = 12
"""Answers in a row that say so before several processes are taken to be ready."""


class Served:
    """The command on a free port; `client` talks to it once it is ready."""

    def __init__(self, folder: Path, *options: str, files: int | None = None, **environment: str) -> None:
        """`files`: how many it may have open; None: as many as the tests."""
        self.log = folder / "served.log"
        self.temporary = folder / "tmp"
        self.temporary.mkdir(exist_ok=True)
        self.database = folder / "urquhart.db"
        self.said = folder / "served.out"
        self.process = Forked(
            "urquhart",
            ["serve", "--port", "0", "--database", str(self.database), *options],
            folder=folder,
            environment=os.environ | {"PYTHONPATH": str(_ROOT), "TMPDIR": str(self.temporary)} | environment,
            output=self.said,
            errors=self.log,
            files=files,
        )
        found: list[tuple[str, str]] = []

        def listening() -> bool:
            found.extend(_SERVING.findall(self.said.read_text()))
            return bool(found)

        wait_until(listening, self)
        self.url, self.port = found[0][0], int(found[0][1])
        self.client = httpx.Client(base_url=self.url, timeout=60.0)
        # Any of the processes may answer, so many are asked for before all are taken to be ready.
        asked = _ASKED if "--workers" in options else 1
        wait_until(lambda: all(self.ready() for _ in range(asked)), self)

    def ready(self) -> bool:
        """Whether a process says that it is ready."""
        try:
            return httpx.get(f"{self.url}/readyz", timeout=10.0).status_code == 200
        except httpx.TransportError:
            return False

    def workers(self) -> list[int]:
        """Process ids of those that answer requests."""
        return sorted(spawned(self.process.pid))

    def signal(self, number: int = signal.SIGTERM) -> None:
        """Send a signal to the one that was started."""
        self.process.send_signal(number)

    def wait(self) -> int:
        """The exit code."""
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        """End it, however."""
        self.client.close()
        if self.process.poll() is None:
            children = self.workers()
            self.process.kill()
            self.process.wait()
            for pid in children:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue


def wait_until(condition: Callable[[], bool], served: Served | None = None) -> None:
    """Until it holds, for as long as patience lasts."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        said = served.log.read_text() if served is not None else ""
        assert served is None or served.process.poll() is None, said
        assert time.monotonic() < deadline, said
        time.sleep(0.02)


def together(count: int, work: Callable[[int], object]) -> list[object]:
    """What `count` threads return that do this at once, in no order."""
    done: queue.Queue[object] = queue.Queue()
    threads = [threading.Thread(target=lambda number=number: done.put(work(number))) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    return [done.get_nowait() for _ in range(done.qsize())]


class Threaded:
    """An app on a real socket, in a thread of this process, so that its parts can be seen and held up."""

    def __init__(self, app: FastAPI) -> None:
        service: Service = app.state.service
        self.app, self.service = app, service
        self.listener = bind("127.0.0.1", 0)
        self.port = int(self.listener.getsockname()[1])
        self.url = f"http://127.0.0.1:{self.port}"
        config = ServerConfig(
            app, service.settings.limits, lambda reason: service.metrics.rejected.labels(reason).inc(), log_config=None
        )
        self._server = Server(config)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self.listener]})
        self._thread.start()
        self.client = httpx.Client(base_url=self.url, timeout=PATIENCE)
        wait_until(lambda: self._server.started)

    def connect(self) -> socket.socket:
        """A connection on which nothing was said."""
        return socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE)

    @property
    def connections(self) -> list[TimedConnection]:
        """Those that are open."""
        return [one for one in self._server.server_state.connections if isinstance(one, TimedConnection)]

    @property
    def busy(self) -> int:
        """Connections on which a request is at hand."""
        return sum(not one.is_idle for one in self.connections)

    def rejected(self, reason: str) -> float:
        """How many were refused for this reason."""
        value = self.service.metrics.registry.get_sample_value("urquhart_requests_rejected_total", {"reason": reason})
        return value or 0.0

    def close(self) -> None:
        """End it."""
        self.client.close()
        self._server.should_exit = self._server.force_exit = True
        self._thread.join(PATIENCE)
        self.listener.close()


def read_all(connection: socket.socket) -> bytes:
    """What comes until the other side closes; nothing where it only does that."""
    said = b""
    try:
        while piece := connection.recv(65536):
            said += piece
    except ConnectionResetError:
        return said
    return said


Start = Callable[..., Threaded]


@contextmanager
def starting(folder: Path, prepare: Callable[[Threaded], object] = lambda server: None) -> Iterator[Start]:
    """Starts servers over one database with the limits that are given; each is ready and has the collection `plots`.

    Queries have no deadline before a server is ready. `prepare` is done to each server before it is handed out.
    """
    started: list[Threaded] = []

    def start(**limits: float) -> Threaded:
        settings = Settings(database=str(folder / "urquhart.db"), limits=Limits.model_validate(limits))
        server = Threaded(create_app(settings))
        started.append(server)
        wait_until(lambda: server.service.readiness.ready)
        server.client.put("/v1/collections/plots", json={}).raise_for_status()
        prepare(server)
        return server

    try:
        yield start
    finally:
        for server in started:
            server.close()
