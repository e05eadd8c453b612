"""`make kernels`, second half: compile the kernels that only benchmarks and tests use.

Test processes that start at the same time would each compile them: the trees of simulated forests in nearly all, and
the methods that the paper is compared with.
"""

import numpy as np

from benchmarks.paper.attempts import attempt
from benchmarks.paper.drive import ROTATIONS, drive
from benchmarks.paper.methods import Glarot, Li, Paper
from urquhart import Config
from urquhart.evaluation.simulation import paper_forest


def main() -> None:
    """Compile them, or load them from the cache. The sizes are the smallest that reach all of them."""
    paper_forest(np.random.default_rng(0), 60.0)
    driven = drive(2, 0, 0.2, 0.9, ROTATIONS["full"])
    for method in (Paper(Config()), Glarot(), Li()):
        attempt(driven, method, Config(), np.random.default_rng(0))


if __name__ == "__main__":
    main()
