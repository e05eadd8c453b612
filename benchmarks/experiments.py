"""What the benchmark commands share: choosing experiments, running one, and saying where its figures come from."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from benchmarks.machine import LIBRARIES, commit, machine
from benchmarks.markdown import number, page, prose, table
from benchmarks.pool import Pool

Figures = dict[str, Any]
Experiment = Callable[..., Figures]
"""Called with a pool, `quick` and `seed`."""


def choose(only: Sequence[str] | None, experiments: Mapping[str, Experiment]) -> list[str]:
    """The experiments asked for, all where none is named. Raises typer.BadParameter for one that is not there."""
    unknown = [name for name in only or () if name not in experiments]
    if unknown:
        raise typer.BadParameter(f"{unknown[0]!r} is none of {', '.join(experiments)}")
    return list(only or experiments)


def progress_on(console: Console) -> Progress:
    """A bar for each experiment."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TimeRemainingColumn(), console=console)


def measure(module: str, name: str, experiment: Experiment, pool: Pool, *, quick: bool, seed: int) -> Figures:
    """Run an experiment of `module`, by its `name` if there are several; its figures under what made them."""
    started = time.perf_counter()
    figures = experiment(pool, quick=quick, seed=seed)
    command = f"python -m {module}{' --quick' if quick else ''}{f' --seed {seed}' if seed else ''}"
    command += f" --only {name}" if name else ""
    head = {"machine": machine(), "commit": commit(), "command": command, "seed": seed}
    return head | {"seconds": time.perf_counter() - started} | figures


def provenance(results: Mapping[str, Figures]) -> str:
    """Which machine and which commands made the figures, and of which commit of the code."""
    described = next(iter(results.values()))["machine"]
    versions = ", ".join(f"{name} {described['versions'][name]}" for name in LIBRARIES)
    made = [
        [
            f"`results/{name}.json`",
            f"`{figures['command']}`",
            figures.get("commit") or "-",
            ", ".join(map(str, figures.get("seeds", [figures["seed"]]))),
            number(figures["seconds"] / 60.0, 1),
        ]
        for name, figures in results.items()
    ]
    return page(
        prose(
            f"Machine: {described['processor']}, {described['cores']} cores, Python {described['python']}, {versions}."
        ),
        table(["figures", "made by", "commit", "seeds", "minutes"], made, words=3),
    )
