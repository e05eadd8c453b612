"""Gauges that are read from the database at each scrape: collections and their sizes, jobs, and how far indexes lag."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from server.errors import StorageError
from server.observability.host_gauges import host_gauges
from server.observability.metric_samples import Family, Key, merged
from server.observability.metrics import OTHER, Metrics, text_of
from server.observability.metrics_exchange import MetricsExchange
from server.store.records import CollectionSize
from server.store.storage import Storage

_UP: Final = "Whether the database could be read for this answer."


@dataclass(frozen=True, slots=True)
class Sizes:
    """The largest collections, the totals of all, and unfinished jobs by state."""

    largest: Sequence[CollectionSize]
    collections: int
    submaps: int
    landmarks: int
    jobs: dict[str, int]


def exposition(database: Storage, metrics: Metrics, exchange: MetricsExchange | None) -> bytes:
    """The metrics of all processes in Prometheus' text format. One of them says whether the database can be read."""
    elsewhere = [] if exchange is None else exchange.others()
    told = [*merged([metrics.families(), *elsewhere]), *host_gauges(database.path)]
    try:
        sizes = read_sizes(database, metrics.collections)
    except StorageError:
        return text_of([*told, _family("database_readable", _UP, {"": 0.0})])
    return text_of([*_by_name(told, sizes), *_of_rows(sizes, told), _family("database_readable", _UP, {"": 1.0})])


def read_sizes(database: Storage, most: int) -> Sizes:
    """At most `most` collections, largest first, and the totals. Raises StorageError."""
    with database.read() as tx:
        collections = tx.collections
        largest = [size for size in collections.largest(most + 1) if size.id != OTHER][:most]
        return Sizes(largest, *collections.totals(), tx.jobs.by_state())


def _by_name(told: Sequence[Family], sizes: Sizes) -> list[Family]:
    """Remove the indexes of collections that are not among the largest, because each process has named others."""
    names = {size.id for size in sizes.largest}
    return [
        Family(
            one.name, one.kind, one.about, {key: value for key, value in one.samples.items() if _label(key) in names}
        )
        if one.name.startswith("urquhart_index_")
        else one
        for one in told
    ]


def _of_rows(sizes: Sizes, told: Sequence[Family]) -> list[Family]:
    submaps = {size.id: float(size.submaps) for size in sizes.largest}
    landmarks = {size.id: float(size.landmarks) for size in sizes.largest}
    if sizes.collections > len(sizes.largest):
        submaps[OTHER] = sizes.submaps - sum(submaps.values())
        landmarks[OTHER] = sizes.landmarks - sum(landmarks.values())
    revisions = next((one.samples for one in told if one.name == "urquhart_index_revision"), {})
    held = {_label(key): revision for key, revision in revisions.items()}
    lag = {size.id: max(size.revision - held[size.id], 0.0) for size in sizes.largest if size.id in held}
    return [
        _family("collections", "Collections in the database.", {"": float(sizes.collections)}),
        _family("submaps", "Submaps in the database.", submaps),
        _family("landmarks", "Landmarks in the database.", landmarks),
        _family("jobs", "Jobs that are not finished.", {state: float(n) for state, n in sizes.jobs.items()}, "state"),
        _family(
            "index_lag_revisions",
            "Revisions that a live index is behind the database; the next query catches up first.",
            lag,
        ),
    ]


def _family(name: str, about: str, values: dict[str, float], by: str = "collection") -> Family:
    """A gauge with one label, or without a label for the empty name."""
    name = f"urquhart_{name}"
    samples: dict[Key, float] = {(name, ((by, label),) if label else ()): value for label, value in values.items()}
    return Family(name, "gauge", about, samples)


def _label(key: Key) -> str:
    return dict(key[1]).get("collection", "")
