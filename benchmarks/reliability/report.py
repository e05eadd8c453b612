"""docs/reliability.md, written from the JSON alone: what was done, what came of it, and what falls short."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from benchmarks.experiments import Figures, provenance
from benchmarks.markdown import bullets, number, page, prose, table
from benchmarks.reliability.exhaustion.section import exhaustion_faults, exhaustion_section
from benchmarks.reliability.hostile_report import trials_section
from benchmarks.reliability.meetings_report import meeting_faults, meetings_section
from benchmarks.reliability.shape_costs_report import shape_faults, shapes_section

GROWTH: Final = 20.0
"""MB by which a reader may grow over half a million inputs."""


def write_report(results: Mapping[str, Figures]) -> str:
    """The page, from the figures of the parts that were run, by name."""
    sections = [write(results[name]) for name, write in SECTIONS.items() if name in results]
    return page(_head(results), *sections)


def faults(results: Mapping[str, Figures]) -> list[str]:
    """What falls short, part by part, a sentence each."""
    found: list[str] = []
    if contract := results.get("contract"):
        found += [f"contract, {one['where']}" for one in contract["failures"]]
        found += [f"contract, the log: {line}" for line in contract["logged"]]
    if readers := results.get("readers"):
        found += [f"readers, {name}: {one['what']}" for name, r in readers["readers"].items() for one in r["findings"]]
        found += [
            f"readers, {name}: {r['growth_megabytes']:.0f} MB are not given back"
            for name, r in readers["readers"].items()
            if r["growth_megabytes"] > GROWTH
        ]
    if load := results.get("load"):
        for phase in ("normal", "overload"):
            found += [f"load, {phase}: {count} x {what}" for what, count in load[phase]["errors"].items()]
            if load[phase]["wrong"]:
                found.append(f"load, {phase}: {load[phase]['wrong']} wrong matches")
        found += [f"load, lost: {what}" for what in load["lost"][:10]]
        found += [f"load, the log: {line}" for line in load["logged"]]
        if load["recovery_seconds"] is None:
            found.append("load: queries do not become as fast again as they were before the overload")
    if fleet := results.get("fleet"):
        for kind in fleet["kinds"].values():
            found += [f"fleet, {kind['name']}: {kind['wrong']} wrong visits"] if kind["wrong"] else []
            found += [f"fleet, {kind['name']}: {kind['twice']} answers name a session twice"] if kind["twice"] else []
        found += [f"fleet, the log: {line}" for line in fleet["logged"]]
    if season := results.get("season"):
        found += [f"season, the log: {line}" for line in season["logged"]]
        if (season["state"], season["results"]) != ("successful", season["lines"]):
            found.append(f"season: the import is {season['state']}, with {season['results']} lines of result")
    if meetings := results.get("meetings"):
        found += meeting_faults(meetings)
    if hostile := results.get("hostile"):
        found += [f"{name}: {what}" for name, trial in hostile["trials"].items() for what in trial["problems"]]
    if shapes := results.get("shapes"):
        found += shape_faults(shapes)
    if exhaustion := results.get("exhaustion"):
        found += exhaustion_faults(exhaustion)
    return found


def _head(results: Mapping[str, Figures]) -> str:
    short = faults(results)
    absent = [name for name in SECTIONS if name not in results]
    return page(
        "# Does it keep what it says?",
        prose(
            """Made by `make bench-reliability` (`ARGS=--quick` for a small version, `ARGS="--only PART"` for one part).
            Everything but the readers runs against `urquhart serve` in a process of its own, over loopback, on a
            database of its own; who asks shares the machine with it. What is random comes from the seed; what depends
            on time (kills, load) differs from run to run."""
        ),
        provenance({f"reliability_{name}": figures for name, figures in results.items()}) if results else "",
        prose(f"Not run yet: {', '.join(absent)}." if absent else ""),
        "## What falls short",
        bullets(short) if short else prose("Nothing of what was looked for was found."),
    )


def _contract(figures: Figures) -> str:
    statuses = ", ".join(f"{count:,} x {status}" for status, count in figures["statuses"].items())
    return page(
        "## The contract",
        prose(
            f"""{figures["cases"]:,} requests to {len(figures["operations"])} operations, drawn from the OpenAPI
            document: as it describes them and against it, mostly on what earlier requests made. Each answer is
            held against the document: is its status told of, its media type, its headers, does its body fit the schema;
            and a status of 500 or more must be a 503 or 507 that the operation tells of. Answers: {statuses}.
            {len(figures["failures"])} kinds of answers were not as documented."""
        ),
        prose(
            f"""For {len(figures["undrawn"])} operations nothing can be sent that is against the document, since any
            text is a name that may or may not exist."""
            if figures["undrawn"]
            else ""
        ),
    )


def _readers(figures: Figures) -> str:
    rows = [
        [
            name,
            f"{one['inputs']:,}",
            f"{one['accepted']:,}",
            f"{sum(one['refused'].values()):,}",
            str(len(one["findings"])),
            number(one["slowest_milliseconds"], 0),
            number(one["growth_megabytes"], 1),
        ]
        for name, one in figures["readers"].items()
    ]
    head = ["reader", "inputs", "accepted", "refused", "anything else", "slowest, ms", "memory, MB more"]
    return page(
        "## The readers",
        prose(
            f"""{figures["inputs"]:,} inputs: good ones whose bytes are damaged, good ones of which parts are replaced,
            and some from a grammar. `lines` is NDJSON as bulk ingest reads, checks and describes it; `bodies` are all
            models of request bodies, with the sentences that say what is wrong; `stem maps` the CSV reader;
            `parameters` cursors, boxes and intervals. Only errors of the domain may come out. Memory is what a process
            has more at the end than after a fifth of its inputs."""
        ),
        table(head, rows),
    )


def _load(figures: Figures) -> str:
    rows: list[list[str]] = []
    for phase, clients in (("normal", figures["clients"]), ("overload", figures["crowd"])):
        for kind, one in figures[phase]["kinds"].items():
            times = [number(one[p], 0) for p in ("p50", "p95", "p99")]
            rows.append([f"{clients} clients: {kind}", f"{one['count']:,}", *times])
    alone = [number(figures["alone"][p], 0) for p in ("p50", "p95", "p99")]
    recovery = figures["recovery_seconds"]
    return page(
        "## Load",
        prose(
            f"""{figures["submaps"]:,} submaps of one forest, queries at 20 cm and 90 % seen, a tenth of all requests
            writes. {figures["clients"]} clients, each with its next request as soon as it has its answer, for
            {figures["normal"]["seconds"]:.0f} s: {number(figures["normal"]["a_second"], 0)} answers a second,
            {_turned_away(figures["normal"])}. Then {figures["crowd"]} clients for
            {figures["overload"]["seconds"]:.0f} s: {number(figures["overload"]["a_second"], 0)} answers a second,
            {_turned_away(figures["overload"])}. {
                "Queries did not become as fast again within a minute."
                if recovery is None
                else f"Queries were as fast as before {number(recovery, 1)} s after the crowd had gone."
            } Clients and service share the cores, so half of each time is the clients'."""
        ),
        table(["", "answers", "p50, ms", "p95", "p99"], [["one client: query", "-", *alone], *rows]),
        prose(
            f"""Of {figures["stored"]:,} acknowledged writes {len(figures["lost"])} were not there at the end with the
            same trees, or not found by a query. Of
            {figures["normal"]["matched"] + figures["overload"]["matched"]:,} matches
            {figures["normal"]["wrong"] + figures["overload"]["wrong"]} were wrong. The service's own memory:
            {number(figures["memory"]["start"], 0)} MB at first, {number(figures["memory"]["after_normal"], 0)} MB after
            the normal load, {number(figures["memory"]["end"], 0)} MB at the end."""
        ),
    )


def _turned_away(phase: Mapping[str, Any]) -> str:
    refused = ", ".join(f"{count:,} x {status}" for status, count in phase["refused"].items()) or "none"
    return f"{sum(phase['errors'].values())} errors, turned away with Retry-After: {refused}"


def _fleet(figures: Figures) -> str:
    rows = [
        [
            kind["name"],
            f"{kind['asked']:,}",
            f"{kind['been']:,}",
            f"{kind['named']:,}",
            f"{kind['touched']:,}",
            f"{kind['wrong']:,}",
            *(f"{number(kind[way]['p50'], 0)} / {number(kind[way]['p95'], 0)}" for way in ("single", "every")),
        ]
        for kind in figures["kinds"].values()
    ]
    head = ["query", "asked", "sessions here", "named", "touched", "wrong", "one place: p50 / p95, ms", "all sessions"]
    return page(
        "## Who has been here, and when?",
        prose(
            f"""{figures["sessions"]} drives through one forest of {figures["places"]:,} places, each with
            {100 * figures["share"]:.0f} % of them in {figures["submaps"]:,} submaps in all, every one seen again at
            20 cm and 90 %. A query is asked as it is, and with `per_session`. A session was here when one of its
            submaps has its centre within {figures["reach"]:.0f} m; `touched` are right poses in submaps farther away. A
            session that is named with a pose more than 1 m or 3 degrees off, or from another forest, is wrong."""
        ),
        table(head, rows),
    )


def _season(figures: Figures) -> str:
    rows = [
        [name, f"{one['asked']:,}", f"{one['matched']:,}", *(number(one[p], 0) for p in ("p50", "p95", "p99"))]
        for name, one in ((f"{name} the import", figures[name]) for name in ("before", "during", "after"))
    ]
    return page(
        "## A season is uploaded",
        prose(
            f"""{figures["lines"]:,} submaps as NDJSON, {number(figures["megabytes"], 0)} MB with gzip, posted as one
            import while a robot asks in another collection. Sent in {number(figures["upload_seconds"], 1)} s, stored
            after {number(figures["import_seconds"], 0)} s: {number(figures["a_second"], 0)} submaps a second, where the
            library alone makes {number(figures["library_a_second"], 0)} of the same lines. Each line has its line of
            result ({figures["results"]:,}). The first query in what was imported is answered in
            {number(figures["first_query"]["seconds"], 2)} s: {figures["first_query"]["verdict"]}."""
        ),
        table(["the robot's queries", "asked", "matched", "p50, ms", "p95", "p99"], rows),
    )


def _hostile(figures: Figures) -> str:
    return trials_section(figures["trials"])


SECTIONS: Final[dict[str, Callable[[Figures], str]]] = {
    "contract": _contract,
    "readers": _readers,
    "load": _load,
    "fleet": _fleet,
    "season": _season,
    "meetings": meetings_section,
    "hostile": _hostile,
    "shapes": shapes_section,
    "exhaustion": exhaustion_section,
}
