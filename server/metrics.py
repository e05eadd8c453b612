"""What Prometheus sees. One registry per app, so that several apps in one process do not share counters."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.exposition import CONTENT_TYPE_LATEST

_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


class Metrics:
    """The service's counters, gauges and histograms."""

    content_type = CONTENT_TYPE_LATEST

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "urquhart_requests", "Requests answered.", ["route", "method", "status"], registry=self.registry
        )
        self.request_seconds = Histogram(
            "urquhart_request_seconds", "Time to answer.", ["route", "method"], buckets=_SECONDS, registry=self.registry
        )
        self.verdicts = Counter(
            "urquhart_query_verdicts", "Queries answered, by verdict.", ["verdict"], registry=self.registry
        )
        self.stage_seconds = Histogram(
            "urquhart_query_stage_seconds",
            "Time of each stage of a query.",
            ["stage"],
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.submaps_written = Counter(
            "urquhart_submaps_written", "Submaps written, by outcome.", ["outcome"], registry=self.registry
        )
        self.index_revision = Gauge(
            "urquhart_index_revision", "Revision that the live index holds.", ["collection"], registry=self.registry
        )
        self.index_submaps = Gauge(
            "urquhart_index_submaps", "Submaps in the live index.", ["collection"], registry=self.registry
        )
        self.index_lag = Gauge(
            "urquhart_index_lag_revisions",
            "Revisions that the live index was behind when it was last caught up.",
            ["collection"],
            registry=self.registry,
        )
        self.index_segments = Gauge(
            "urquhart_index_segments", "Segments listed for the collection.", ["collection"], registry=self.registry
        )
        self.index_bytes = Gauge(
            "urquhart_index_bytes", "Bytes of these segments on the disk.", ["collection"], registry=self.registry
        )
        self.segments_damaged = Counter(
            "urquhart_segments_damaged", "Segments that could not be used.", registry=self.registry
        )
        self.upkeep_runs = Counter(
            "urquhart_upkeep_runs",
            "Times that segments were written or merged, files checked or removed",
            ["task"],
            registry=self.registry,
        )
        self.upkeep_failures = Counter(
            "urquhart_upkeep_failures", "Those that failed and are tried again.", ["task"], registry=self.registry
        )
        self.upkeep_seconds = Counter(
            "urquhart_upkeep_seconds", "Time that they took.", ["task"], registry=self.registry
        )

    @contextmanager
    def upkeep(self, task: str) -> Iterator[None]:
        """Count and time a task of the upkeep."""
        began = time.perf_counter()
        try:
            yield
        except BaseException:
            self.upkeep_failures.labels(task).inc()
            raise
        finally:
            self.upkeep_runs.labels(task).inc()
            self.upkeep_seconds.labels(task).inc(time.perf_counter() - began)

    def observe_stage(self, name: str, milliseconds: float) -> None:
        """Record one stage of a query."""
        self.stage_seconds.labels(name).observe(milliseconds / 1000.0)

    def observe_index(self, collection: str, *, revision: int, submaps: int, lag: int) -> None:
        """Record the state of a live index after it was caught up."""
        self.index_revision.labels(collection).set(revision)
        self.index_submaps.labels(collection).set(submaps)
        self.index_lag.labels(collection).set(lag)

    def observe_segments(self, collection: str, count: int, size: int) -> None:
        """Record how many segments a collection has and their bytes."""
        self.index_segments.labels(collection).set(count)
        self.index_bytes.labels(collection).set(size)

    def forget_index(self, collection: str) -> None:
        """Drop the gauges of a collection that is no more."""
        gauges = (self.index_revision, self.index_submaps, self.index_lag, self.index_segments, self.index_bytes)
        for gauge in gauges:
            gauge.remove_by_labels({"collection": collection})

    def exposition(self) -> bytes:
        """All metrics in Prometheus' text format."""
        return generate_latest(self.registry)
