"""The section of docs/scaling.md on what the service costs, from the figures alone."""

from dataclasses import dataclass
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import bullets, number, page, prose, table
from benchmarks.service.waterfall import STAGES, lines

NAME: Final = "service"
"""Of the file with the figures."""
NOW: Final = "now"
_MUCH: Final = 0.1
"""Cores that others keep busy from which a part is called disturbed."""
_LARGEST: Final = 10
"""Packages that are named."""
_WHY: Final = {
    "llvmlite": "the compiler behind numba: kernels are compiled for the processor at hand",
    "scipy": "triangulation (Qhull), nearest neighbours, sparse systems of maps",
    "numpy": "arrays",
    "faiss-cpu": "k-means for the polygons of large segments",
    "numba": "kernels",
    "pyproj": "coordinate reference systems",
    "sqlalchemy": "SQL",
    "pydantic": "models of requests",
    "pydantic-core": "the same, compiled",
    "fastapi-offline": "the documentation of the API without a network",
    "pygments": "help of commands",
}


@dataclass(frozen=True, slots=True)
class _Row:
    """A line of the table.

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


_ROWS: Final = (
    _Row("library: one query, p50, ms", "single", ("library", "p50")),
    _Row("over HTTP: the same, p50, ms", "single", ("http", "p50")),
    _Row(
        "**HTTP over library, p50, ms**",
        "single",
        ("added", "p50"),
        goal=1.0,
        cause="What runs between socket and search is Python. Each line runs once in a query, after kernels that "
        "have emptied the processor's caches, and takes two to three times as long as in a loop. The waterfall below "
        "shows where: no part of it is half of the whole.",
    ),
    _Row("HTTP over library, processor time, ms", "single", ("added", "cpu")),
    _Row("the same without pairs, over HTTP, p50, ms", "single", ("without_pairs", "p50")),
    _Row("a request that asks nothing (`/livez`), p50, ms", "single", ("empty", "p50")),
    _Row(
        "**32 clients: answers a second**",
        "crowd",
        ("a_second",),
        digits=0,
        goal=300.0,
        least=True,
        cause="Processor time of an answer, which two cores share, and of which one process can use little more than "
        "one core: half of a query is Python, and that runs on one core at a time. `workers` adds the others.",
    ),
    _Row("32 clients: queries, p50, ms", "crowd", ("kinds", "query", "p50"), digits=0),
    _Row(
        "**32 clients: queries, p99, ms**",
        "crowd",
        ("kinds", "query", "p99"),
        digits=0,
        goal=250.0,
        cause="As above: 32 requests wait for each other.",
    ),
    _Row("32 clients: processor time of an answer, ms", "crowd", ("cpu",)),
    _Row(
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
    _Row("8 clients: PUT, p99, ms", "puts", ("kinds", "put", "p99"), digits=1),
    _Row(
        "**first start on a fresh installation, s**",
        "start",
        ("first_start_seconds",),
        digits=1,
        goal=15.0,
        cause="Kernels are compiled by two processes; `urquhart warm` does it when an image is built.",
    ),
    _Row(
        "**later start, s**",
        "start",
        ("start_seconds",),
        digits=1,
        goal=1.5,
        cause="Imports: SQLAlchemy, scipy, FastAPI with the models of requests, and numba take most of it, and kernels "
        "with the searches that load them 0.4 s.",
    ),
    _Row("**`urquhart --version`, s**", "start", ("version_seconds",), goal=0.3, cause="Python and the command line."),
    _Row(
        "**`urquhart keys list`, s**",
        "start",
        ("keys_seconds",),
        goal=0.3,
        cause="SQLAlchemy takes half of it, pydantic's settings a quarter.",
    ),
    _Row(
        "**idle memory, MB**",
        "start",
        ("idle",),
        digits=0,
        goal=180.0,
        cause="The imports of numba, numpy and scipy take half of it: "
        "[decision 19](decisions/0019-kernels-load-without-the-compiler.md).",
    ),
    _Row("of it the process's own, MB", "start", ("idle_own",), digits=0),
    _Row(
        "**longest first request after a start, times the median of its kind**",
        "first",
        ("worst",),
        digits=1,
        goal=3.0,
        cause="What its kind alone needs is loaded then: see the table below.",
    ),
    _Row("the same, ms", "first", ("first",), digits=1),
    _Row("kernels loaded from the cache, s", "kernels", ("kernels", "seconds")),
    _Row("kernels loaded from the cache, MB", "kernels", ("kernels", "megabytes"), digits=0),
    _Row("numba imported, MB", "kernels", ("compiler", "megabytes"), digits=0),
    _Row(
        "**installed size, MB**",
        "start",
        ("installed_mb",),
        digits=0,
        goal=450.0,
        cause="llvmlite, scipy, numpy, faiss and numba are most of it, and all are in use: see the table below.",
    ),
)


def section(figures: Figures) -> str:
    """The section; parts that were not measured are left out."""
    return page("## What the service costs", _table(figures), _firsts(figures), _sizes(figures), _waterfall(figures))


def _table(figures: Figures) -> str:
    measured = [part for part in figures.values() if "versions" in part]
    if not measured:
        return ""
    older = measured[0]["against"]
    rows, missed = [], []
    for row in (row for row in _ROWS if row.part in figures):
        versions = figures[row.part]["versions"]
        before, now = _at(versions.get(older), row.path), _at(versions[NOW], row.path)
        ratio = now / before if now is not None and before else None
        is_missed = row.is_missed(now, ratio)
        met = "" if row.goal is None or now is None else "**no**" if is_missed else "yes"
        cells = (number(before, row.digits), number(now, row.digits), number(ratio, 2))
        rows.append([row.what, *cells, row.told(), met])
        if is_missed:
            missed.append(f"{row.what.strip('*')}: {row.cause}")
    single, made = figures.get("single", {}), measured[0]["machine"]
    return page(
        prose(
            f"""Made by `make bench` on {made["processor"]}, {made["cores"]} cores, Python {made["python"]}, at commit
            `{measured[0]["commit"]}`: this version and commit `{older}` in turn, each a service in a process of its
            own, in the same run. Clients and service share the cores. One query at a time:
            {single.get("submaps", 0):,} submaps, {single.get("trees", 0):.0f} trees, 5 candidates. The 32 clients:
            10,000 submaps, a tenth of the requests are writes. Processor time is that of the service alone. Starts are
            of an empty database. {_disturbed(figures)}"""
        ),
        table(["", f"`{older}`", "now", "ratio", "goal", "met"], rows),
        "### What falls short" if missed else "",
        bullets(missed),
    )


def _disturbed(figures: Figures) -> str:
    """What else the machine did meanwhile."""
    others = {name: part["others"] for name, part in figures.items() if part.get("others", 0.0) > _MUCH}
    if not others:
        return "The machine did nothing else meanwhile."
    busy = ", ".join(f"{name} {number(cores, 1)}" for name, cores in others.items())
    return f"""Other programs used the machine meanwhile (cores on average: {busy}), so times of these parts are longer
        than on a quiet one; the ratios hold."""


def _firsts(figures: Figures) -> str:
    """The first request of each kind after a start, of this version."""
    if "first" not in figures:
        return ""
    kinds = figures["first"]["versions"][NOW]["kinds"]
    return page(
        "### First requests",
        prose(
            f"""Milliseconds of the first request of a kind after a start of this version with
            {figures["first"]["submaps"]:,} submaps, and the median of those after it (`python -m benchmarks.service
            --only first`). No request compiles a kernel or waits for one, which a test counts."""
        ),
        table(
            ["", "first", "later", "ratio"],
            [
                [kind, number(found["first"], 1), number(found["later"], 1), number(found["ratio"], 1)]
                for kind, found in kinds.items()
            ],
        ),
    )


def _sizes(figures: Figures) -> str:
    """The packages that take most of an installation."""
    packages = figures["start"]["versions"][NOW].get("packages") if "start" in figures else None
    if not packages:
        return ""
    most = list(packages.items())[:_LARGEST]
    rest = sum(packages.values()) - sum(size for _, size in most)
    rows = [[f"`{name}`", _WHY.get(name, ""), number(size, 0)] for name, size in most]
    return page(
        "### Installed size",
        prose(
            """What `pip install urquhart` puts on the disk without extras, by package (`python -m benchmarks.service
            --only start`). Tests of the packages themselves are part of their wheels."""
        ),
        table(
            ["package", "MB", "what for"],
            [*rows, [f"{len(packages) - len(most)} others", number(rest, 0), ""]],
            words=2,
        ),
    )


def _at(figures: Figures | None, path: tuple[str, ...]) -> float | None:
    found: object = figures
    for name in path:
        found = found.get(name) if isinstance(found, dict) else None
    return found if isinstance(found, int | float) else None


def _waterfall(figures: Figures) -> str:
    if "waterfall" not in figures:
        return ""
    found = figures["waterfall"]
    rows = [
        [stage.name, stage.what, number(spent["wall"], 3), number(spent["cpu"], 3)]
        for stage in STAGES
        for spent in (found["stages"][stage.name],)
    ]
    return page(
        "### A query end to end",
        prose(
            f"""Made by `python -m benchmarks.service --only waterfall`: the medians of {found["asked"]} queries among
            {found["submaps"]:,} submaps, one after the other, {found["whole"]:.2f} ms from the first byte sent to the
            last one received. The marks themselves cost a few microseconds each."""
        ),
        "```text\n" + "\n".join(lines(found)) + "\n```",
        table(["stage", "what it is", "ms", "processor, ms"], rows, words=2),
    )
