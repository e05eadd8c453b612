"""`make bench-library`: what describing, asking and storing cost on this machine."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.everyday import Forest, QueryCost, build, describe_cost, ingest_rate, query_cost
from benchmarks.http_overhead import BulkRate, HttpCost, bulk_rate, http_cost
from benchmarks.machine import machine
from urquhart import Config, warm_up

SETTINGS = {"20 cm, 90 % seen": (0.2, 0.9), "40 cm, 80 % seen": (0.4, 0.8)}


def main(
    side: Annotated[float, typer.Option(help="Side of the simulated forest, metres.")] = 1500.0,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    bulk: Annotated[int, typer.Option(min=0, help="Submaps to store with all processes; 0 leaves it out.")] = 20_000,
    out: Annotated[Path, typer.Option(help="Where the figures go as JSON.")] = Path("benchmark-output/everyday.json"),
) -> None:
    """Measure describe, query and ingest for 100-landmark observations; print tables and write the figures as JSON."""
    rng = np.random.default_rng(seed)
    console = Console()
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("compiling", total=9)
        warm_up(Config())
        progress.update(task, description="describing", advance=1)
        description = describe_cost(rng)
        progress.update(task, description="growing two forests", advance=1)
        forest, foreign = Forest.grow(side, rng), Forest.grow(side / 2.0, rng)
        recognizer, describing, indexing = build(forest)
        queries: dict[str, QueryCost] = {}
        for name, (sigma, detection) in SETTINGS.items():
            progress.update(task, description=f"asking at {name}", advance=1)
            queries[name] = query_cost(recognizer, forest, rng, sigma=sigma, detection=detection)
        progress.update(task, description="asking for a place that is not there", advance=1)
        queries["not in the database, 20 cm, 90 %"] = query_cost(
            recognizer, forest, rng, sigma=0.2, detection=0.9, foreign=foreign
        )
        progress.update(task, description="asking over HTTP", advance=1)
        http = http_cost(recognizer, forest, rng, sigma=0.2, detection=0.9)
        progress.update(task, description="storing", advance=1)
        rate, size = ingest_rate(forest)
        progress.update(task, description="storing with all processes", advance=1)
        stored = bulk_rate(forest, bulk) if bulk else None
        progress.advance(task)

    count = len(forest.submaps)
    here = machine("sqlalchemy")
    figures = {
        "machine": here,
        "seed": seed,
        "describe_ms": description,
        "submaps": count,
        "describe_submaps_per_second": count / describing,
        "index_submaps_per_second": count / indexing,
        "queries": {name: asdict(cost) for name, cost in queries.items()},
        "http_ms": asdict(http),
        "ingest_submaps_per_second": rate,
        "bulk": None if stored is None else asdict(stored),
        "database_bytes_per_submap": size,
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(figures, indent=2) + "\n")

    console.print(f"{here['processor']}, {here['cores']} cores, Python {here['python']}; medians; seed {seed}\n")
    _print_description(console, description)
    _print_queries(console, queries, count)
    console.print(
        f"describe {count / describing:,.0f} submaps/s and index {count / indexing:,.0f} submaps/s on one core; "
        f"store {rate:,.0f} submaps/s with description, {size / 1000.0:.1f} kB each on disk"
    )
    _print_service(console, http, stored)
    console.print(f"figures: {out}")


def _print_service(console: Console, http: HttpCost, stored: BulkRate | None) -> None:
    console.print(
        f"the same query, 20 cm and 90 % seen: library {http.library:.2f} ms, over HTTP {http.http:.2f} ms, "
        f"which adds {http.added:.2f} ms; answers of {http.answer_bytes / 1000.0:.1f} kB, "
        f"{http.agreed} of {http.asked} agree"
    )
    if stored is not None:
        console.print(
            f"store {stored.submaps:,} submaps with {stored.processes} processes: {stored.overall:,.0f} submaps/s, "
            f"{stored.sustained:,.0f} in the second half"
        )


def _print_description(console: Console, description: dict[str, float]) -> None:
    table = Table(title="describe 100 landmarks")
    table.add_column("part")
    table.add_column("ms", justify="right")
    for name, value in description.items():
        if name not in ("ratio", "bytes"):
            table.add_row(name, f"{value:.3f}")
    console.print(table)
    console.print(
        f"describe / SciPy's Delaunay alone: {description['ratio']:.2f}; packed {description['bytes']:.0f} bytes\n"
    )


def _print_queries(console: Console, queries: dict[str, QueryCost], submaps: int) -> None:
    table = Table(title=f"one query among {submaps} submaps, ms")
    table.add_column("stage")
    for name in queries:
        table.add_column(name, justify="right")
    stages = list(dict.fromkeys(stage for cost in queries.values() for stage in cost.stages))
    for stage in stages:
        table.add_row(stage, *(f"{c.stages[stage]:.3f}" if stage in c.stages else "-" for c in queries.values()))
    table.add_section()
    table.add_row("whole, p50", *(f"{cost.total:.2f}" for cost in queries.values()))
    table.add_row("whole, p95", *(f"{cost.p95:.2f}" for cost in queries.values()))
    table.add_row("matched", *(f"{cost.matched} of {cost.asked}" for cost in queries.values()))
    table.add_row("matched and right", *(f"{cost.right}" for cost in queries.values()))
    console.print(table)
    console.print("A stage's figure is its median over the queries that reached it.\n")


if __name__ == "__main__":
    typer.run(main)
