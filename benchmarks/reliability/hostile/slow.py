"""Callers that send a byte now and then, half a body and no more, or go away in the middle."""

import socket
import tempfile
import time
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.served import Served, served
from benchmarks.reliability.trees import body
from benchmarks.scale.job import spread

_HEAD: Final = (
    b"POST /v1/collections/plots/queries HTTP/1.1\r\nHost: here\r\nContent-Type: application/json\r\n"
    b"Content-Length: 4000\r\n"
)


def run(*, quick: bool, seed: int) -> Figures:
    """How long an honest caller waits while others dawdle, and what is left of those afterwards."""
    count, rounds, hold = (50, 20, 3.0) if quick else (400, 200, 90.0)
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "slow.db", Path(folder) / "log") as server:
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            client.put("/v1/collections/plots", json={}).raise_for_status()
            client.put("/v1/collections/plots/submaps/p", json=body(seed)).raise_for_status()
            before = _ask(client, rounds, seed, problems)
            memory = server.megabytes()
            heads = [_open(server, _HEAD[: 20 + number % 100]) for number in range(count)]
            halves = [_open(server, _HEAD + b"\r\n" + b'{"xy": [[1.0, ' * (number % 9)) for number in range(count)]
            began = time.perf_counter()
            during = []
            for number in range(rounds):
                time.sleep(hold / rounds)
                _dawdle([*heads, *halves][number % 7 :: 7])
                during += _ask(client, 1, seed, problems)
            memory = server.megabytes() - memory
            held = sum(_is_open(one) for one in (*heads, *halves))
            seconds = time.perf_counter() - began
            for number, one in enumerate((*heads, *halves)):
                if number % 2:  # some say that they go, others are cut off
                    one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
                one.close()
            after = _ask(client, rounds, seed, problems)
        code, stop_seconds = server.stop()
        if code not in (0, -15):
            problems.append(f"the server ended with {code}")
        problems += server.failures()
    return {
        "slow": 2 * count,
        "before": spread(before),
        "during": spread(during),
        "after": spread(after),
        "megabytes": memory,
        "held": held,
        "held_seconds": seconds,
        "stop_seconds": stop_seconds,
        "problems": problems[:20],
    }


def _open(server: Served, sent: bytes) -> socket.socket:
    address = urlsplit(server.url)
    connection = socket.create_connection((address.hostname, address.port or 80), timeout=30.0)
    connection.sendall(sent)
    return connection


def _dawdle(connections: list[socket.socket]) -> None:
    for connection in connections:
        try:
            connection.sendall(b" ")
        except OSError:
            continue  # the server has had enough of it, which is its right


def _is_open(connection: socket.socket) -> bool:
    connection.setblocking(False)
    try:
        while connection.recv(65536):  # what it was told before it was closed
            continue
        return False
    except BlockingIOError:
        return True
    except OSError:
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
