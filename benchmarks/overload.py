"""What slow callers cost the others: `python -m benchmarks.overload`.

A caller asks one query after another on one connection, first alone, then while many others send a body byte by byte,
or half a head, or nothing.
"""

import argparse
import json
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import httpx
import numpy as np

_SERVING: Final = re.compile(r"serving on http://127\.0\.0\.1:(\d+)")
_QUERY: Final = "/v1/collections/bench/queries"
_HEADS: Final = (
    b"POST /v1/collections/bench/queries HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
    b"Content-Length: 100000\r\n\r\n",
    b"GET /livez HTTP/1.1\r\nHost: ",
    b"",
)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slow", type=int, default=200, help="slow callers")
    parser.add_argument("--asked", type=int, default=600, help="queries in each part")
    parser.add_argument("--workers", default="1")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, _served(Path(folder), arguments.workers) as port:
        bodies = _store(port)
        for name, slow in (("alone", 0), (f"with {arguments.slow} slow callers", arguments.slow), ("alone again", 0)):
            with _slow_callers(port, slow) as held:
                times = _ask(port, bodies, arguments.asked)
                p50, p99 = np.percentile(times, (50, 99))
                print(f"{name}: p50 {p50:.2f} ms, p99 {p99:.2f} ms, slowest {max(times):.1f} ms; {held()} held")


def _store(port: int) -> list[bytes]:
    rng = np.random.default_rng(1)
    bodies = []
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60.0) as client:
        client.put("/v1/collections/bench", json={}).raise_for_status()
        for number in range(100):
            xy = rng.uniform(-40.0, 40.0, (60, 2))
            client.put(f"/v1/collections/bench/submaps/{number}", json={"xy": xy.tolist()}).raise_for_status()
            bodies.append(json.dumps({"xy": (xy + rng.normal(0.0, 0.05, xy.shape)).tolist()}).encode())
    return bodies


def _ask(port: int, bodies: list[bytes], asked: int) -> list[float]:
    """Milliseconds of each query."""
    times = []
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60.0) as client:
        for number in range(asked + 50):
            body = bodies[number % len(bodies)]
            began = time.perf_counter()
            client.post(_QUERY, content=body, headers={"Content-Type": "application/json"}).raise_for_status()
            if number >= 50:
                times.append((time.perf_counter() - began) * 1e3)
    return times


@contextmanager
def _slow_callers(port: int, count: int) -> Iterator["_Held"]:
    """Connections that send a byte every second, each opened anew when it is closed."""
    held, stop = _Held(count), threading.Event()

    def trickle() -> None:
        connections: list[socket.socket | None] = [None] * count
        while not stop.wait(1.0 if any(connections) else 0.0):
            for place, connection in enumerate(connections):
                if connection is None:
                    connection = connections[place] = socket.create_connection(("127.0.0.1", port))
                    connection.sendall(_HEADS[place % len(_HEADS)])
                try:
                    connection.send(b" " if place % len(_HEADS) == 0 else b"x" if place % len(_HEADS) == 1 else b"")
                except OSError:
                    connection.close()
                    connections[place] = None
            held.count = sum(connection is not None for connection in connections)
        for connection in filter(None, connections):
            with suppress(OSError):
                connection.close()

    thread = threading.Thread(target=trickle)
    if count:
        thread.start()
        time.sleep(2.0)
    try:
        yield held
    finally:
        stop.set()
        if count:
            thread.join()


class _Held:
    """How many connections are open."""

    def __init__(self, count: int) -> None:
        self.count = count

    def __call__(self) -> int:
        return self.count


@contextmanager
def _served(folder: Path, workers: str) -> Iterator[int]:
    command = [sys.executable, "-m", "server.cli", "serve", "--port", "0", "--workers", workers]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(
            [*command, "--database", str(folder / "bench.db")], stdout=subprocess.PIPE, stderr=log, text=True
        )
    try:
        assert process.stdout is not None
        said = _SERVING.search(process.stdout.readline())
        if said is None:
            raise RuntimeError("the server did not start")
        port = int(said.group(1))
        while not _ready(port):
            time.sleep(0.2)
        yield port
    finally:
        process.terminate()
        process.wait()


def _ready(port: int) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/readyz", timeout=10.0).status_code == 200
    except httpx.TransportError:
        return False


if __name__ == "__main__":
    main()
