"""Starting: a fresh process, from nothing to its first answer."""

import time

from benchmarks.scale.asking import answer
from benchmarks.scale.database import opened
from benchmarks.scale.measurement import Figures, Measurement, memory, seconds_alive
from benchmarks.scale.observations import Observations
from urquhart import Config, warm_up

_ALIVE = seconds_alive()
"""Until everything was imported."""


def run(measurement: Measurement) -> Figures:
    """Seconds of each step. The kernels come from their cache, or are compiled where that is empty."""
    queries = Observations.load(measurement.room, "inside-20")
    begun = time.perf_counter()
    warm_up(Config())
    compiled = time.perf_counter()
    with opened(measurement.database) as indexes:
        ready = time.perf_counter()
        for _ in indexes.warm_up():
            pass
        indexed = time.perf_counter()
        answer(indexes, queries.xy(0))
        answered = time.perf_counter()
    return {
        "imports_seconds": _ALIVE,
        "kernels_seconds": compiled - begun,
        "open_seconds": ready - compiled,
        "index_seconds": indexed - ready,
        "first_query_seconds": answered - indexed,
        "ready_seconds": answered - compiled,
        "memory": memory(),
    }
