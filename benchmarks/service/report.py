"""The section of docs/scaling.md on what the service costs, from the figures alone."""

from collections.abc import Sequence
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import number, page, prose, table
from benchmarks.service.waterfall import STAGES, lines

NAME: Final = "service"
"""Of the file with the figures."""
NOW: Final = "now"
Path_ = Sequence[str]
_ROWS: Final[tuple[tuple[str, str, str, Path_, int], ...]] = (
    ("library: one query, p50, ms", "", "single", ("library", "p50"), 2),
    ("over HTTP: the same, p50, ms", "", "single", ("http", "p50"), 2),
    ("**HTTP over library, p50, ms**", "at most 1.0", "single", ("added", "p50"), 2),
    ("HTTP over library, processor time, ms", "", "single", ("added", "cpu"), 2),
    ("a request that asks nothing (`/livez`), p50, ms", "", "single", ("empty", "p50"), 2),
    ("**32 clients: answers a second**", "at least 300", "crowd", ("a_second",), 0),
    ("32 clients: queries, p50, ms", "", "crowd", ("kinds", "query", "p50"), 0),
    ("**32 clients: queries, p99, ms**", "at most 250", "crowd", ("kinds", "query", "p99"), 0),
    ("32 clients: processor time of an answer, ms", "", "crowd", ("cpu",), 2),
    ("**8 clients: PUT of 90 trees, durable, a second**", "twice as many", "puts", ("a_second",), 0),
    ("8 clients: PUT, p99, ms", "", "puts", ("kinds", "put", "p99"), 1),
    ("**first start on a fresh installation, s**", "at most 15", "start", ("first_start_seconds",), 1),
    ("**later start, s**", "at most 1.5", "start", ("start_seconds",), 1),
    ("**`urquhart --version`, s**", "at most 0.3", "start", ("version_seconds",), 2),
    ("**idle memory, MB**", "at most 180", "start", ("idle",), 0),
    ("**installed size, MB**", "at most 450", "start", ("installed_mb",), 0),
)
"""What is measured, what was aimed at, the part, where the figure is in it, digits."""


def section(figures: Figures) -> str:
    """The section; parts that were not measured are left out."""
    return page("## What the service costs", _table(figures), _waterfall(figures))


def _table(figures: Figures) -> str:
    measured = [part for part in figures.values() if "versions" in part]
    if not measured:
        return ""
    older = measured[0]["against"]
    rows = []
    for what, goal, part, path, digits in _ROWS:
        if part not in figures:
            continue
        versions = figures[part]["versions"]
        before, now = _at(versions.get(older), path), _at(versions[NOW], path)
        ratio = now / before if now is not None and before else None
        rows.append([what, number(before, digits), number(now, digits), number(ratio, 2), goal])
    single = figures.get("single", {})
    made = measured[0]["machine"]
    return page(
        prose(
            f"""Made by `make bench` on {made["processor"]}, {made["cores"]} cores, Python {made["python"]}: this
            version and commit `{older}` in turn, each a service in a process of its own, in the same run.
            Clients and service share the cores. One query at a time: {single.get("submaps", 0):,} submaps,
            {single.get("trees", 0):.0f} trees, 5 candidates. The 32 clients: 10,000 submaps, a tenth of the requests
            are writes. Processor time is that of the service alone."""
        ),
        table(["", f"`{older}`", "now", "ratio", "goal"], rows),
    )


def _at(figures: Figures | None, path: Path_) -> float | None:
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
