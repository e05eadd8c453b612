"""`make bench-maps`: drift, false loops, lying odometry, drives that go on, robots that meet, plantations, Table II."""

import os
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from benchmarks import record
from benchmarks.experiments import Experiment, choose, measure, progress_on
from benchmarks.maps import graphs, odometry, online, robots, sequences, stands, tracks
from benchmarks.maps.charts import drive
from benchmarks.maps.report import report
from benchmarks.markdown import FOLDER
from benchmarks.paper.charts import save
from benchmarks.pool import Pool

EXPERIMENTS: Final[dict[str, Experiment]] = {
    "maps_graphs": graphs.run,
    "maps_odometry": odometry.run,
    "maps_online": online.run,
    "maps_robots": robots.run,
    "maps_sequences": sequences.run,
    "maps_stands": stands.run,
    "maps_tracks": tracks.run,
}
FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/maps")


def main(
    quick: Annotated[bool, typer.Option("--quick", help="A small part of it, within a minute.")] = False,
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(EXPERIMENTS)}.")] = None,
    out: Annotated[
        Path | None, typer.Option(help=f"Where maps.md and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
) -> None:
    """Build maps of simulated and real drives; write JSON, the picture and the page."""
    folder, console = out or (QUICK if quick else FULL), Console()
    with progress_on(console) as progress, Pool(workers, progress) as pool:
        for name in choose(only, EXPERIMENTS):
            figures = measure("benchmarks.maps", name, EXPERIMENTS[name], pool, quick=quick, seed=seed)
            record.write(folder / FOLDER / f"{name}.json", figures)
    console.print(f"report: {write_page(folder)}")


def write_page(folder: Path) -> Path:
    """Write the page and its picture from the figures that are there; where the page went."""
    paths = {name: folder / FOLDER / f"{name}.json" for name in EXPERIMENTS}
    results = {name: record.read(path) for name, path in paths.items() if path.exists()}
    if "maps_graphs" in results:
        save(drive, results["maps_graphs"], folder / FOLDER / "maps_drive.svg")
    target = folder / "maps.md"
    target.write_text(report(results), encoding="utf-8")
    return target


if __name__ == "__main__":
    typer.run(main)
