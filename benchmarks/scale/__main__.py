"""`make bench-scale`: how recall, time, memory and disk grow with the number of submaps."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Annotated, Any, Final

import typer

from benchmarks import record
from benchmarks.machine import commit, machine
from benchmarks.markdown import FOLDER, page
from benchmarks.paper.charts import save
from benchmarks.scale.charts import PICTURES
from benchmarks.scale.measurement import Figures, Measurement
from benchmarks.scale.measurement_plan import PARTS, SIZES, asked
from benchmarks.scale.other_load import watched
from benchmarks.scale.report import write_report
from benchmarks.scale.worker import run_alone
from benchmarks.service import report as service_report

FULL: Final = Path("docs")
QUICK: Final = Path("benchmark-output/scale-quick")
WORK: Final = Path("benchmark-output/scale")
NAME: Final = "scale"
PAGE: Final = "scaling.md"


def main(
    max_n: Annotated[int, typer.Option(help=f"Largest number of submaps, of {', '.join(map(str, SIZES))}.")] = 100_000,
    min_n: Annotated[int, typer.Option(help="Smallest number; what is known of smaller ones stays.")] = SIZES[0],
    quick: Annotated[bool, typer.Option("--quick", help="Few queries, 10,000 submaps at most.")] = False,
    out: Annotated[
        Path | None, typer.Option(help=f"Where {PAGE} and {FOLDER}/ go. [default: {FULL}; {QUICK} with --quick]")
    ] = None,
    work: Annotated[Path, typer.Option(help="Where forests, databases and what is measured are kept.")] = WORK,
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes where several work together.")] = os.cpu_count() or 1,
    fresh: Annotated[bool, typer.Option("--fresh", help="Start over; else what is measured already stays.")] = False,
    again: Annotated[
        list[str] | None,
        typer.Option(help=f"Measure this again, and what comes after it; may be repeated. Of {', '.join(PARTS)}."),
    ] = None,
    redraw: Annotated[bool, typer.Option("--redraw", help="Measure nothing: pictures and page from the JSON.")] = False,
) -> None:
    """Measure size by size, each part in a process of its own; write JSON, pictures and the page after each size."""
    unknown = [name for name in again or () if name not in PARTS]
    if unknown:
        raise typer.BadParameter(f"{unknown[0]!r} is none of {', '.join(PARTS)}")
    folder = out or (QUICK if quick else FULL)
    if redraw:
        write_page(folder)
        return
    for size in (size for size in sizes(max_n, quick) if size >= min(min_n, max_n)):
        room = work / f"{'quick' if quick else 'full'}-{seed}" / str(size)
        if fresh and room.exists():
            shutil.rmtree(room)
        for name in again or ():
            _record(room, name).unlink(missing_ok=True)
        measured = measure(size, room, quick=quick, seed=seed, workers=workers)
        command = f"python -m benchmarks.scale{' --quick' if quick else ''}{f' --seed {seed}' if seed else ''}"
        keep(folder, size, measured, {"command": f"{command} --max-n {max_n}", "seed": seed})
        typer.echo(f"page: {write_page(folder)}")


def sizes(max_n: int, quick: bool) -> list[int]:
    """Those of `SIZES` up to `max_n`, or that one alone where it is smaller than all of them."""
    limit = min(max_n, SIZES[1]) if quick else max_n
    return [size for size in SIZES if size <= limit] or [limit]


def measure(
    size: int, room: Path, *, quick: bool, seed: int, workers: int, run: Callable[[Measurement], Figures] = run_alone
) -> dict[str, Figures]:
    """All parts of a size by name; those that were measured before, and nothing before them since, are read."""
    room.mkdir(parents=True, exist_ok=True)
    for name, part in PARTS.items():
        if size > part.largest or (name == "compile" and size != SIZES[0]):
            continue
        if is_done(room, name):
            typer.echo(f"{size:>9,} {name}: measured before")
            continue
        typer.echo(f"{size:>9,} {name}")
        measurement = Measurement(
            name, size, str(room.absolute()), asked(name, size, quick), seed, workers, part.forest
        )
        around: Figures = {}
        with watched(around):
            figures = middle([run(measurement) for _ in range(1 if quick else part.runs)])
        record.write(_record(room, name), figures | around)
        typer.echo(f"{size:>9,} {name}: {around['spent_seconds']:.1f} s, others on {around['others']:.1f} cores")
    return {name: record.read(_record(room, name)) for name in PARTS if _record(room, name).exists()}


def is_done(room: Path, name: str) -> bool:
    """Whether a part was measured, after all that comes before it."""
    path = _record(room, name)
    if not path.exists():
        return False
    made = path.stat().st_mtime_ns
    return all(
        is_done(room, before) and _record(room, before).stat().st_mtime_ns <= made for before in PARTS[name].after
    )


def middle(runs: list[Figures]) -> Figures:
    """The median of each figure over several runs."""
    if len(runs) == 1:
        return runs[0]
    return {name: _middle([run[name] for run in runs]) for name in runs[0]}


def _middle(values: list[Any]) -> Any:
    return middle(values) if isinstance(values[0], dict) else median(values)


def keep(folder: Path, size: int, measured: dict[str, Figures], head: Figures) -> None:
    """Put a size's figures into the JSON under `folder`; those of other sizes stay."""
    path = folder / FOLDER / f"{NAME}.json"
    there = record.read(path)["sizes"] if path.exists() else {}
    spent = sum(figures["spent_seconds"] for figures in measured.values())
    there[str(size)] = {"machine": machine(), "commit": commit(), "seconds": spent, "parts": measured}
    record.write(path, head | {"sizes": dict(sorted(there.items(), key=lambda entry: int(entry[0])))})


def write_page(folder: Path) -> Path:
    """Draw the pictures and write the page, from the JSON under `folder`; where the page went."""
    path = folder / FOLDER / f"{NAME}.json"
    figures = record.read(path)
    for name, picture in PICTURES.items():
        save(picture, figures, path.with_name(f"{name}.svg"))
    target = folder / PAGE
    target.write_text(page_of(folder), encoding="utf-8")
    return target


def page_of(folder: Path) -> str:
    """The page, from the JSON under `folder`, with what the service costs where that was measured."""
    costs = folder / FOLDER / f"{service_report.NAME}.json"
    parts = [write_report(record.read(folder / FOLDER / f"{NAME}.json"))]
    if costs.exists():
        parts.append(service_report.section(record.read(costs)))
    return page(*parts)


def _record(room: Path, name: str) -> Path:
    return room / f"{name}.json"


if __name__ == "__main__":
    typer.run(main)
