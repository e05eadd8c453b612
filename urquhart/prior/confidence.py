"""The confidence of a pose within a window: against chance, and against a forest that repeats itself.

Chance. The posterior over chance of all poses of the window, summed up about the best one, is a likelihood ratio: the
plot is there, or only trees that have nothing to do with it. In a forest of independent trees its expectation in a
window without the plot is 1, whatever the window's size; so no penalty for the number of poses is needed.

Rivals. A forest that repeats itself also fits the mirror image of the plot, the plot turned to where the prior says
that it is not, or another place of the window. Each says how much evidence a wrong pose reaches here, so what counts is
the lead over it, as far as chance does not explain it: with the probability that the line for chance gives to its
evidence, it is a repetition.

Two straight lines turn both numbers into log-odds of being right, as in `urquhart.decide.confidence`. They are fitted
to windows of known truth by `python -m benchmarks.windows.calibrate`, and kept in `calibration.json`.
"""

import json
from importlib.resources import files
from typing import Final

import numpy as np

from urquhart.decide.confidence import CONFIDENCE, Calibration, Line, combine

_FITTED: Final = json.loads(files("urquhart.prior").joinpath("calibration.json").read_text(encoding="utf-8"))["in_use"]
WINDOW_CALIBRATION: Final = Calibration(*(Line(**_FITTED[name]) for name in Calibration._fields))
"""The lines in use; `calibration.json` says how they were fitted."""


def window_chance_logit(near: float, lines: Calibration = WINDOW_CALIBRATION) -> float:
    """Log-odds that a place is right, and not a coincidence.

    `near`: logarithm of posterior over chance of the place.
    """
    return lines.chance.slope * (max(near, CONFIDENCE.unknown) - lines.chance.even)


def window_rival_logit(near: float, rival: float, lines: Calibration = WINDOW_CALIBRATION) -> float:
    """Log-odds that a place is right, and no repetition of the forest.

    Args:
        near, rival: logarithm of posterior over chance of the place, and of what may be a repetition.
    """
    lead = lines.rival.slope * (near - rival - lines.rival.even)
    explained = float(np.logaddexp(0.0, -window_chance_logit(rival, lines)))
    return max(lead + explained, CONFIDENCE.least_rival_logit)


def window_logit(near: float, apart: float, repeated: float, lines: Calibration = WINDOW_CALIBRATION) -> float:
    """Log-odds that a place is right.

    Args:
        near, apart, repeated: logarithm of posterior over chance of the place, of all other poses of the window, and of
            windows that surely do not hold the observation.
    """
    rival = window_rival_logit(near, max(apart, repeated), lines)
    return combine(window_chance_logit(near, lines), rival)
