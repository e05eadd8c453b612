"""Fits the numbers of `urquhart/prior/calibration.json`: two straight lines through searches of known truth.

Run as `python -m benchmarks.windows.calibrate`. The forests are other ones than those of the published figures.
"""

import hashlib
import json
import os
from dataclasses import dataclass
from datetime import date
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from scipy.optimize import minimize

import urquhart.prior
from benchmarks.machine import commit
from benchmarks.pool import Pool
from benchmarks.windows import scenes
from benchmarks.windows.searching import search_all
from urquhart import Config
from urquhart.decide.confidence import CONFIDENCE, Calibration, Line
from urquhart.prior.confidence import WINDOW_CALIBRATION, window_logit

SEED: Final = 2000
COMMAND: Final = "python -m benchmarks.windows.calibrate"
FILE: Final = Path(urquhart.prior.__file__).with_name("calibration.json")
COUNTS: Final = (5, 10)
"""Windows of each forest, noise and heading that hold the plot, and that do not."""
WRONG: Final = 0.1
"""Share of priors that are taken to be wrong (another plot's file, another zone): so much count the windows without the
plot, whatever their number. The confidence of an answer is meant for priors of this kind."""


@dataclass(frozen=True, slots=True)
class Job:
    """Windows of one forest at one noise, with the heading known or not."""

    name: str
    noise: float
    heading: bool
    seed: int
    counts: tuple[int, int]


def run(job: Job) -> NDArray[Any]:
    """What is found in the windows of a job: rows of `searching.FOUND`."""
    made = scenes.scenes(job.name, job.noise, heading=job.heading, seed=job.seed, counts=job.counts)
    return search_all(made, Config())


def jobs(part: str, seed: int, counts: tuple[int, int]) -> list[Job]:
    """The jobs of a part: every forest at every noise, the heading known, and unknown in a third as many windows."""
    few = (max(counts[0] // 3, 1), max(counts[1] // 3, 1))
    return [
        Job(name, noise, heading, seed, counts if heading else few)
        for name in scenes.names(part)
        for noise in scenes.NOISE
        for heading in (True, False)
    ]


def fit(found: NDArray[Any]) -> Calibration:
    """The two lines of maximum likelihood for rows (Q,) of `searching.FOUND`, weighted so that `WRONG` of them are
    windows without the plot."""
    right, inside = found["right"].astype(np.float64), found["inside"]
    weight = np.where(inside, (1.0 - WRONG) / inside.sum(), WRONG / (~inside).sum()) * len(found)

    def loss(guess: NDArray[np.float64]) -> float:
        total = logits(found, _lines(guess))
        return float((weight * (np.logaddexp(0.0, total) - right * total)).sum())

    best = minimize(loss, [0.0, -1.0, -1.0, 0.0], method="Nelder-Mead", options={"maxiter": 4000}).x
    return _lines(best)


def _lines(guess: NDArray[np.float64]) -> Calibration:
    chance, even, rival, level = guess.tolist()
    return Calibration(Line(float(np.exp(chance)), even), Line(float(np.exp(rival)), level))


def logits(found: NDArray[Any], lines: Calibration) -> NDArray[np.float64]:
    """Log-odds of being right (Q,) that two lines give to rows (Q,)."""
    values = [
        window_logit(near, apart, repeated, lines)
        for near, apart, repeated in found[["near", "apart", "repeated"]].tolist()
    ]
    return np.array(values, dtype=np.float64)


def accepted(found: NDArray[Any], lines: Calibration) -> dict[str, int]:
    """How many of rows (Q,) two lines let pass at the default gate, and how many of those are wrong."""
    passed = (logits(found, lines) >= Config().gate) & (found["evidence"] > 0.0)
    return {"accepted": int(passed.sum()), "wrong": int((passed & ~found["right"]).sum())}


def dependencies() -> dict[str, str]:
    """A digest of everything that the fit takes as given, by name: the tuning numbers of the search in a window, the
    bounds around the lines, and what two searches find, which changes with the formulas."""
    found: dict[str, object] = {"config": Config().reach, "bounds": tuple(CONFIDENCE), "worth": _worth()}
    for module in iter_modules(urquhart.prior.__path__):
        name = f"urquhart.prior.{module.name}"
        for value in vars(import_module(name)).values():
            kind = type(value)
            if isinstance(value, tuple) and kind.__name__.endswith("Numbers") and kind.__module__ == name:
                found[f"{name}.{kind.__name__}"] = value
    return {name: hashlib.sha256(repr(value).encode()).hexdigest()[:16] for name, value in found.items()}


def _worth() -> list[str]:
    """What is found in two windows of a simulated plantation, to three digits: no machine differs there."""
    made = scenes.scenes("rows 4 x 2", 0.3, heading=True, seed=1, counts=(1, 1))
    found = search_all(made, Config())
    return [f"{value:.3g}" for row in found[["near", "apart", "repeated"]].tolist() for value in row]


def stale() -> list[str]:
    """What the fit of `FILE` depends on and what has changed since, by name."""
    before, now = read()["depends_on"], dependencies()
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def read() -> dict[str, Any]:
    """The calibration file."""
    held: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return held


def main(
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = SEED,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
    adopt: Annotated[bool, typer.Option("--adopt", help="Keep the fit in the file, and use it.")] = False,
    keep: Annotated[Path | None, typer.Option(help="Write every single search to this file, as .npy.")] = None,
) -> None:
    """Print the fitted numbers, and what those and the ones in use make of the same searches."""
    console = Console()
    with Progress(console=console) as progress, Pool(workers, progress) as pool:
        work = jobs("fitted", seed, COUNTS)
        found = pool.map(run, work, "windows")
    everything = np.concatenate(found)
    if keep is not None:
        np.save(keep, everything)
    for name, lines in {"in use": WINDOW_CALIBRATION, "fitted": fit(everything)}.items():
        chance, rival = lines
        text = f"{name}: chance {chance.slope:.3f} / {chance.even:.2f}, rival {rival.slope:.3f} / {rival.even:.2f}"
        console.print(text, highlight=False)
        for forest in scenes.names("fitted"):
            rows = np.concatenate([one for job, one in zip(work, found, strict=True) if job.name == forest])
            passed, wrong = accepted(rows, lines).values()
            surest = logits(rows, lines)[~rows["right"]].max()
            text = f"  {forest}: {passed} of {int(rows['inside'].sum())} accepted, {wrong} wrong; surest wrong one at "
            console.print(f"{text}{surest:.2f}", highlight=False)
    if adopt:
        write(fit(everything), everything, seed)
        console.print(f"written to {FILE.name}", highlight=False)


def write(fitted: Calibration, found: NDArray[Any], seed: int) -> None:
    """Write a fit to `FILE`, with what it comes from."""
    described = {
        name: {"slope": round(line.slope, 4), "even": round(line.even, 3)}
        for name, line in zip(fitted._fields, fitted, strict=True)
    }
    held = {
        "in_use": described,
        "fit": {
            "command": f"{COMMAND}{f' --seed {seed}' if seed != SEED else ''} --adopt",
            "seed": seed,
            "date": date.today().isoformat(),
            "commit": commit(),
            "forests": scenes.names("fitted"),
            "windows": len(found),
            "with_the_plot": int(found["inside"].sum()),
            "wrong_priors": WRONG,
            "result": accepted(found, fitted),
        },
        "depends_on": dependencies(),
    }
    FILE.write_text(json.dumps(held, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
