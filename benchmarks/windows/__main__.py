"""`python -m benchmarks.windows`: searches within a prior, in forests that nothing was fitted on."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from benchmarks import record
from benchmarks.experiments import measure, progress_on
from benchmarks.markdown import FOLDER
from benchmarks.pool import Pool
from benchmarks.results_page import write_page
from benchmarks.windows import calibrate, scenes
from benchmarks.windows.searching import MATCHED, VERDICTS, search_all
from urquhart import Config

NAME: Final = "windows"
COUNTS: Final = (4, 10)
"""Windows of each forest, noise and heading that hold the plot, and that do not."""
TOPS: Final = "tree tops"
"""The group of the plots of `scenes.TOPS`, which others made."""


@dataclass(frozen=True, slots=True)
class TopsJob:
    """The plots of `scenes.TOPS` at one noise: in windows that hold them, or in others."""

    noise: float
    outside: bool
    seed: int


def run_tops(job: TopsJob) -> NDArray[Any]:
    """What is found in the windows of a job: rows of `searching.FOUND`."""
    return search_all(scenes.als_scenes(job.noise, outside=job.outside, seed=job.seed), Config())


def run(pool: Pool, *, quick: bool, seed: int) -> dict[str, Any]:
    """All windows; a quarter of them if `quick`."""
    counts = (1, 3) if quick else COUNTS
    work = calibrate.jobs("held out", seed, counts)
    keys = [(group(one.name), one.noise, one.heading) for one in work]
    found = list(zip(keys, pool.map(calibrate.run, work, "windows"), strict=True))
    if scenes.TOPS.exists():
        sides = (False,) if quick else (False, True)
        tops = [TopsJob(noise, outside, seed) for noise in scenes.NOISE for outside in sides]
        found += zip([(TOPS, one.noise, True) for one in tops], pool.map(run_tops, tops, TOPS), strict=True)
    return figures_of(found)


def figures_of(found: Iterable[tuple[tuple[str, float, bool], NDArray[Any]]]) -> dict[str, Any]:
    """A summary of the windows of each group, noise and heading: rows of `searching.FOUND` by these."""
    parts: dict[tuple[str, float, bool], list[NDArray[Any]]] = {}
    for key, rows in found:
        parts.setdefault(key, []).append(rows)
    return {
        "forests": scenes.names("held out"),
        "parts": [
            {"group": name, "noise": noise, "heading": heading} | summarize(np.concatenate(rows))
            for (name, noise, heading), rows in parts.items()
        ],
    }


def group(name: str) -> str:
    """The group that a forest's figures are pooled in."""
    return "plantations" if name in scenes.PLANTED["held out"] else "forests"


def summarize(found: NDArray[Any]) -> dict[str, Any]:
    """Counts of rows (Q,) of `searching.FOUND`."""
    matched, inside = found["verdict"] == MATCHED, found["inside"]
    return {
        "inside": int(inside.sum()),
        "first": int(found["right"].sum()),
        "right": int((matched & found["right"]).sum()),
        "wrong": int((matched & inside & ~found["right"]).sum()),
        "ambiguous": int((inside & (found["verdict"] == VERDICTS.index("ambiguous"))).sum()),
        "outside": int((~inside).sum()),
        "false": int((matched & ~inside).sum()),
        "seconds": float(np.median(found["seconds"])) if len(found) else None,
    }


def main(
    quick: Annotated[bool, typer.Option("--quick", help="A quarter of the windows.")] = False,
    out: Annotated[Path, typer.Option(help=f"Where results.md and {FOLDER}/ go.")] = Path("docs"),
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
) -> None:
    """Search all windows; write JSON, and the page."""
    console = Console()
    with progress_on(console) as progress, Pool(workers, progress) as pool:
        figures = measure("benchmarks.windows", "", run, pool, quick=quick, seed=seed)
    record.write(out / FOLDER / f"{NAME}.json", figures)
    console.print(f"report: {write_page(out)}")


if __name__ == "__main__":
    typer.run(main)
