"""Two queries at a time in one process: whether they get in each other's way."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from benchmarks.scale.asking import answer
from benchmarks.scale.database import opened
from benchmarks.scale.job import Figures, Job
from benchmarks.scale.observations import Observations
from benchmarks.scale.simulate import WARMING
from server.threads import pin_threads
from urquhart import Config, warm_up

THREADS: Final = (1, 2)


def run(job: Job) -> Figures:
    """Queries a second of one thread and of two, half of the queries each."""
    queries = Observations.load(job.room, "inside-20")
    warm_up(Config())
    rates: dict[str, float] = {}
    half = job.asked // 2
    with opened(job.database) as catalog:

        def ask(number: int) -> None:
            pin_threads()
            answer(catalog, queries.xy(number))

        for at, count in enumerate(THREADS):
            with ThreadPoolExecutor(count) as pool:
                list(pool.map(ask, range(len(queries) - WARMING, len(queries))))
                start = time.perf_counter()
                list(pool.map(ask, range(at * half, (at + 1) * half)))
                rates[str(count)] = half / (time.perf_counter() - start)
    return {"asked": half, "queries_per_second": rates, "speedup": rates["2"] / rates["1"]}
