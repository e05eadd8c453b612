"""What HTTP adds: the same queries, in turn, to the service on loopback and to the library in this process."""

import time
from statistics import median
from typing import Any

import httpx
import orjson

from benchmarks.scale.asking import answer
from benchmarks.scale.database import COLLECTION, opened
from benchmarks.scale.job import Figures, Job, Steps, spread
from benchmarks.scale.observations import Observations
from benchmarks.scale.simulate import WARMING
from server.commands.demo.service import running_service
from server.threads import pin_threads
from urquhart import Config, warm_up

_TIMEOUT = 120.0


def run(job: Job) -> Figures:
    """Times of both, and by how much the service's answers differ from the library's: not at all."""
    queries = Observations.load(job.room, "inside-20")
    pin_threads()
    warm_up(Config())
    here, there, differing = list[float](), list[float](), 0
    with (
        opened(job.database) as catalog,
        running_service(job.database.absolute(), job.room / "service.log", keep=False) as (url, _),
        httpx.Client(base_url=url, timeout=_TIMEOUT, headers={"Content-Type": "application/json"}) as client,
    ):
        steps = Steps("asked over HTTP", job.asked)
        for number in [*range(len(queries) - WARMING, len(queries)), *range(job.asked)]:
            xy = queries.xy(number)
            body = orjson.dumps({"xy": xy.tolist()})
            start = time.perf_counter()
            response = client.post(f"/v1/collections/{COLLECTION}/queries", content=body)
            answered = time.perf_counter()
            found = answer(catalog, xy)
            there.append(1e3 * (answered - start))
            here.append(1e3 * (time.perf_counter() - answered))
            told: dict[str, Any] = response.raise_for_status().json()
            differing += told["verdict"] != found.verdict
            steps.done(number)
    here, there = here[WARMING:], there[WARMING:]
    return {
        "asked": job.asked,
        "library": spread(here),
        "http": spread(there),
        "added": median(there) - median(here),
        "differing": differing,
    }
