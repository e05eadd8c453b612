"""The section of docs/scaling.md on what the service costs, from the figures alone."""

from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import bullets, number, page, prose, table
from benchmarks.service.cost_rows import ROWS
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


def section(figures: Figures) -> str:
    """The section; parts that were not measured are left out."""
    return page("## What the service costs", _table(figures), _firsts(figures), _sizes(figures), _waterfall(figures))


def _table(figures: Figures) -> str:
    measured = [part for part in figures.values() if "versions" in part]
    if not measured:
        return ""
    older = next((part["against"] for part in measured if part["against"]), "")
    rows, missed = [], []
    for row in (row for row in ROWS if row.part in figures):
        versions = figures[row.part]["versions"]
        before, now = _at(versions.get(older), row.path), _at(versions[NOW], row.path)
        ratio = now / before if now is not None and before else None
        is_missed, found = row.is_missed(now, ratio), ratio if row.relative else now
        met = "" if row.goal is None or found is None else "**no**" if is_missed else "yes"
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
            10,000 submaps, a tenth of the requests are writes. Processor time is that of the service alone. Starts
            are of an empty database, with the packages that an installation has. {_disturbed(figures)}"""
        ),
        table(["", f"`{older}`", "now", "ratio", "goal", "met"], rows),
        "### What falls short" if missed else "",
        bullets(missed),
    )


def _disturbed(figures: Figures) -> str:
    """What else the machine did meanwhile."""
    if not any("others" in part for part in figures.values()):
        return "What else the machine did meanwhile was not measured."
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
