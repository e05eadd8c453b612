"""What a library would do in the place of the service's own code.

Run as `python -m benchmarks.library_alternatives`; it takes two minutes.

Each experiment shows the one property for which the own code is kept (docs/decisions/0015-own-code-at-the-edge.md).
"""

import asyncio
import multiprocessing
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from benchmarks.server_process import served
from server.http.compression import DeflateAnswers
from server.platform.process_pool import IsolationPolicy, PoolTask, ProcessPool

_ANSWER: Final = 1_600_000
"""Bytes of an answer with some ten thousand pairs."""
_TASKS: Final = 100
_FATAL: Final = 50
"""The task that ends the process that does it, as the kernel does where memory runs out."""
_SILENT: Final = 50
_SILENCE: Final = 20.0
_STOP: Final = 30.0
"""Seconds after which a container's runtime kills what it has asked to stop."""
_APP: Final = """\
import asyncio

async def app(scope, receive, send):
    if scope["type"] == "http":
        await asyncio.sleep(60.0 if scope["path"] == "/slow" else 0.0)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"yes"})
"""


def main() -> None:
    """Every experiment, a line each."""
    for name, experiment in (
        ("compression", _compression),
        ("process pool", _pool),
        ("connection timers", _timers),
        ("supervisor", _supervisor),
    ):
        print(f"{name}: {experiment()}", flush=True)


def _compression() -> str:
    waits = {name: asyncio.run(_wait_beside(wrap)) for name, wrap in _COMPRESSIONS.items()}
    told = ", ".join(f"{name} {1e3 * seconds:.0f} ms" for name, seconds in waits.items())
    return f"while {_ANSWER / 1e6:.1f} MB are compressed, others wait: {told}"


_COMPRESSIONS: Final[dict[str, Callable[[ASGIApp], ASGIApp]]] = {
    "GZipMiddleware": GZipMiddleware,
    "the service's": DeflateAnswers,
}


async def _wait_beside(wrap: Callable[[ASGIApp], ASGIApp]) -> float:
    """The longest time in which the event loop answers nobody, seconds."""
    rng = random.Random(0)
    body = ",".join(f"{rng.uniform(-100.0, 100.0):.3f}" for _ in range(_ANSWER // 8)).encode()

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-type", b"application/json")]})
        await send({"type": "http.response.body", "body": body})

    async def receive() -> Message:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Message) -> None:
        return

    longest, done = 0.0, asyncio.Event()

    async def beside() -> None:
        nonlocal longest
        while not done.is_set():
            began = time.perf_counter()
            await asyncio.sleep(0.001)
            longest = max(longest, time.perf_counter() - began - 0.001)

    watch = asyncio.create_task(beside())
    await asyncio.sleep(0.01)
    scope = {"type": "http", "method": "GET", "path": "/", "headers": [(b"accept-encoding", b"gzip")]}
    await wrap(answer)(scope, receive, send)
    done.set()
    await watch
    return longest


def _work(number: int) -> int:
    """A task; one of them ends its process, where that is not the one that gives the tasks."""
    time.sleep(0.05)
    if number == _FATAL and multiprocessing.parent_process() is not None:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


_REFUSED: Final = -1


def _same(number: int) -> int:
    return number


def _pool() -> str:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        lost = sum(_is_lost(future) for future in [executor.submit(_work, number) for number in range(_TASKS)])
    apart: IsolationPolicy[int, int] = IsolationPolicy(
        is_light=lambda number: False,
        singles=lambda number: [number],
        refuse=lambda number, why: _REFUSED,
        seconds=10.0,
    )
    with ProcessPool(2, warm_up=_nothing) as pool:
        done = list(pool.map(PoolTask(here=_work, pack=_same, there=_work, apart=apart), range(_TASKS)))
    return (
        f"a task ends its process: ProcessPoolExecutor loses {lost - 1} of {_TASKS - 1} others, "
        f"the service's {done.count(_REFUSED) - 1}"
    )


def _nothing() -> None:
    """What a process has to load."""


def _is_lost(future: "Future[int]") -> bool:
    try:
        future.result()
    except BrokenProcessPool:
        return True
    return False


def _timers() -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with _uvicorn(folder) as (_, port):
            theirs = _left_open(port)
        with served(folder / "a.db", folder / "log") as server:
            ours = _left_open(int(server.url.rpartition(":")[2]))
    return (
        f"of {_SILENT} connections that send half a head and fall silent, after {_SILENCE:g} s uvicorn alone keeps "
        f"{theirs}, the service {ours}"
    )


def _left_open(port: int) -> int:
    """How many silent connections are still open in the end."""
    connections = [socket.create_connection(("127.0.0.1", port)) for _ in range(_SILENT)]
    for connection in connections:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
    time.sleep(_SILENCE)
    left = 0
    for connection in connections:
        connection.setblocking(False)
        try:
            connection.recv(1)  # an answer or the end of the connection
        except BlockingIOError:
            left += 1
        except ConnectionError:
            pass
        connection.close()
    return left


def _supervisor() -> str:
    with tempfile.TemporaryDirectory() as name:
        with _uvicorn(Path(name), "--workers", "2") as (process, _):
            started = _children(process.pid)
            process.kill()
            process.wait()
            time.sleep(2.0)
            left = [pid for pid in started if Path(f"/proc/{pid}").exists()]
            for pid in left:
                os.kill(pid, signal.SIGKILL)
        with _uvicorn(Path(name), "--workers", "2") as (process, port):
            with socket.create_connection(("127.0.0.1", port)) as slow:
                slow.sendall(b"GET /slow HTTP/1.1\r\nHost: a\r\n\r\n")
                time.sleep(0.5)
                children, began = _children(process.pid), time.perf_counter()
                process.terminate()
                try:
                    process.wait(_STOP)
                    ended = f"after {time.perf_counter() - began:.0f} s"
                except subprocess.TimeoutExpired:
                    ended = f"not within {_STOP:g} s"
            for pid in [process.pid, *children]:
                _kill(pid)
    return (
        f"killed, uvicorn's leaves {len(left)} of its {len(started)} processes behind; told to stop beside a request "
        f"of a minute, it ends {ended}"
    )


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()]


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


@contextmanager
def _uvicorn(folder: Path, *arguments: str) -> "Iterator[tuple[subprocess.Popen[bytes], int]]":
    """uvicorn by itself with a small app, and its port."""
    (folder / "small.py").write_text(_APP, encoding="utf-8")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    command = [sys.executable, "-m", "uvicorn", "small:app", "--port", str(port), "--log-level", "error", *arguments]
    process: subprocess.Popen[bytes] = subprocess.Popen(command, cwd=folder)
    try:
        _wait_for(port)
        yield process, port
    finally:
        process.kill()
        process.wait()


def _wait_for(port: int) -> None:
    """Until somebody listens. Raises RuntimeError."""
    for _ in range(600):
        try:
            socket.create_connection(("127.0.0.1", port)).close()
        except OSError:
            time.sleep(0.05)
        else:
            time.sleep(1.0)  # each of several workers
            return
    raise RuntimeError("uvicorn did not start")


if __name__ == "__main__":
    main()
