"""What is stored and asked: a forest in submaps of some 90 trees, and views of it that are new."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import orjson
from numpy.typing import NDArray

from benchmarks.scale.tiled_forest import World
from benchmarks.service.connection import Connection, request_bytes

COLLECTION: Final = "bench"
BASE: Final = f"/v1/collections/{COLLECTION}"
_QUERIES: Final = 200
_LOOK: Final = 0.1
_PATIENCE: Final = 300.0
_SETTLED: Final = 3.0
"""Seconds in which the index is written to segments after an import."""


@dataclass(frozen=True, slots=True)
class Workload:
    """Submaps, and queries as requests.

    Attributes:
        submaps: landmarks of each, (N, 2) float64, metres.
        views: landmarks of the queries, likewise.
        queries: the same as requests, byte by byte.
    """

    submaps: Sequence[NDArray[np.float64]]
    views: Sequence[NDArray[np.float64]]
    queries: Sequence[bytes]

    @staticmethod
    def make(submaps: int, seed: int) -> "Workload":
        """So many submaps of one forest, seen at 20 cm and 90 %, and 200 queries from inside it."""
        world = World(submaps, seed)
        views = [world.query("inside-20", number).xy.round(3) for number in range(_QUERIES)]
        queries = [query_request(view) for view in views]
        return Workload([world.submap(index).xy.round(3) for index in range(submaps)], views, queries)

    @property
    def trees(self) -> float:
        """Trees of a query, on the average."""
        return float(np.mean([len(view) for view in self.views]))

    def save(self, path: Path) -> Path:
        """Write it as the library's process reads it."""
        np.savez(
            path,
            submaps=np.concatenate(self.submaps),
            submap_offsets=np.cumsum([0, *map(len, self.submaps)]),
            queries=np.concatenate(self.views),
            query_offsets=np.cumsum([0, *map(len, self.views)]),
        )
        return path

    def fill(self, url: str) -> None:
        """Store the submaps in a service, and wait until it has them all. Raises RuntimeError."""
        lines = b"\n".join(
            orjson.dumps({"id": f"s{number}", "xy": xy.tolist()}) for number, xy in enumerate(self.submaps)
        )
        with Connection(url) as connection:
            _expect(connection, request_bytes("PUT", BASE, b"{}"), 201)
            _expect(connection, request_bytes("POST", f"{BASE}/imports", lines, "application/x-ndjson"), 202)
            until = time.monotonic() + _PATIENCE
            while _stored(connection) < len(self.submaps):
                if time.monotonic() > until:
                    raise RuntimeError(f"the submaps were not stored within {_PATIENCE:g} s")
                time.sleep(_LOOK)
            time.sleep(_SETTLED)
            for request in self.queries[:20]:
                _expect(connection, request, 200)


def query_request(xy: NDArray[np.float64], **members: object) -> bytes:
    """A query as a request."""
    return request_bytes("POST", f"{BASE}/queries", orjson.dumps({"xy": xy.tolist(), **members}))


def put_request(name: str, xy: NDArray[np.float64]) -> bytes:
    """A PUT of a submap as a request."""
    return request_bytes("PUT", f"{BASE}/submaps/{name}", orjson.dumps({"xy": xy.tolist()}))


def _expect(connection: Connection, request: bytes, status: int) -> bytes:
    answer = connection.send(request)
    if answer.status != status:
        raise RuntimeError(f"the service answered {answer.status}, not {status}: {answer.body[:200]!r}")
    return answer.body


def _stored(connection: Connection) -> int:
    found = orjson.loads(_expect(connection, request_bytes("GET", BASE), 200))
    return int(found["counts"]["submaps"])
