"""`make bench-paper`: the paper's experiments, their pictures and the report."""

import os
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from benchmarks import record
from benchmarks.experiments import Experiment, choose, measure, progress_on
from benchmarks.markdown import FOLDER
from benchmarks.paper import ablation, pr_curves, table1, table2, table3
from benchmarks.paper.charts import PICTURES, SOURCES, draw
from benchmarks.pool import Pool
from benchmarks.results_page import write_page

EXPERIMENTS: Final[dict[str, Experiment]] = {
    "table1": table1.run,
    "pr_curves": pr_curves.run,
    "ablation": ablation.run,
    "table2": table2.run,
    "table3": table3.run,
}
FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/paper")


def main(
    quick: Annotated[bool, typer.Option("--quick", help="A smaller version, within two minutes.")] = False,
    out: Annotated[
        Path | None, typer.Option(help=f"Where results.md and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(EXPERIMENTS)}; may be repeated.")] = None,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
    redraw: Annotated[
        bool,
        typer.Option("--redraw", help="Run nothing: pictures and results.md again from the figures that are there."),
    ] = False,
) -> None:
    """Run the paper's experiments; write JSON, pictures and results.md, from these figures and those already there."""
    chosen = choose(only, EXPERIMENTS)
    folder = out or (QUICK if quick else FULL)
    if redraw:
        for name in chosen:
            draw_pictures(name, folder)
        chosen = []
    console = Console()
    with progress_on(console) as progress, Pool(workers, progress) as pool:
        for name in chosen:
            run_experiment(name, pool, folder, quick=quick, seed=seed)
    console.print(f"report: {write_page(folder)}")


def run_experiment(name: str, pool: Pool, folder: Path, *, quick: bool, seed: int) -> None:
    """Run one experiment; write its JSON and its pictures under `folder`."""
    figures = measure("benchmarks.paper", name, EXPERIMENTS[name], pool, quick=quick, seed=seed)
    record.write(folder / FOLDER / f"{name}.json", figures)
    draw_pictures(name, folder)


def draw_pictures(name: str, folder: Path) -> None:
    """Draw an experiment's pictures from its JSON under `folder`: from what was written, not from what was computed."""
    path = folder / FOLDER / f"{name}.json"
    for picture in PICTURES:
        if path.exists() and SOURCES.get(picture, picture) == name:
            draw(picture, record.read(path), path.with_name(f"{picture}.svg"))


if __name__ == "__main__":
    typer.run(main)
