"""Part `hostile`: callers that mean no good, and days on which everything goes wrong at once."""

from collections.abc import Callable
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.reliability.hostile import bodies, clock, crowd, disk, kills, names, slow

TRIALS: Final[dict[str, Callable[..., Figures]]] = {
    "slow": slow.run,
    "bodies": bodies.run,
    "names": names.run,
    "crowd": crowd.run,
    "clock": clock.run,
    "kills": kills.run,
    "disk": disk.run,
}


def run(*, quick: bool, seed: int) -> Figures:
    """All trials; each has `problems`, empty where everything went as it should."""
    return {"trials": {name: trial(quick=quick, seed=seed) for name, trial in TRIALS.items()}}
