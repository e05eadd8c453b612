"""The rows of the table of what the service costs: where each figure is, what was aimed at, and why it is missed."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class CostRow:
    """A line of the table of what the service costs.

    Attributes:
        what: what is measured.
        part: of the figures.
        path: where the figure is in those of a version.
        digits: after the point.
        goal: what was aimed at; None where nothing was.
        least: whether the goal is the smallest allowed; else the largest.
        relative: whether it is for the ratio to the older commit.
        cause: why it is missed, if it is.
    """

    what: str
    part: str
    path: tuple[str, ...]
    digits: int = 2
    goal: float | None = None
    least: bool = False
    relative: bool = False
    cause: str = ""

    def told(self) -> str:
        """The goal in words."""
        if self.goal is None:
            return ""
        if self.relative:
            return f"at least {self.goal:g} times as many"
        return f"at {'least' if self.least else 'most'} {self.goal:g}"

    def is_missed(self, now: float | None, ratio: float | None) -> bool:
        """Whether the figure falls short of the goal."""
        found = ratio if self.relative else now
        if self.goal is None or found is None:
            return False
        return found < self.goal if self.least else found > self.goal


ROWS: Final = (
    CostRow("library: one query, p50, ms", "single", ("library", "p50")),
    CostRow("over HTTP: the same, p50, ms", "single", ("http", "p50")),
    CostRow(
        "**HTTP over library, p50, ms**",
        "single",
        ("added", "p50"),
        goal=1.0,
        cause="What runs between socket and search is Python. Each line runs once in a query, after kernels that "
        "have emptied the processor's caches, and takes two to three times as long as in a loop. The waterfall below "
        "shows where: no part of it is half of the whole.",
    ),
    CostRow("HTTP over library, processor time, ms", "single", ("added", "cpu")),
    CostRow("the same without pairs, over HTTP, p50, ms", "single", ("without_pairs", "p50")),
    CostRow("a request that asks nothing (`/livez`), p50, ms", "single", ("empty", "p50")),
    CostRow(
        "**32 clients: answers a second**",
        "crowd",
        ("a_second",),
        digits=0,
        goal=300.0,
        least=True,
        cause="Processor time of an answer, which two cores share, and of which one process can use little more than "
        "one core: half of a query is Python, and that runs on one core at a time. `workers` adds the others.",
    ),
    CostRow("32 clients: queries, p50, ms", "crowd", ("kinds", "query", "p50"), digits=0),
    CostRow(
        "**32 clients: queries, p99, ms**",
        "crowd",
        ("kinds", "query", "p99"),
        digits=0,
        goal=250.0,
        cause="As above: 32 requests wait for each other.",
    ),
    CostRow(
        "32 clients: p99 of queries, times their p50",
        "crowd",
        ("kinds", "query", "p99_to_p50"),
        digits=1,
        goal=4.0,
        cause="Writes are among them, and a query of a place that is not stored takes several times as long as others.",
    ),
    CostRow("32 clients: processor time of an answer, ms", "crowd", ("cpu",)),
    CostRow("32 clients, a worker for each core: answers a second", "crowd", ("by_workers", "a_second"), digits=0),
    CostRow(
        "32 clients, a worker for each core: queries, p99, ms",
        "crowd",
        ("by_workers", "kinds", "query", "p99"),
        digits=0,
    ),
    CostRow(
        "**8 clients: PUT of 90 trees, durable, a second**",
        "puts",
        ("a_second",),
        digits=0,
        goal=2.0,
        least=True,
        relative=True,
        cause="Writes that arrive together share a commit, so the fsync does not bound them any more. Python does: "
        "validation, description, the row, on one core at a time.",
    ),
    CostRow("8 clients: PUT, p99, ms", "puts", ("kinds", "put", "p99"), digits=1),
    CostRow(
        "**first start on a fresh installation, s**",
        "start",
        ("first_start_seconds",),
        digits=1,
        goal=15.0,
        cause="Kernels are compiled by two processes; `urquhart warm` does it when an image is built.",
    ),
    CostRow(
        "**later start, s**",
        "start",
        ("start_seconds",),
        digits=1,
        goal=1.5,
        cause="Imports: SQLAlchemy, scipy, FastAPI with the models of requests, and numba take most of it, and kernels "
        "with the searches that load them 0.4 s.",
    ),
    CostRow(
        "**`urquhart --version`, s**", "start", ("version_seconds",), goal=0.3, cause="Python and the command line."
    ),
    CostRow(
        "**`urquhart keys list`, s**",
        "start",
        ("keys_seconds",),
        goal=0.3,
        cause="Settings, through pydantic, take most of it.",
    ),
    CostRow(
        "**idle memory, MB**",
        "start",
        ("idle",),
        digits=0,
        goal=180.0,
        cause="The imports of numba, numpy and scipy take half of it: "
        "[decision 19](decisions/0019-kernels-load-without-the-compiler.md).",
    ),
    CostRow("of it the process's own, MB", "start", ("idle_own",), digits=0),
    CostRow(
        "**longest first request after a start, times the median of its kind**",
        "first",
        ("worst",),
        digits=1,
        goal=3.0,
        cause="What its kind alone needs is loaded then: see the table below.",
    ),
    CostRow("the same, ms", "first", ("first",), digits=1),
    CostRow("kernels loaded from the cache, s", "kernels", ("kernels", "seconds")),
    CostRow("kernels loaded from the cache, MB", "kernels", ("kernels", "megabytes"), digits=0),
    CostRow("numba imported, MB", "kernels", ("compiler", "megabytes"), digits=0),
    CostRow(
        "**installed size, MB**",
        "start",
        ("installed_mb",),
        digits=0,
        goal=450.0,
        cause="llvmlite, scipy, numpy, faiss and numba are most of it, and all are in use: see the table below.",
    ),
)
