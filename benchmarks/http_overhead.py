"""What the service adds: the same queries in the library and over HTTP in turn, and bulk ingest with its processes."""

import http.client
import json
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final
from urllib.parse import urlsplit

import numpy as np
import orjson

from benchmarks.everyday import Forest
from benchmarks.server_process import PATIENCE, served
from server.collections import crud
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import bulk_ingest
from server.submaps.described_batches import describers
from urquhart import Recognizer

COLLECTION: Final = "bench"


@dataclass(frozen=True, slots=True)
class HttpCost:
    """Medians over queries that were asked both ways, one after the other, milliseconds.

    Attributes:
        library: `Recognizer.recognize` in this process.
        http: from the first byte sent to the last one received, on one connection to a server on this machine.
        added: of the differences, query by query.
        answer_bytes: of an answer.
        agreed: queries with the same verdict and best submap both ways, of `asked`.
    """

    library: float
    http: float
    added: float
    answer_bytes: float
    agreed: int
    asked: int


@dataclass(frozen=True, slots=True)
class BulkRate:
    """Submaps a second into a file: of all that were stored, and of the second half, when the processes are there."""

    submaps: int
    processes: int
    overall: float
    sustained: float


def http_cost(
    recognizer: Recognizer,
    forest: Forest,
    rng: np.random.Generator,
    *,
    sigma: float,
    detection: float,
    asked: int = 300,
) -> HttpCost:
    """Ask `recognizer`, which holds `forest`, and a server that holds it, with observations of the forest."""
    library, over_http, sizes, agreed = [], [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.db"
        with _database(path) as database:
            for _ in bulk_ingest.ingest_lines(database, COLLECTION, _lines(forest, len(forest.submaps))):
                pass
        with _connected(path) as connection:
            for number in range(asked + 20):
                _, xy = forest.look(rng, sigma, detection)
                body = json.dumps({"xy": xy.tolist()}).encode()
                began = time.perf_counter()
                found = recognizer.locate(xy)
                between = time.perf_counter()
                raw = _post(connection, f"/v1/collections/{COLLECTION}/queries", body)
                ended = time.perf_counter()
                if number < 20:
                    continue  # the first ones find nothing in any cache
                library.append((between - began) * 1e3)
                over_http.append((ended - between) * 1e3)
                sizes.append(len(raw))
                answer = json.loads(raw)
                best = [int(one["submap_id"]) for one in answer["candidates"][:1]]
                there = [candidate.key for candidate in found.candidates[:1]]
                agreed += (answer["verdict"], best) == (found.verdict, there)
    added = median(b - a for a, b in zip(library, over_http, strict=True))
    return HttpCost(median(library), median(over_http), added, median(sizes), agreed, asked)


def bulk_rate(forest: Forest, submaps: int, processes: int | None = None) -> BulkRate:
    """Store NDJSON of `submaps` submaps, those of the forest over and over, each time a little to the side."""
    with tempfile.TemporaryDirectory() as folder, _database(Path(folder) / "bench.db") as database:
        with describers(processes) as workers:
            stored, half = 0, (0, 0.0)
            began = time.perf_counter()
            for batch in bulk_ingest.ingest_lines(
                database, COLLECTION, _lines(forest, submaps), bulk_ingest.LineOptions(workers=workers)
            ):
                stored += batch.created
                if not half[0] and 2 * stored >= submaps:
                    half = stored, time.perf_counter()
            ended = time.perf_counter()
        return BulkRate(stored, workers.processes, stored / (ended - began), (stored - half[0]) / (ended - half[1]))


def _lines(forest: Forest, submaps: int) -> Iterator[bytes]:
    for number in range(submaps):
        turn, index = divmod(number, len(forest.submaps))
        xy = forest.submaps[index] + 0.01 * turn
        yield orjson.dumps({"id": str(number), "xy": xy}, option=orjson.OPT_SERIALIZE_NUMPY)


@contextmanager
def _database(path: Path) -> Iterator[Database]:
    database = Database(path)
    try:
        migrations_runner.upgrade(database)
        crud.ensure(database, COLLECTION, CollectionPut())
        yield database
    finally:
        database.dispose()


@contextmanager
def _connected(path: Path) -> Iterator[http.client.HTTPConnection]:
    """A connection to a server that is ready, in a process of its own."""
    with served(path, path.with_suffix(".log")) as server:
        address = urlsplit(server.url)
        connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=PATIENCE)
        connection.connect()
        # Else the kernel waits for an acknowledgement between the head of a request and its body.
        connection.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        yield connection
        connection.close()


def _post(connection: http.client.HTTPConnection, path: str, body: bytes) -> bytes:
    connection.request("POST", path, body, {"Content-Type": "application/json"})
    response = connection.getresponse()
    raw = response.read()
    if response.status != 200:
        raise RuntimeError(f"the server answered {response.status}: {raw[:200]!r}")
    return raw
