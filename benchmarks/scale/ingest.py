"""Storing: every submap described, durable and found by a query."""

import time

from benchmarks.scale.asking import answer
from benchmarks.scale.database import database_bytes, files_of, index_bytes, opened, settle, store
from benchmarks.scale.measurement import Figures, Measurement, Steps, memory
from benchmarks.scale.observations import Observations
from urquhart import Config, warm_up


def run(measurement: Measurement) -> Figures:
    """Fill a new database; seconds until all is durable, and until the index is built and a query answered; bytes."""
    for file in files_of(measurement.database):
        file.unlink()
    submaps = Observations.load(measurement.room, measurement.submaps_name)
    warm_up(Config())
    begun = time.perf_counter()
    processes = store(measurement.database, submaps, measurement.workers, Steps("stored", len(submaps)).done)
    durable = time.perf_counter()
    settle(measurement.database)
    with opened(measurement.database) as indexes:
        answer(indexes, submaps.xy(0))
        searchable = time.perf_counter()
    on_disk = index_bytes(measurement.database)
    return {
        "durable_seconds": durable - begun,
        "searchable_seconds": searchable - durable,
        "submaps_per_second": len(submaps) / (searchable - begun),
        "processes": processes,
        "database_bytes": database_bytes(measurement.database) / len(submaps),
        "index_bytes": None if on_disk is None else on_disk / len(submaps),
        "memory": memory(),
    }
