"""What is asked of a large database, whether it is met, and why not where it is not."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

Parts = Mapping[str, Any]
"""Figures of one size by part."""

ASKED_OF: Final = (100_000, 1_000_000)
"""Sizes that something is asked of."""

CAUSES: Final[dict[tuple[str, int], str]] = {}
"""Why a requirement is missed at a size, for the page, by its name and the number of submaps."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """One line of the table.

    Attributes:
        name: what is measured.
        unit: behind the figure.
        digits: after the point.
        least: whether the bound is the smallest allowed; else the largest.
        bounds: for each size of `ASKED_OF`.
        figure: from the parts of a size; None where it is not known.
    """

    name: str
    unit: str
    digits: int
    least: bool
    bounds: tuple[float, float]
    figure: Callable[[Parts], float | None]

    def bound(self, submaps: int) -> float:
        """The bound at one of the sizes of `ASKED_OF`."""
        return self.bounds[ASKED_OF.index(submaps)]

    def met(self, parts: Parts, submaps: int) -> bool | None:
        """Whether it is met; None where the figure is not known."""
        value = self.figure(parts)
        if value is None:
            return None
        return value >= self.bound(submaps) if self.least else value <= self.bound(submaps)

    def show(self, value: float | None) -> str:
        """A figure with its unit; a dash where there is none."""
        return "-" if value is None else f"{value:,.{self.digits}f}{self.unit}"

    def show_bound(self, submaps: int) -> str:
        """The bound at a size, as read aloud."""
        return f"{'at least' if self.least else 'at most'} {self.show(self.bound(submaps))}"


def look(*path: str) -> Callable[[Parts], float | None]:
    """What reads the figure under a path of names; None where a name is not there."""

    def read(parts: Parts) -> float | None:
        value: Any = parts
        for name in path:
            value = value.get(name) if isinstance(value, Mapping) else None
        return None if value is None else float(value)

    return read


def resident(parts: Parts) -> float | None:
    """Gigabytes in memory after the queries, of the kind of query that needs most."""
    found = [
        figures["memory"]["resident"] / 1000.0
        for name, figures in parts.items()
        if name.startswith(("inside", "outside"))
    ]
    return max(found, default=None)


def per(divisor: float, read: Callable[[Parts], float | None]) -> Callable[[Parts], float | None]:
    """The same figure in a larger unit."""

    def scaled(parts: Parts) -> float | None:
        value = read(parts)
        return None if value is None else value / divisor

    return scaled


REQUIREMENTS: Final = (
    Requirement("recall@1, 20 cm, 90 %", "", 4, True, (0.99, 0.99), look("inside-20", "recall")),
    Requirement("query p50, 20 cm, 90 %", " ms", 1, False, (10.0, 40.0), look("inside-20", "milliseconds", "p50")),
    Requirement("query p95, 20 cm, 90 %", " ms", 1, False, (30.0, 120.0), look("inside-20", "milliseconds", "p95")),
    Requirement("recall@1, 40 cm, 80 %", "", 4, True, (0.98, 0.95), look("inside-40", "recall")),
    Requirement("query p50, 40 cm, 80 %", " ms", 1, False, (100.0, 500.0), look("inside-40", "milliseconds", "p50")),
    Requirement(
        "query p95, not in the database, 20 cm, 90 %",
        " ms",
        1,
        False,
        (100.0, 600.0),
        look("outside-20", "milliseconds", "p95"),
    ),
    Requirement("false matches, 20 cm, 90 %", "", 0, False, (0.0, 0.0), look("outside-20", "false")),
    Requirement("index on disk, a submap", " kB", 2, False, (3.0, 3.0), per(1e3, look("ingest", "index_bytes"))),
    Requirement("resident memory", " GB", 2, False, (1.0, 5.0), resident),
    Requirement("start to ready", " s", 2, False, (2.0, 10.0), look("start", "ready_seconds")),
    Requirement("bulk ingest, a second", "", 0, True, (1_000.0, 1_000.0), look("ingest", "submaps_per_second")),
)
