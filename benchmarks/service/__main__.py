"""`make bench`: what the service costs, beside an older commit in the same run."""

import time
from pathlib import Path
from typing import Annotated, Final

import typer

from benchmarks import record
from benchmarks.experiments import Figures, choose
from benchmarks.machine import commit, machine
from benchmarks.scale.other_load import watched
from benchmarks.service import history
from benchmarks.service.parts import PARTS
from benchmarks.service.report import section
from benchmarks.service.versions import BASELINE, Version

FULL: Final = Path("docs/results/service.json")
OUT: Final = Path("benchmark-output/service.json")
KEPT: Final = Path("benchmark-output/commits")


def main(
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(PARTS)}; may be repeated.")] = None,
    against: Annotated[str, typer.Option(help="The commit to compare with; empty for none.")] = BASELINE,
    quick: Annotated[bool, typer.Option("--quick", help="A smaller version, within two minutes.")] = False,
    publish: Annotated[
        bool, typer.Option("--publish", help=f"Write the figures to {FULL}, and docs/scaling.md.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help=f"Only compare with the last line of {history.PAGE}; fail if slower.")
    ] = False,
    release: Annotated[
        str | None, typer.Option(help=f"Only add a line of this name to {history.PAGE}, or replace the one there.")
    ] = None,
) -> None:
    """Measure part by part and print each as ratios to the older commit. Figures of earlier parts are kept."""
    if check:
        raise typer.Exit(history.check())
    if release is not None:
        version = Version.current() if release not in (against, BASELINE) else Version.of_commit(release, KEPT)
        history.add(release, version)
        return
    versions = [*([Version.of_commit(against, KEPT)] if against else []), Version.current()]
    out = FULL if publish else OUT
    figures: Figures = record.read(out) if out.exists() else {}
    for name in choose(only, PARTS):
        typer.echo(f"{name} ...")
        began = time.perf_counter()
        head: Figures = {
            "machine": machine("fastapi", "uvicorn"),
            "commit": commit(),
            "quick": quick,
            "against": against,
        }
        with watched(head):
            found = PARTS[name](versions, quick=quick)
        figures[name] = head | {"seconds": time.perf_counter() - began} | found
        record.write(out, figures)
    typer.echo(section(figures))
    typer.echo(f"figures: {out}")
    if publish:
        typer.echo(f"page: {_write_page()}")


def _write_page() -> Path:
    """docs/scaling.md, of which these figures are a section; its own command draws it."""
    from benchmarks.scale.__main__ import FULL as FOLDER
    from benchmarks.scale.__main__ import write_page  # loads what draws, and FAISS

    return write_page(FOLDER)


if __name__ == "__main__":
    typer.run(main)
