"""Whether the diameters of a plot are in another unit than those of the map: by the trees that both have."""

import math
from typing import Final

import numpy as np

from server.coregistration.results import PlotResult

_LEAST: Final = 8
"""Pairs from which their median says something of the unit."""
_NEAR: Final = 0.1
"""Share by which the median of ratios may be off a factor: growth and bark change diameters by less between surveys."""
_FACTORS: Final = (
    (2.54, "2.54", "are they in inches? (--dbh-unit in)"),
    (1 / 2.54, "2.54", "is only the map in inches, or are they not in inches? (--dbh-unit)"),
    (10.0, "10", "are they in cm and were read in mm? (--dbh-unit cm)"),
    (0.1, "10", "are they in mm? (--dbh-unit mm)"),
    (100.0, "100", "are they in m? (--dbh-unit m)"),
    (0.01, "100", "are they in cm and were read in m? (--dbh-unit cm)"),
    (math.pi, "3.14", "does the map have circumferences in place of diameters?"),
    (1 / math.pi, "3.14", "are they circumferences? Divide them by 3.1416"),
)
"""Diameters of the map divided by those of the plot, that factor as text, and what to ask then."""


def diameter_unit(result: PlotResult) -> list[str]:
    """A sentence if the diameters of a plot differ from those of its partners by the factor of a unit; else none."""
    ratios = [
        tree.partner_dbh_cm / tree.dbh_cm for tree in result.trees if tree.dbh_cm and tree.partner_dbh_cm is not None
    ]
    if len(ratios) < _LEAST:
        return []
    median = float(np.median(ratios))
    for factor, told, question in _FACTORS:
        if abs(median / factor - 1.0) <= _NEAR:
            side = "smaller" if factor > 1.0 else "larger"
            return [f"the diameters of the pairs differ by the factor {told}, the plot's are {side}: {question}"]
    return []
