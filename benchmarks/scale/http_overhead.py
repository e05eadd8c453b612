"""What HTTP adds: the same queries, in turn, to the service on loopback and to the library in this process."""

import time
from statistics import median
from typing import Final

import httpx
import orjson

from benchmarks.scale.asking import answer
from benchmarks.scale.database import COLLECTION, opened
from benchmarks.scale.measurement import Figures, Measurement, Steps, spread
from benchmarks.scale.observations import Observations
from server.commands.demo.service import running_service
from server.platform.thread_limits import pin_threads
from urquhart import Config, warm_up

_TIMEOUT: Final = 120.0
_TURN: Final = 20
"""Queries."""


def run(measurement: Measurement) -> Figures:
    """Times of both, and how many of the service's verdicts differ from the library's, which none should.

    They take turns by a few queries, so that both see the same machine and neither begins each query with cold caches.
    """
    queries = Observations.load(measurement.room, "inside-20")
    pin_threads()
    warm_up(Config())
    here, there, nothing = dict[int, float](), dict[int, float](), list[float]()
    said, found = dict[int, str](), dict[int, str]()
    with (
        opened(measurement.database) as indexes,
        running_service(measurement.database.absolute(), measurement.room / "service.log", keep=False) as (url, _),
        httpx.Client(base_url=url, timeout=_TIMEOUT, headers={"Content-Type": "application/json"}) as client,
    ):
        steps = Steps("asked over HTTP", measurement.asked)
        for _ in range(measurement.asked):
            start = time.perf_counter()
            client.get("/livez").raise_for_status()
            nothing.append(1e3 * (time.perf_counter() - start))
        # The first turn is asked twice: what is counted is the second time.
        for first in [0, *range(0, measurement.asked, _TURN)]:
            turn = range(first, min(first + _TURN, measurement.asked))
            for number in turn:
                body = orjson.dumps({"xy": queries.xy(number).tolist()})
                start = time.perf_counter()
                response = client.post(f"/v1/collections/{COLLECTION}/queries", content=body)
                there[number] = 1e3 * (time.perf_counter() - start)
                said[number] = response.raise_for_status().json()["verdict"]
            for number in turn:
                xy = queries.xy(number)
                start = time.perf_counter()
                found[number] = answer(indexes, xy).verdict
                here[number] = 1e3 * (time.perf_counter() - start)
            steps.done(first)
    return {
        "asked": measurement.asked,
        "library": spread(list(here.values())),
        "empty": spread(nothing),
        "http": spread(list(there.values())),
        "added": median(there.values()) - median(here.values()),
        "differing": sum(said[number] != found[number] for number in found),
    }
