"""What the numbers in `urquhart.decide.confidence` were fitted with: two straight lines through answers of known truth.

Run as `python -m benchmarks.robust.calibrate`. The forests are other ones than those of the published figures: seeds
differ, and so does every tree but the real ones.
"""

import os
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from scipy.optimize import minimize

from benchmarks.pool import Pool
from benchmarks.robust import grid, rows, stands
from urquhart import Config, Gates
from urquhart.decide.confidence import chance_logit, combine, rival_logit_from

SEED: Final = 1000
_TOLD: Final = -25.0
"""Lead beyond what says nothing; below it the confidence has a floor."""
_UNKNOWN: Final = -8.0
"""Log-odds of the answers that are left out: nothing was compared for them."""


def gather(pool: Pool, seed: int) -> dict[str, NDArray[Any]]:
    """Answers from each kind of forest."""
    cells = [grid.Job(cell, seed, 80, 800) for cell in range(len(grid.CELLS))]
    kinds = [rows.Job(kind, seed, 60, 170) for kind in range(len(rows.KINDS))]
    real = [stands.Job(name, seed, 16) for name in stands.available()]
    return {
        "grid": np.concatenate(pool.map(grid.run_cell, cells, "extended grid")),
        "plantations": np.concatenate(pool.map(rows.run_kind, kinds, "plantations")),
        "stands": np.concatenate(
            [answers for found in pool.map(stands.run_stand, real, "real stands") for answers in found.values()]
        ),
    }


def fit(answers: NDArray[Any]) -> tuple[float, float, float, float]:
    """Slope and even point of the odds against chance, and of those against a rival, by maximum likelihood."""
    known = answers[(answers["inliers"] > 0) & (answers["log_odds"] > _UNKNOWN)]
    rivalled, config = np.isfinite(known["lead"]), Config()
    odds, right = known["log_odds"].astype(np.float64), known["right"].astype(np.float64)
    share = Gates.of(config).lead_share
    beyond = (
        known["lead"] - config.margin * known["overlap"] - share * np.maximum(known["evidence"] - known["lead"], 0.0)
    )
    beyond = np.where(rivalled, beyond, 0.0)
    # What is hopeless keeps a floor, and says nothing about the line above it.
    told = ~rivalled | (beyond > _TOLD)

    def loss(guess: NDArray[np.float64]) -> float:
        chance = np.exp(guess[0]) * (odds - guess[1])
        rival = np.where(rivalled, np.exp(guess[2]) * (beyond - guess[3]), 50.0)
        total = -np.logaddexp(-chance, -rival)
        return float((np.logaddexp(0.0, total) - right * total)[told].sum())

    found = minimize(loss, [-0.4, -2.0, -1.2, -5.0], method="Nelder-Mead", options={"maxiter": 4000}).x
    return float(np.exp(found[0])), float(found[1]), float(np.exp(found[2])), float(found[3])


def logits(answers: NDArray[Any], margin: float) -> NDArray[np.float64]:
    """Log-odds of being right (Q,) as the method has them now."""
    return np.array(
        [
            combine(
                chance_logit(float(row["log_odds"])),
                rival_logit_from(float(row["evidence"]), float(row["lead"]), int(row["overlap"]), margin)
                if np.isfinite(row["lead"])
                else np.inf,
            )
            for row in answers
        ]
    )


def main(
    seed: Annotated[int, typer.Option(help="Of all randomness.")] = SEED,
    workers: Annotated[int, typer.Option(help="Processes, one thread each.")] = os.cpu_count() or 1,
) -> None:
    """Print the fitted numbers, and what the present ones make of the same answers."""
    console = Console()
    with Progress(console=console) as progress, Pool(workers, progress) as pool:
        kinds = gather(pool, seed)
    everything = np.concatenate(list(kinds.values()))
    slope, even, steep, level = fit(everything)
    console.print(f"against chance: slope {slope:.3f}, even at {even:.2f}", highlight=False)
    console.print(f"against a rival: slope {steep:.3f}, even at {level:.2f}", highlight=False)
    for name, answers in kinds.items():
        known = answers[answers["inliers"] > 0]
        logit = logits(known, Config().margin)
        wrong = ~known["right"]
        accepted = logit >= Config().gate
        console.print(
            f"{name}: {len(known)} answers, {int(accepted.sum())} accepted, {int((accepted & wrong).sum())} of them "
            f"wrong; the surest wrong one at {logit[wrong].max():.2f}"
        )


if __name__ == "__main__":
    typer.run(main)
