"""Callers that send a byte now and then, half a body and no more, or go away in the middle."""

import socket
import tempfile
import threading
import time
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.scale.measurement import spread
from benchmarks.server_process import BenchmarkServer, served

_HEAD: Final = (
    b"POST /v1/collections/plots/queries HTTP/1.1\r\nHost: here\r\nContent-Type: application/json\r\n"
    b"Content-Length: 4000\r\n"
)
_HALF: Final = b'{"xy": [[1.0, '
_BETWEEN: Final = 1.0
"""Seconds between two bytes of a caller."""
_LEAST: Final = 0.25
"""Share of the slow callers that is there on the average, though each is sent away in its time."""


def run(*, quick: bool, seed: int) -> Figures:
    """How long an honest caller waits while others dawdle, and what is left of those afterwards."""
    count, asked = (100, 40) if quick else (200, 2_000)
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "slow.db", Path(folder) / "log") as server:
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            client.put("/v1/collections/plots", json={}).raise_for_status()
            client.put("/v1/collections/plots/submaps/p", json=body(seed)).raise_for_status()
            _ask(client, asked // 10, seed, problems)
            before = _ask(client, asked, seed, problems)
            memory = server.megabytes()
            with _Crowd(server, count) as crowd:
                time.sleep(_BETWEEN)
                during = _ask(client, asked, seed, problems)
                memory = server.megabytes() - memory
                # As long as it takes until the patience with the last of them is at its end.
                time.sleep(0.0 if quick else 30.0)
            after = _ask(client, asked, seed, problems)
        code, stop_seconds = server.stop()
        if code not in (0, -15):
            problems.append(f"the server ended with {code}")
        if crowd.held < _LEAST * count:
            problems.append(f"of {count} slow callers only {crowd.held:.0f} were there")
        problems += server.failures()
    return {
        "slow": count,
        "before": spread(before),
        "during": spread(during),
        "after": spread(after),
        "megabytes": memory,
        "held": crowd.held,
        "sent_away": crowd.sent_away,
        "longest_seconds": crowd.longest,
        "stop_seconds": stop_seconds,
        "problems": problems[:20],
    }


class _Crowd:
    """Slow callers, as many all the time: who is sent away comes again, and in the end all go, some without a word.

    Attributes:
        held: how many were there on the average.
        sent_away: how often one was.
        longest: seconds that one was there at most.
    """

    def __init__(self, server: BenchmarkServer, count: int) -> None:
        self.held, self.sent_away, self.longest = 0.0, 0, 0.0
        address = urlsplit(server.url)
        self._address = (address.hostname, address.port or 80)
        self._count, self._stop = count, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "_Crowd":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        there: dict[int, tuple[socket.socket, float]] = {}
        rounds, seen = 0, 0
        while not self._stop.is_set():
            for number in range(self._count):
                if number not in there:
                    there[number] = self._open(number), time.monotonic()
                connection, since = there[number]
                if not _goes_on(connection):
                    self.sent_away += 1
                    self.longest = max(self.longest, time.monotonic() - since)
                    connection.close()
                    del there[number]
                if self._stop.wait(_BETWEEN / self._count):
                    break
            rounds, seen = rounds + 1, seen + len(there)
        self.held = seen / max(rounds, 1)
        for number, (connection, since) in there.items():
            self.longest = max(self.longest, time.monotonic() - since)
            if number % 2:  # cut off
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
            connection.close()

    def _open(self, number: int) -> socket.socket:
        connection = socket.create_connection(self._address, timeout=30.0)
        connection.sendall(_HEAD + b"\r\n" + _HALF * (number % 9) if number % 2 else _HEAD[: 20 + number % 100])
        connection.setblocking(False)
        return connection


def _goes_on(connection: socket.socket) -> bool:
    """Send another byte; whether the server still listens."""
    try:
        connection.send(b" ")
        while connection.recv(65536):  # what it is told before it is sent away
            continue
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def _ask(client: httpx.Client, count: int, seed: int, problems: list[str]) -> list[float]:
    times = []
    for _ in range(count):
        began = time.perf_counter()
        response = client.post("/v1/collections/plots/queries", json=body(seed))
        times.append(1e3 * (time.perf_counter() - began))
        if response.status_code != 200 or response.json()["verdict"] != "matched":
            problems.append(f"an honest query was answered {response.status_code}: {response.text[:200]}")
    return times
