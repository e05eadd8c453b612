"""Fits the numbers of `urquhart/calibration.json`: two straight lines through answers of known truth.

Run as `python -m benchmarks.robust.calibrate`. The forests are other ones than those of the published figures: seeds
differ, and so does every tree but the real ones.
"""

import hashlib
import json
import os
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

import urquhart
from benchmarks.machine import commit
from benchmarks.pool import Pool
from benchmarks.robust import few_trees, grid, rows, stands
from benchmarks.robust.known_places import AskedPart
from urquhart import SE2, Config, Recognizer, describe
from urquhart.decide.confidence import CALIBRATION, CONFIDENCE, Calibration, Line
from urquhart.evaluation.simulation import Sensor, observe, paper_forest, plantation

SEED: Final = 1000
COMMAND: Final = "python -m benchmarks.robust.calibrate"
FILE: Final = Path(urquhart.__file__).with_name("calibration.json")
ROOMS: Final = ("verify", "decide")
"""Rooms of the method whose tuning numbers decide what a pose is worth, and so what the fit is made of."""
_TOLD: Final = -25.0
"""Lead beyond what says nothing; below it the confidence has a floor."""


def gather(pool: Pool, seed: int, *, quick: bool) -> dict[str, NDArray[Any]]:
    """Answers from each kind of forest; a quarter of them if `quick`."""
    part = 4 if quick else 1
    cells = [AskedPart(cell, seed, 80 // part, 800 // part) for cell in range(len(grid.CELLS))]
    kinds = [AskedPart(kind, seed, 60 // part, 170 // part) for kind in range(len(rows.KINDS))]
    few = [AskedPart(cell, seed, 100 // part, 100 // part) for cell in range(len(few_trees.CELLS))]
    real = [stands.Job(name, seed, 16 // part) for name in stands.available()]
    return {
        "grid": np.concatenate(pool.map(grid.run_cell, cells, "extended grid")),
        "plantations": np.concatenate(pool.map(rows.run_kind, kinds, "plantations")),
        "few trees": np.concatenate(pool.map(few_trees.run_cell, few, "few trees")),
        "stands": np.concatenate(
            [answers for found in pool.map(stands.run_stand, real, "real stands") for answers in found.values()]
        ),
    }


def fit(answers: NDArray[Any]) -> Calibration:
    """The two lines of maximum likelihood for answers (Q,)."""
    known = answers[(answers["inliers"] > 0) & (answers["log_odds"] > CONFIDENCE.unknown)]
    rivalled = np.isfinite(known["lead"])
    odds, right = known["log_odds"].astype(np.float64), known["right"].astype(np.float64)
    beyond = np.where(rivalled, _beyond(known), 0.0)
    # What is hopeless keeps a floor, and says nothing about the line above it.
    told = ~rivalled | (beyond > _TOLD)

    def loss(guess: NDArray[np.float64]) -> float:
        chance = np.exp(guess[0]) * (odds - guess[1])
        rival = np.where(rivalled, np.exp(guess[2]) * (beyond - guess[3]), 50.0)
        total = -np.logaddexp(-chance, -rival)
        return float((np.logaddexp(0.0, total) - right * total)[told].sum())

    found = minimize(loss, [-0.4, -2.0, -1.2, -5.0], method="Nelder-Mead", options={"maxiter": 4000}).x
    chance, even, rival, level = found.tolist()
    return Calibration(Line(float(np.exp(chance)), even), Line(float(np.exp(rival)), level))


def logits(answers: NDArray[Any], lines: Calibration) -> NDArray[np.float64]:
    """Log-odds of being right (Q,) that two lines give to answers (Q,)."""
    chance, rival = lines
    against_chance = chance.slope * (np.maximum(answers["log_odds"], CONFIDENCE.unknown) - chance.even)
    against_rival = np.maximum(rival.slope * (_beyond(answers) - rival.even), CONFIDENCE.least_rival_logit)
    combined: NDArray[np.float64] = -np.logaddexp(
        -against_chance, -np.where(np.isfinite(answers["lead"]), against_rival, np.inf)
    )
    return combined


def _beyond(answers: NDArray[Any]) -> NDArray[np.float64]:
    """Leads (Q,) minus the part that says nothing; NaN where there is no rival."""
    known = {name: answers[name].astype(np.float64) for name in ("evidence", "lead", "overlap")}
    penalty = CONFIDENCE.rival_penalty * np.maximum(known["evidence"] - known["lead"], 0.0)
    beyond: NDArray[np.float64] = known["lead"] - Config().lead_per_landmark * known["overlap"] - penalty
    return beyond


def accepted(answers: NDArray[Any], lines: Calibration) -> dict[str, int]:
    """How many of answers (Q,) two lines let pass at the default gate, and how many of those are wrong."""
    passed = (logits(answers, lines) >= Config().gate) & (answers["evidence"] > 0.0)
    return {"accepted": int(passed.sum()), "wrong": int((passed & ~answers["right"]).sum())}


def dependencies() -> dict[str, str]:
    """A digest of everything that the fit takes as given, by name.

    These are the tuning numbers of `ROOMS`, the parameters of `Config` that decide what a pose is worth, and the worth
    of two poses: it changes with the formulas.
    """
    config = Config()
    found: dict[str, object] = {"config": (config.sigma, config.lead_per_landmark, config.reach), "worth": _worth()}
    for room in ROOMS:
        for module in iter_modules(import_module(f"urquhart.{room}").__path__):
            name = f"urquhart.{room}.{module.name}"
            for value in vars(import_module(name)).values():
                kind = type(value)
                if isinstance(value, tuple) and kind.__name__.endswith("Numbers") and kind.__module__ == name:
                    found[f"{name}.{kind.__name__}"] = value
    return {name: hashlib.sha256(repr(value).encode()).hexdigest()[:16] for name, value in found.items()}


def _worth() -> list[str]:
    """Log-odds and lead of the true pose in a forest and in a plantation, to three digits: no machine differs there."""
    forest = paper_forest(np.random.default_rng(1), 200.0)
    planted = plantation(200.0, 200.0, np.random.default_rng(2), spacing=(3.0, 3.0), jitter=0.15, survival=0.95)
    config, rng, worth = Config(), np.random.default_rng(3), list[str]()
    stored, asked = SE2(100.0, 100.0, 0.5), SE2(104.0, 97.0, 2.0)
    for trees, radius in ((forest, 45.0), (planted, 20.0)):
        there, seen = (
            describe(observe(trees, pose, Sensor(radius, sigma=0.1, detection=0.9), rng).xy, config)
            for pose in (stored, asked)
        )
        recognizer = Recognizer(config)
        recognizer.add([(0, there)])
        (found,) = recognizer.verify_pose(seen, 0, stored.inverse() @ asked).candidates
        worth += [f"{found.log_odds:.3g}", f"{np.nan if found.lead is None else found.lead:.3g}"]
    return worth


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
    quick: Annotated[bool, typer.Option("--quick", help="A quarter of the answers.")] = False,
    record: Annotated[
        bool, typer.Option("--record", help="Keep the fit in the file, beside the lines in use.")
    ] = False,
    adopt: Annotated[bool, typer.Option("--adopt", help="Keep the fit in the file, and use it.")] = False,
) -> None:
    """Print the fitted numbers, and what those and the ones in use make of the same answers."""
    console = Console()
    with Progress(console=console) as progress, Pool(workers, progress) as pool:
        kinds = gather(pool, seed, quick=quick)
    kinds = {name: answers[answers["inliers"] > 0] for name, answers in kinds.items()}
    everything = np.concatenate(list(kinds.values()))
    lines = {"in use": CALIBRATION, "fitted": fit(everything)}
    for name, (chance, rival) in lines.items():
        text = f"{name}: chance {chance.slope:.3f} / {chance.even:.2f}, rival {rival.slope:.3f} / {rival.even:.2f}"
        console.print(text, highlight=False)
        for kind, answers in kinds.items():
            passed, wrong = accepted(answers, lines[name]).values()
            surest = logits(answers, lines[name])[~answers["right"]].max()
            text = f"  {kind}: {passed} of {len(answers)} accepted, {wrong} wrong; surest wrong one at {surest:.2f}"
            console.print(text, highlight=False)
    if record or adopt:
        command = command_of(seed, quick=quick, record=record, adopt=adopt)
        write(lines["fitted"], everything, command, seed, adopt=adopt)
        console.print(f"written to {FILE.name}", highlight=False)


def command_of(seed: int, *, quick: bool, record: bool, adopt: bool) -> str:
    """The command that was run, as the file has it."""
    options = {f" --seed {seed}": seed != SEED, " --record": record, " --adopt": adopt, " --quick": quick}
    return COMMAND + "".join(option for option, given in options.items() if given)


def write(fitted: Calibration, answers: NDArray[Any], command: str, seed: int, *, adopt: bool) -> None:
    """Write a fit to `FILE`, with what it comes from; the lines in use stay, unless it is adopted."""
    described = {
        name: {"slope": round(line.slope, 4), "even": round(line.even, 3)}
        for name, line in zip(fitted._fields, fitted, strict=True)
    }
    held = read()
    if adopt:
        # The note says why the lines in use are not those of the latest fit.
        held = {"in_use": described}
    held["fit"] = {
        "command": command,
        "seed": seed,
        "date": date.today().isoformat(),
        "commit": commit(),
        "answers": len(answers),
        **described,
        "result": accepted(answers, fitted),
        "result_of_those_before": accepted(answers, CALIBRATION),
    }
    held["depends_on"] = dependencies()
    FILE.write_text(json.dumps(held, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
