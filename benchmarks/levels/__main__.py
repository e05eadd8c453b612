"""`make bench-levels`: what each level of the search adds in right answers, and what it costs in time."""

import os
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from rich.console import Console

from benchmarks import record
from benchmarks.experiments import measure, progress_on
from benchmarks.levels import cases
from benchmarks.levels.report import NAME
from benchmarks.levels.summary import summarize
from benchmarks.markdown import FOLDER
from benchmarks.pool import Pool
from benchmarks.results_page import write_page

FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/levels")


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """Ask all worlds; figures by the name of the world."""
    figures = {}
    for name in cases.WORLDS:
        jobs = cases.jobs(name, seed, quick=quick)
        found = pool.map(cases.run, jobs, name) if jobs else []
        asked = np.concatenate(found) if found else np.empty(0)
        if len(asked):
            figures[name] = summarize(asked)
    return {"worlds": figures}


def main(
    quick: Annotated[bool, typer.Option("--quick", help="A small part of it, within a minute or two.")] = False,
    out: Annotated[
        Path | None, typer.Option(help=f"Where results.md and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
) -> None:
    """Ask every world level by level; write JSON and the page."""
    folder, console = out or (QUICK if quick else FULL), Console()
    with progress_on(console) as progress, Pool(workers, progress) as pool:
        figures = measure("benchmarks.levels", "", run, pool, quick=quick, seed=seed)
    record.write(folder / FOLDER / f"{NAME}.json", figures)
    console.print(f"report: {write_page(folder)}")


if __name__ == "__main__":
    typer.run(main)
