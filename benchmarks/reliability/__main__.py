"""`make bench-reliability`: every part, or those that are named, and the page."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import typer

from benchmarks import record
from benchmarks.experiments import Figures, choose
from benchmarks.machine import commit, machine
from benchmarks.markdown import FOLDER
from benchmarks.reliability import (
    contract,
    exhaustion,
    fuzz_readers,
    hostile,
    load,
    meetings,
    per_session,
    shape_costs,
    upload_beside_queries,
)
from benchmarks.reliability.report import write_report

PARTS: Final[dict[str, Callable[..., Figures]]] = {
    "contract": contract.run,
    "readers": fuzz_readers.run,
    "load": load.run,
    "fleet": per_session.run,
    "season": upload_beside_queries.run,
    "meetings": meetings.run,
    "hostile": hostile.run,
    "shapes": shape_costs.run,
    "exhaustion": exhaustion.run,
}
FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/reliability")
PAGE: Final = "reliability.md"
_LIBRARIES: Final = ("fastapi", "uvicorn", "pydantic", "orjson", "sqlalchemy", "schemathesis", "hypothesis", "httpx")


def main(
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(PARTS)}; may be repeated.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smaller version, within a few minutes.")] = False,
    out: Annotated[
        Path | None, typer.Option(help=f"Where {PAGE} and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    redraw: Annotated[bool, typer.Option("--redraw", help="Run nothing: the page again from the JSON.")] = False,
) -> None:
    """Run the parts one after the other; write the JSON of each and the page, from these and those already there."""
    folder = out or (QUICK if quick else FULL)
    for name in [] if redraw else choose(only, PARTS):
        typer.echo(f"{name} ...")
        began = time.perf_counter()
        figures = PARTS[name](quick=quick, seed=seed)
        command = f"python -m benchmarks.reliability{' --quick' if quick else ''}{f' --seed {seed}' if seed else ''}"
        head = {
            "machine": machine(*_LIBRARIES),
            "commit": commit(),
            "command": f"{command} --only {name}",
            "seed": seed,
            "seconds": time.perf_counter() - began,
        }
        record.write(path_of(folder, name), head | figures)
        typer.echo(f"{name}: {head['seconds']:.0f} s")
    typer.echo(f"page: {write_page(folder)}")


def path_of(folder: Path, name: str) -> Path:
    """Where the figures of a part lie."""
    return folder / FOLDER / f"reliability_{name}.json"


def write_page(folder: Path) -> Path:
    """Write the page from the figures that are there; where it went."""
    paths = {name: path_of(folder, name) for name in PARTS}
    target = folder / PAGE
    target.write_text(write_report({n: record.read(p) for n, p in paths.items() if p.exists()}), encoding="utf-8")
    return target


if __name__ == "__main__":
    typer.run(main)
