"""Two queries at a time in one process: whether they get in each other's way."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from benchmarks.scale.asking import answer
from benchmarks.scale.database import opened
from benchmarks.scale.measurement import Figures, Measurement
from benchmarks.scale.observations import Observations
from server.platform.thread_limits import pin_threads
from urquhart import Config, warm_up

THREADS: Final = (1, 2)


def run(measurement: Measurement) -> Figures:
    """Queries a second of one thread and of two: the same ones, after all of them were asked once."""
    queries = Observations.load(measurement.room, "inside-20")
    warm_up(Config())
    rates: dict[str, float] = {}
    with opened(measurement.database) as indexes:

        def ask(number: int) -> None:
            pin_threads()
            answer(indexes, queries.xy(number))

        for count in (max(THREADS), *THREADS):
            with ThreadPoolExecutor(count) as pool:
                start = time.perf_counter()
                list(pool.map(ask, range(measurement.asked)))
                rates[str(count)] = measurement.asked / (time.perf_counter() - start)
    return {"asked": measurement.asked, "queries_per_second": rates, "speedup": rates["2"] / rates["1"]}
