"""Bodies that are small on the wire and large inside, deep, or built to keep a parser busy."""

import gzip
import tempfile
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.server_process import served

_ROUTES: Final = (
    ("PUT", "/v1/collections/any"),
    ("PATCH", "/v1/collections/plots"),
    ("PUT", "/v1/collections/plots/submaps/any"),
    ("POST", "/v1/collections/plots/submaps"),
    ("POST", "/v1/collections/plots/queries"),
)
_BYTES: Final = 8 * 1024 * 1024
"""The service's limit of a body."""
_LONGEST: Final = 2.0
"""Seconds for which a body may keep other callers from an answer to nothing (`/livez`)."""
_MOST: Final = 400.0
"""MB by which the server may grow over all of it."""


def run(*, quick: bool, seed: int) -> Figures:
    """Send each to each route; answers, seconds, and how long another caller waited meanwhile."""
    problems: list[str] = []
    rows = []
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "bodies.db", Path(folder) / "log") as server:
        with httpx.Client(base_url=server.url, timeout=120.0) as client, _Watch(server.url) as watch:
            client.put("/v1/collections/plots", json={}).raise_for_status()
            client.put("/v1/collections/plots/submaps/p", json=body(seed)).raise_for_status()
            memory = server.megabytes()
            for name, make, packed in _bodies(10 if quick else 1):
                raw = make()
                for method, path in _ROUTES[4:] if quick else _ROUTES:
                    headers = {"Content-Type": "application/json"} | ({"Content-Encoding": "gzip"} if packed else {})
                    watch.settle()
                    watch.longest = 0.0
                    began = time.perf_counter()
                    try:
                        response = client.request(method, path, content=raw, headers=headers)
                    except httpx.TransportError as error:
                        problems.append(f"{name} to {method} {path}: {type(error).__name__}")
                        continue
                    spent = time.perf_counter() - began
                    watch.settle()
                    rows.append((name, response.status_code, len(raw), spent, watch.longest))
                    if not 200 <= response.status_code < 500:
                        problems.append(f"{name} to {method} {path} is answered {response.status_code}")
                    if watch.longest > _LONGEST:
                        problems.append(f"{name} to {method} {path} keeps others waiting {watch.longest:.1f} s")
            grown = server.megabytes() - memory
            if grown > _MOST:
                problems.append(f"the server grew by {grown:.0f} MB")
        problems += server.failures()
    return {"bodies": _worst(rows), "megabytes": grown, "problems": problems[:40]}


def _bodies(divisor: int) -> Iterator[tuple[str, Callable[[], bytes], bool]]:
    """Name, how it is made, whether it is gzip; a tenth as large in a quick run."""
    size, deep = _BYTES // divisor, 100_000
    yield "gzip of zeros, 1 GB inside", lambda: _zeros(1_000_000_000 // divisor), True
    yield "gzip in gzip", lambda: gzip.compress(_zeros(1_000_000_000 // divisor)), True
    yield "empty gzip members", lambda: gzip.compress(b"", mtime=0) * (size // 20), True
    yield "gzip that ends early", lambda: gzip.compress(b'{"xy": []}' * 1000)[:-9], True
    yield "no gzip", lambda: b'{"xy": []}', True
    yield "lists in lists", lambda: b'{"xy": ' + b"[" * deep + b"]" * deep + b"}", False
    yield "objects in objects", lambda: b'{"properties": ' * deep + b"1" + b"}" * deep, False
    yield "lists that never close", lambda: b"[" * (size - 10), False
    yield "a thousand deep", lambda: b'{"properties": {"a": ' + b"[" * 900 + b"]" * 900 + b"}}", False
    yield "a number of many digits", lambda: b'{"xy": [[' + b"9" * (size - 100) + b", 1]]}", False
    yield "a fraction of many digits", lambda: b'{"xy": [[0.' + b"9" * (size - 100) + b", 1]]}", False
    yield "many members", lambda: b"{" + b",".join(b'"k%d":1' % i for i in range(size // 13)) + b"}", False
    yield "one member many times", lambda: b"{" + b",".join([b'"xy":1'] * (size // 8)) + b"}", False
    yield "empty points", lambda: b'{"xy": [' + b",".join([b"[]"] * (size // 4)) + b"]}", False
    yield "many points", lambda: b'{"xy": [' + b",".join(b"[%d,1]" % i for i in range(size // 13)) + b"]}", False
    yield "one long name", lambda: b'{"title": "' + b"a" * (size - 100) + b'"}', False
    yield "escapes", lambda: b'{"title": "' + rb"\u0000" * (size // 7) + b'"}', False
    yield "over the limit", lambda: b" " * (_BYTES + 1), False


def _zeros(count: int) -> bytes:
    packer, piece = zlib.compressobj(9, wbits=31), bytes(1_000_000)
    return b"".join(packer.compress(piece) for _ in range(count // len(piece))) + packer.flush()


class _Watch:
    """Asks for nothing, over and over; `longest` is the longest that it waited, seconds, `rounds` how often it did."""

    def __init__(self, url: str) -> None:
        self.longest = 0.0
        self.rounds = 0
        self._url, self._stop = url, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "_Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def settle(self) -> None:
        """Wait until what is under way is answered."""
        seen = self.rounds
        while self.rounds < seen + 2 and self._thread.is_alive():
            time.sleep(0.005)

    def _run(self) -> None:
        with httpx.Client(base_url=self._url, timeout=120.0) as client:
            while not self._stop.wait(0.01):
                began = time.perf_counter()
                client.get("/livez")
                self.longest = max(self.longest, time.perf_counter() - began)
                self.rounds += 1


def _worst(rows: list[tuple[str, int, int, float, float]]) -> list[Figures]:
    """A row for each body: its answers, and the worst over the routes."""
    return [
        {
            "body": name,
            "statuses": sorted({row[1] for row in rows if row[0] == name}),
            "bytes": max(row[2] for row in rows if row[0] == name),
            "seconds": max(row[3] for row in rows if row[0] == name),
            "others_waited": max(row[4] for row in rows if row[0] == name),
        }
        for name in dict.fromkeys(row[0] for row in rows)
    ]
