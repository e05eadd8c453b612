"""docs/scaling.md, written from the JSON alone."""

from typing import Any, Final

import numpy as np

from benchmarks.machine import LIBRARIES
from benchmarks.markdown import bullets, number, page, picture, prose, table
from benchmarks.scale.charts import RIVAL_NAMES, Read, parts_of, series, short, sizes_of
from benchmarks.scale.measurement_plan import EXACT_UP_TO, RIVALS
from benchmarks.scale.requirements import ASKED_OF, BEFORE, CAUSES, REQUIREMENTS, look, per, resident
from benchmarks.scale.rivals.report import rivals
from benchmarks.scale.tiled_forest import KINDS

Figures = dict[str, Any]
QUIET: Final = 0.1
"""Cores that other programs may keep busy before the page says so."""


def write_report(figures: Figures) -> str:
    """The page."""
    return page(
        _head(figures),
        _requirements(figures),
        _queries(figures),
        _slopes(figures),
        _stages(figures),
        _cost(figures),
        _service(figures),
        rivals(figures),
    )


def _head(figures: Figures) -> str:
    sizes = sizes_of(figures)
    made = figures["sizes"]
    machines = {
        f"{m['processor']}, {m['cores']} cores, Python {m['python']}, "
        + ", ".join(f"{name} {m['versions'][name]}" for name in LIBRARIES): None
        for m in (made[str(size)]["machine"] for size in sizes)
    }
    sides = {size: made[str(size)]["parts"]["simulate"] for size in sizes}
    rows = [
        [
            f"{size:,}",
            f"{sides[size]['sides'][0] / 1000.0:.1f} x {sides[size]['sides'][1] / 1000.0:.1f}",
            number(sides[size]["landmarks"], 1),
            number(sides[size]["seconds"] / 60.0, 1),
            number(made[str(size)]["seconds"] / 60.0, 1),
            made[str(size)].get("commit") or "-",
        ]
        for size in sizes
    ]
    return page(
        "# How it grows",
        prose(
            """Made by `make bench-scale` (up to a hundred thousand submaps; `ARGS="--max-n 1000000"` for the million,
            `ARGS=--quick` for a small version). The forest is the paper's: trees 7 m apart (Bridson), moved by 3 m. It
            is made in tiles of 1 km from seeds of their own, so that any place can be seen without the rest; the 7 m
            are not kept across the seams of tiles. Submaps lie on a square grid of 50 m, seen by a robot with a range
            of 50 m, 20 cm of noise in each coordinate and 90 % of the trees, in any heading: nothing that is stored is
            free of noise. Queries are new observations from anywhere in the area of the grid, at 20 cm and 90 % or 40
            cm and 80 %, or from another forest, which is not in the database. A pose is right within 1 m and 3
        degrees. Queries have the effort `fast` where nothing else is said."""
        ),
        prose(
            """Dense stands have 300 to 2,000 trees per hectare, another density in each tile of 300 m; trees keep 0.6
            times the distance of a regular pattern. They are seen from 30 m, and submaps lie 30 m apart."""
        ),
        prose(
            """Each figure is measured in a fresh process, on a real database through the service's own code, with the
            files in the page cache. A query's time holds everything from landmarks to verdict, the look at the database
            for news included; queries run one at a time on one core."""
        ),
        prose(f"Machine: {'; '.join(machines)}. Made by `{figures['command']}`, seed {figures['seed']}."),
        prose(_others(figures)),
        table(["submaps", "km", "landmarks each", "simulation, minutes", "everything, minutes", "commit"], rows),
    )


def _others(figures: Figures) -> str:
    """A warning, where the machine did something else besides."""
    shares = {
        f"{short(size)}: {name}": part.get("others", 0.0)
        for size in sizes_of(figures)
        for name, part in parts_of(figures, size).items()
    }
    disturbed = {name: share for name, share in shares.items() if share > QUIET}
    if not disturbed:
        return ""
    worst = max(disturbed, key=lambda name: disturbed[name])
    return f"""The machine did other work during {len(disturbed)} of {len(shares)} measurements, which kept up to
        {disturbed[worst]:.1f} cores busy ({worst}): times are longer than they would have been."""


def _requirements(figures: Figures) -> str:
    rows: list[list[str]] = []
    missed: dict[str, list[str]] = {}
    for requirement in REQUIREMENTS:
        row = [requirement.name]
        for size in ASKED_OF:
            parts = parts_of(figures, size)
            met = requirement.met(parts, size)
            row += [
                requirement.show_before(size),
                requirement.show_bound(size),
                requirement.show(requirement.figure(parts)) + _asked(requirement.name, parts),
                {None: "-", True: "yes", False: "**no**"}[met],
            ]
            if met is False:
                cause = CAUSES.get((requirement.name, size), "the cause is not known yet.")
                missed.setdefault(cause, []).append(f"{requirement.name}, {short(size)}")
        rows.append(row)
    head = ["", *(entry for size in ASKED_OF for entry in (f"{short(size)}: before", "asked", "measured", "met"))]
    known = [size for size in ASKED_OF if parts_of(figures, size)]
    absent = [short(size) for size in ASKED_OF if size not in known]
    return page(
        "## What is asked of it",
        prose(f"Not measured yet: {', '.join(absent)}." if absent else ""),
        prose(
            f"""*Before*: the same figures at commit {BEFORE}, measured by the same command on a machine of the same
            kind: there, one search did what `fast` and `full` do now."""
        ),
        table(head, rows),
        prose("What is missed, and why:") if missed else "",
        bullets([f"{'; '.join(names)}: {cause}" for cause, names in missed.items()]),
    )


def _asked(name: str, parts: Figures) -> str:
    """Behind a count, of how many."""
    return f" of {parts['outside-20']['asked']:,}" if name.startswith("false") and "outside-20" in parts else ""


def _queries(figures: Figures) -> str:
    tables = []
    for name, kind in KINDS.items():
        columns: list[tuple[str, Read, int]] = [("asked", look(name, "asked"), 0)]
        if kind.inside:
            columns += [
                ("first candidate right", look(name, "recall"), 4),
                ("matched and right", look(name, "matched_right"), 0),
                ("matched and wrong", look(name, "wrong"), 0),
            ]
        else:
            columns += [("matched, all of them false", look(name, "false"), 0)]
        columns += [("ambiguous", look(name, "ambiguous"), 0), ("no match", look(name, "no_match"), 0)]
        columns += [(f"{p}, ms", look(name, "milliseconds", p), 1) for p in ("p50", "p95", "p99")]
        tables.append(_by_size(figures, f"{kind}", columns))
    parts = [parts_of(figures, size) for size in sizes_of(figures)]
    wrong = sum(one[name]["wrong"] for one in parts for name in KINDS if name in one)
    false = sum(one[name]["false"] for one in parts for name in KINDS if name in one)
    asked = sum(one[name]["asked"] for one in parts for name in KINDS if name in one)
    return page(
        "## Queries",
        picture("scale_recall", "Share of the queries whose first candidate is right, against the number of submaps"),
        picture("scale_latency", "Milliseconds of a query against the number of submaps"),
        prose(f"Of all {asked:,} answers {wrong} are matched and wrong, and {false} are matched and false."),
        *tables,
    )


def _slopes(figures: Figures) -> str:
    if len(sizes_of(figures)) < 2:
        return ""
    rows = [
        [str(kind), *(number(slope(figures, look(name, "milliseconds", p))) for p in ("p50", "p95"))]
        for name, kind in KINDS.items()
    ]
    for name in RIVALS:
        reads = [look(name, "kinds", "inside-20", "milliseconds", p) for p in ("p50", "p95")]
        # An exact search is not what grows: inverted lists take its place.
        least = EXACT_UP_TO + 1 if name == "rival-quads" else 0
        rows.append([RIVAL_NAMES[name], *(number(slope(figures, read, least)) for read in reads)])
    return page(
        "### How steeply",
        prose(
            """Time grows as the number of submaps to the power of this, by least squares through the logarithms: 1
            would be a search through everything, 0 one that knows where to look. Rivals at 20 cm, 90 %, inside; FAISS
            where it has inverted lists."""
        ),
        table(["", "p50", "p95"], rows),
    )


def slope(figures: Figures, read: Read, least: int = 0) -> float | None:
    """Exponent of growth of a figure with the number of submaps, from `least` on; None for fewer than two sizes."""
    found = [(size, value) for size, value in zip(*series(figures, read), strict=True) if size >= least]
    if len(found) < 2:
        return None
    sizes, values = np.log(found).T
    return float(np.polyfit(sizes, values, 1)[0])


def _stages(figures: Figures) -> str:
    tables = []
    for name, kind in KINDS.items():
        of_size = {size: parts_of(figures, size).get(name, {}) for size in sizes_of(figures)}
        stages = dict.fromkeys(stage for one in of_size.values() for stage in one.get("stages", {}))
        rows = [
            [
                stage,
                *(
                    f"{one['stages'][stage]:.2f} ({100 * one['reached'][stage]:.0f} %)"
                    if stage in one.get("stages", {})
                    else "-"
                    for one in of_size.values()
                ),
            ]
            for stage in stages
        ]
        tables.append(table([f"{kind}: ms", *(short(size) for size in of_size)], rows))
    return page(
        "### Where the time goes",
        prose("The median of each stage over the queries that reached it, and in brackets how many of them did."),
        *tables,
    )


def _cost(figures: Figures) -> str:
    columns: list[tuple[str, Read, int]] = [
        ("submaps stored a second", look("ingest", "submaps_per_second"), 0),
        ("processes", look("ingest", "processes"), 0),
        ("described and durable, s", look("ingest", "durable_seconds"), 1),
        ("then found by a query, s", look("ingest", "searchable_seconds"), 1),
        ("database, kB a submap", per(1e3, look("ingest", "database_bytes")), 1),
        ("index on disk, kB a submap", per(1e3, look("ingest", "index_bytes")), 2),
    ]
    start: list[tuple[str, Read, int]] = [
        ("Python and imports, s", look("start", "imports_seconds"), 2),
        ("kernels from the cache, s", look("start", "kernels_seconds"), 2),
        ("database opened, s", look("start", "open_seconds"), 2),
        ("index ready, s", look("start", "index_seconds"), 2),
        ("first query, s", look("start", "first_query_seconds"), 3),
        ("**to ready, s**", look("start", "ready_seconds"), 2),
    ]
    memories: list[tuple[str, Read, int]] = [
        ("before the database is opened, MB", look("inside-20", "memory_before", "resident"), 0),
        ("after the queries, MB", look("inside-20", "memory", "resident"), 0),
        ("of it its own", look("inside-20", "memory", "own"), 0),
        ("of it pages of files", look("inside-20", "memory", "files"), 0),
        ("**after whichever queries need most, MB**", per(1e-3, resident), 0),
    ]
    compiled = series(figures, look("compile", "kernels_seconds"))[1]
    return page(
        "## Storing, starting, memory",
        picture("scale_cost", "Bytes, memory, start and ingest against the number of submaps"),
        _by_size(figures, "ingest", columns),
        _by_size(figures, "start", start),
        prose(
            f"""Ready is counted from the opening of the database to the first answer; what Python, imports and kernels
            take before that does not depend on the database. Kernels are compiled at the first start after an
            installation ({number(compiled[0], 0) if compiled else "-"} s, once) and come from their cache after that.
            Medians of three starts."""
        ),
        _by_size(figures, "memory", memories),
    )


def _service(figures: Figures) -> str:
    columns: list[tuple[str, Read, int]] = [
        ("library, p50, ms", look("http", "library", "p50"), 2),
        ("over HTTP, p50, ms", look("http", "http", "p50"), 2),
        ("**added, ms**", look("http", "added"), 2),
        ("of it a request that asks nothing (`/livez`), ms", look("http", "empty", "p50"), 2),
        ("other verdicts", look("http", "differing"), 0),
        ("one thread, queries a second", look("threads", "queries_per_second", "1"), 1),
        ("two threads, queries a second", look("threads", "queries_per_second", "2"), 1),
        ("**two to one**", look("threads", "speedup"), 2),
    ]
    return page(
        "## Over HTTP, and two at a time",
        prose(
            """The same 200 queries (20 cm, 90 %, inside) in turn to `urquhart serve` on loopback over one connection,
            and to the library in the process that asks. Threads share one process and one index."""
        ),
        _by_size(figures, "", columns),
    )


def _by_size(figures: Figures, title: str, columns: list[tuple[str, Read, int]]) -> str:
    """A line for each figure, a column for each size."""
    sizes = sizes_of(figures)
    rows = [[name, *(_show(read(parts_of(figures, size)), digits) for size in sizes)] for name, read, digits in columns]
    return table([title, *(short(size) for size in sizes)], rows)


def _show(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:,.{digits}f}"
