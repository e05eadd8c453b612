"""Samples of metrics apart from the process that counted them: as JSON, and merged over several processes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from prometheus_client.core import Metric
from prometheus_client.samples import Sample

Key = tuple[str, tuple[tuple[str, str], ...]]
"""Name of a sample, and its labels in order."""

# What a gauge of all processes is; others are sums.
_MODES: Final[dict[str, Callable[[float, float], float]]] = {
    "urquhart_index_revision": min,
    "urquhart_index_submaps": max,
    "urquhart_index_segments": max,
    "urquhart_index_bytes": max,
}
_KEPT: Final = frozenset({"counter", "histogram"})
"""Types whose samples count on when the process that made them is gone."""


@dataclass(frozen=True, slots=True)
class Family:
    """A metric with its samples."""

    name: str
    kind: str
    about: str
    samples: dict[Key, float]

    def metric(self) -> Metric:
        """As the library has it."""
        metric = Metric(self.name, self.about, self.kind)
        metric.samples = [Sample(name, dict(labels), value) for (name, labels), value in self.samples.items()]
        return metric


def families(collected: Iterable[Metric]) -> list[Family]:
    """What a registry collected; without the time at which each was made, which is of no use."""
    return [
        Family(
            metric.name,
            metric.type,
            metric.documentation,
            {
                (sample.name, tuple(sample.labels.items())): sample.value
                for sample in metric.samples
                if not sample.name.endswith("_created")
            },
        )
        for metric in collected
    ]


def merged(several: Sequence[Sequence[Family]]) -> list[Family]:
    """The families of several processes as one: sums, and for some gauges the least or the greatest."""
    made: dict[str, Family] = {}
    for process in several:
        for family in process:
            known = made.setdefault(family.name, Family(family.name, family.kind, family.about, {}))
            mode = _MODES.get(family.name)
            for key, value in family.samples.items():
                before = known.samples.get(key)
                if before is None:
                    known.samples[key] = value
                else:
                    known.samples[key] = before + value if mode is None else mode(before, value)
    return list(made.values())


def cumulative(told: Iterable[Family]) -> list[Family]:
    """What counts on after a process has ended."""
    return [family for family in told if family.kind in _KEPT]


def to_json(told: Iterable[Family]) -> list[Any]:
    """As JSON can hold it."""
    return [
        [family.name, family.kind, family.about, [[name, labels, value] for (name, labels), value in samples.items()]]
        for family in told
        for samples in [family.samples]
    ]


def from_json(words: list[Any]) -> list[Family]:
    """The reverse."""
    return [
        Family(
            name,
            kind,
            about,
            {(sample, tuple((label, text) for label, text in labels)): value for sample, labels, value in samples},
        )
        for name, kind, about, samples in words
    ]
