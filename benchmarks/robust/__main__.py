"""`make bench-robust`: how the default method holds, with one configuration for all of it."""

import os
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from rich.console import Console

from benchmarks import record
from benchmarks.experiments import Experiment, choose, measure, progress_on
from benchmarks.machine import machine
from benchmarks.markdown import FOLDER
from benchmarks.paper.charts import save
from benchmarks.pool import Pool
from benchmarks.results_page import write_page
from benchmarks.robust import edges, few_trees, grid, rows, stands, table1
from benchmarks.robust.calibration_curve import reliability
from benchmarks.robust.charts import PICTURES

EXPERIMENTS: Final[dict[str, Experiment]] = {
    "robust_table1": table1.run,
    "robust_grid": grid.run,
    "robust_rows": rows.run,
    "robust_edges": edges.run,
    "robust_few_trees": few_trees.run,
    "robust_stands": stands.run,
}
RELIABILITY: Final = "robust_reliability"
FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/robust")
ANSWERS: Final = Path("benchmark-output/robust/answers")
"""Every single answer, so that the reliability of all can be drawn when only some experiments are run again."""


def main(
    quick: Annotated[bool, typer.Option("--quick", help="A smaller version, within three minutes.")] = False,
    out: Annotated[
        Path | None, typer.Option(help=f"Where results.md and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(EXPERIMENTS)}; may be repeated.")] = None,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Run nothing: pictures and page again from the JSON.")
    ] = False,
) -> None:
    """Run the experiments; write JSON, pictures and the page, from these figures and those already there."""
    chosen = [] if redraw else choose(only, EXPERIMENTS)
    folder = out or (QUICK if quick else FULL)
    answers = ANSWERS / ("quick" if quick else "full")
    console = Console()
    with progress_on(console) as progress, Pool(workers, progress) as pool:
        for name in chosen:
            run_experiment(name, pool, folder, answers, quick=quick, seed=seed)
    if not redraw:
        judge(folder, answers)
    for name, picture in PICTURES.items():
        path = folder / FOLDER / f"{name}.json"
        if path.exists():
            save(picture, record.read(path), path.with_suffix(".svg"))
    console.print(f"report: {write_page(folder)}")


def run_experiment(name: str, pool: Pool, folder: Path, answers: Path, *, quick: bool, seed: int) -> None:
    """Run one experiment; write its JSON under `folder` and its single answers under `answers`."""
    figures = measure("benchmarks.robust", name, EXPERIMENTS[name], pool, quick=quick, seed=seed)
    answers.mkdir(parents=True, exist_ok=True)
    np.save(answers / f"{name}.npy", figures.pop("answers"))
    record.write(folder / FOLDER / f"{name}.json", figures)


def judge(folder: Path, answers: Path) -> None:
    """Write the reliability of all answers, where every experiment has left some."""
    paths = {name: answers / f"{name}.npy" for name in EXPERIMENTS}
    if all(path.exists() for path in paths.values()):
        figures = reliability({name: np.load(path) for name, path in paths.items()})
        head = {"machine": machine(), "command": "python -m benchmarks.robust", "seed": 0, "seconds": 0.0}
        record.write(folder / FOLDER / f"{RELIABILITY}.json", head | figures)


if __name__ == "__main__":
    typer.run(main)
