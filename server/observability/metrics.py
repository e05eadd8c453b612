"""What Prometheus sees. One registry per app, so that several apps in one process do not share counters."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector

from server.observability.host_gauges import resident_bytes
from server.observability.metric_samples import Family, families

OTHER: Final = "other"
"""Label of all collections that are not named; one that is called so counts among them."""
_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class IndexState:
    """Of a live index: its revision and submaps, and the segments that are listed, with their bytes."""

    revision: int
    submaps: int
    segments: int = 0
    size: int = 0


class Metrics:
    """The service's counters, gauges and histograms."""

    content_type = CONTENT_TYPE_LATEST

    def __init__(self, collections: int = 20) -> None:
        """With at most `collections` named."""
        self.collections = collections
        self.registry = CollectorRegistry()
        self.requests = self._counter("requests", "Requests answered.", "route", "method", "status")
        self.request_seconds = self._histogram("request_seconds", "Time to answer.", "route", "method")
        self.rejected = self._counter(
            "requests_rejected",
            "Requests and connections that were refused to protect the others, by reason: overloaded, rate, memory, "
            "slow_head, slow_body, connections.",
            "reason",
        )
        self.in_flight = self._gauge("requests_in_flight", "Requests that are worked on.")
        self.queued = self._gauge("requests_queued", "Requests that wait for a place.")
        self.job_waits = self._gauge("job_waits", "Requests that wait for the end of a job.")
        self.open_connections = self._gauge("connections", "Open connections.")
        self.processes = self._gauge("processes", "Processes that answer requests.")
        self.processes.set(1)
        self.memory = self._gauge("memory_bytes", "Resident memory of all processes that answer requests.")
        self.memory.set_function(resident_bytes)
        self.verdicts = self._counter("query_verdicts", "Queries answered, by verdict.", "verdict")
        self.stage_seconds = self._histogram("query_stage_seconds", "Time of each stage of a query.", "stage")
        self.submaps_written = self._counter("submaps_written", "Submaps written, by outcome.", "outcome")
        self.segments_damaged = self._counter("segments_damaged", "Segments that could not be used.")
        self.maintenance_runs = self._counter(
            "maintenance_runs", "Times that segments were written or merged, files checked or removed.", "task"
        )
        self.maintenance_failures = self._counter(
            "maintenance_failures", "Those that failed and are tried again.", "task"
        )
        self.maintenance_seconds = self._counter("maintenance_seconds", "Time that they took.", "task")
        self._stages: dict[str, Histogram] = {}
        self._indexes: dict[str, IndexState] = {}
        self._guard = threading.Lock()
        self.registry.register(_Indexes(self.index_states))

    @contextmanager
    def maintenance(self, task: str) -> Iterator[None]:
        """Count and time a maintenance task."""
        began = time.perf_counter()
        try:
            yield
        except BaseException:
            self.maintenance_failures.labels(task).inc()
            raise
        finally:
            self.maintenance_runs.labels(task).inc()
            self.maintenance_seconds.labels(task).inc(time.perf_counter() - began)

    def observe_stage(self, name: str, milliseconds: float) -> None:
        """Record one stage of a query."""
        stage = self._stages.get(name)
        if stage is None:
            stage = self._stages[name] = self.stage_seconds.labels(name)
        stage.observe(milliseconds / 1000.0)

    def observe_index(self, collection: str, *, revision: int, submaps: int) -> None:
        """Record the state of a live index after it was caught up."""
        with self._guard:
            known = self._indexes.get(collection) or IndexState(0, 0)
            self._indexes[collection] = replace(known, revision=revision, submaps=submaps)

    def observe_segments(self, collection: str, count: int, size: int) -> None:
        """Record how many segments a collection has and their bytes."""
        with self._guard:
            known = self._indexes.get(collection) or IndexState(0, 0)
            self._indexes[collection] = replace(known, segments=count, size=size)

    def forget_index(self, collection: str) -> None:
        """Drop what was recorded of a collection that is no more."""
        with self._guard:
            self._indexes.pop(collection, None)

    def index_states(self) -> list[tuple[str, IndexState]]:
        """The largest live indexes by collection, as many as are named."""
        with self._guard:
            known = [(name, state) for name, state in self._indexes.items() if name != OTHER]
        return sorted(known, key=lambda one: (-one[1].submaps, one[0]))[: self.collections]

    def families(self) -> list[Family]:
        """All of this process as it is now."""
        return families(self.registry.collect())

    def _counter(self, name: str, about: str, *labels: str) -> Counter:
        return Counter(f"urquhart_{name}", about, labels, registry=self.registry)

    def _gauge(self, name: str, about: str) -> Gauge:
        return Gauge(f"urquhart_{name}", about, registry=self.registry)

    def _histogram(self, name: str, about: str, *labels: str) -> Histogram:
        return Histogram(f"urquhart_{name}", about, labels, buckets=_SECONDS, registry=self.registry)


def text_of(told: Iterable[Family]) -> bytes:
    """Families in Prometheus' text format."""
    registry = CollectorRegistry()
    registry.register(_Given([family.metric() for family in told]))
    return generate_latest(registry)


class _Given(Collector):
    def __init__(self, metrics: list[Metric]) -> None:
        self._metrics = metrics

    def collect(self) -> Iterable[Metric]:
        return self._metrics


class _Indexes(Collector):
    """The live indexes, reported when they are asked for: a gauge for each collection would be kept for all of them."""

    def __init__(self, states: Callable[[], list[tuple[str, IndexState]]]) -> None:
        self._states = states

    def describe(self) -> Iterable[Metric]:
        return self._families([])

    def collect(self) -> Iterable[Metric]:
        return self._families(self._states())

    def _families(self, states: list[tuple[str, IndexState]]) -> list[Metric]:
        told = {
            "revision": "Revision that the live index holds, of the process that is furthest behind.",
            "submaps": "Submaps in the live index.",
            "segments": "Segments listed for the collection.",
            "bytes": "Bytes of these segments on the disk.",
        }
        made: list[Metric] = []
        for name, about in told.items():
            family = GaugeMetricFamily(f"urquhart_index_{name}", about, labels=["collection"])
            for collection, state in states:
                family.add_metric([collection], float(getattr(state, "size" if name == "bytes" else name)))
            made.append(family)
        return made
