"""Many clients at once, all of them in one thread: each sends its next request as soon as it has its answer."""

import random
import re
import selectors
import socket
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import forest
from benchmarks.server_process import BenchmarkServer
from benchmarks.service.connection import connected, take_answer
from benchmarks.service.versions import cpu_seconds
from benchmarks.service.workload import Workload, put_request

_ENOUGH: Final = 1 << 18
_WRITES: Final = 0.1
"""Share of the requests of a fleet that store something."""
_WAIT: Final = 10.0
_REFUSED: Final = frozenset({429, 503})
Drawn = tuple[str, bytes]
"""A kind of request, and the request."""
Draw = Callable[[int], Callable[[], Drawn]]
"""By the number of a client: what makes its next request."""


@dataclass(slots=True)
class _Client:
    """A client: when it sent its request, of which kind, and what has arrived of the answer."""

    link: socket.socket
    draw: Callable[[], Drawn]
    kind: str = ""
    began: float = 0.0
    received: bytearray = field(default_factory=bytearray)

    def send(self) -> None:
        self.kind, request = self.draw()
        self.began = time.perf_counter()
        self.link.sendall(request)


def fleet(workload: Workload, seed: int) -> Draw:
    """Requests of robots: nine of ten are queries, the others store a submap of 60 trees that nobody has seen."""

    def client(number: int) -> Callable[[], Drawn]:
        rng, stored = random.Random(f"{seed}-{number}"), 0

        def draw() -> Drawn:
            nonlocal stored
            if rng.random() >= _WRITES:
                return "query", rng.choice(workload.queries)
            stored += 1
            return "put", put_request(f"w{seed}-{number}-{stored}", forest(seed, number, stored).round(3))

        return draw

    return client


def writers(workload: Workload, seed: int) -> Draw:
    """Requests that all store a view of the forest under a name of its own."""

    def client(number: int) -> Callable[[], Drawn]:
        stored = 0

        def draw() -> Drawn:
            nonlocal stored
            stored += 1
            # Moved a little, because the same trees would be the same content.
            view = workload.views[(number * 31 + stored) % len(workload.views)] + 0.001 * stored
            return "put", put_request(f"p{seed}-{number}-{stored}", view.round(3))

        return draw

    return client


def drive(server: BenchmarkServer, draw: Draw, *, clients: int, seconds: float) -> Figures:
    """So many clients for so long: answers a second, percentiles by kind, processor time of the service an answer."""
    times: dict[str, list[float]] = {}
    others = Counter[str]()
    with selectors.DefaultSelector() as selector:
        crew = [_Client(connected(server.url), draw(number)) for number in range(clients)]
        for client in crew:
            selector.register(client.link, selectors.EVENT_READ, client)
        cpu, own = cpu_seconds(server.process.pid), time.process_time()
        began = time.perf_counter()
        for client in crew:
            client.send()
        while (now := time.perf_counter()) < began + seconds:
            for key, _ in selector.select(_WAIT):
                _take(key.data, times, others)
        cpu, own = cpu_seconds(server.process.pid) - cpu, time.process_time() - own
        for client in crew:
            client.link.close()
    answered = sum(map(len, times.values()))
    return {
        "clients": clients,
        "answered": answered,
        "a_second": answered / (now - began),
        "cpu": 1e3 * cpu / max(answered, 1),
        "client_cpu": 1e3 * own / max(answered, 1),
        "kinds": {kind: _spread(found) for kind, found in sorted(times.items())},
        "others": dict(others),
    }


def _take(client: _Client, times: dict[str, list[float]], others: Counter[str]) -> None:
    data = client.link.recv(_ENOUGH)
    if not data:
        raise ConnectionError("the service closed a connection")
    client.received += data
    answer = take_answer(client.received)
    if answer is None:
        return
    if answer.status in (200, 201):
        times.setdefault(client.kind, []).append(1e3 * (time.perf_counter() - client.began))
    elif answer.status in _REFUSED:
        others[f"{client.kind}: {answer.status}"] += 1
    else:
        said = re.sub(rb"\s+", b" ", answer.body)[:200]
        raise RuntimeError(f"{client.kind}: the service answered {answer.status}: {said!r}")
    client.send()


def _spread(times: list[float]) -> Figures:
    p50, p95, p99 = np.percentile(times, (50, 95, 99)).tolist()
    return {"count": len(times), "p50": p50, "p95": p95, "p99": p99, "p99_to_p50": p99 / p50}
