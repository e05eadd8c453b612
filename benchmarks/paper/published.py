"""The letter's own figures (Nardari et al. 2020, Tables I to III), to stand beside ours."""

from typing import Final

TABLE1: Final = {
    "paper": (
        (1.00, 1.00, 0.95, 0.32),
        (1.00, 0.99, 0.92, 0.32),
        (0.99, 0.98, 0.82, 0.23),
        (0.97, 0.76, 0.45, 0.08),
        (0.66, 0.30, 0.12, 0.01),
    ),
    "glarot": (
        (0.52, 0.27, 0.12, 0.01),
        (0.39, 0.12, 0.04, 0.01),
        (0.17, 0.06, 0.02, 0.00),
        (0.04, 0.01, 0.00, 0.00),
        (0.01, 0.00, 0.00, 0.00),
    ),
    "li": (
        (1.00, 1.00, 0.99, 0.75),
        (0.07, 0.01, 0.00, 0.00),
        (0.00, 0.00, 0.00, 0.00),
        (0.00, 0.00, 0.00, 0.00),
        (0.00, 0.00, 0.00, 0.00),
    ),
}
"""F1: rows are position noise 0 to 40 cm, columns detection 100, 95, 90 and 80 %."""

TABLE2: Final = {
    "human associations": ((0.17, 0.00, 0.54), (0.21, 0.01, 0.67)),
    "paper": ((0.19, 0.00, 0.61), (0.23, 0.01, 0.83)),
    "glarot": ((0.20, 0.01, 0.90), (30.15, 0.03, 89.22)),
    "li": (None, (42.38, 4.79, 125.71)),
}
"""Landmark alignment error, metres: mean, least, most, for flights 1 and 2."""

TABLE2_POSES: Final = {
    "paper": ((0.43, 0.32), (0.26, 0.33)),
    "glarot": ((0.33, 1.54), None),
    "li": (None, None),
}
"""Translation (metres) and rotation (degrees) against the human associations' transforms, for flights 1 and 2.

On flight 2 the letter says only "greater than 15 meters and 200 degrees" of the others.
"""

TABLE3: Final = {
    "paper": ("n log n + l", 16.0, "g_i g_j", 1.24),
    "glarot (Python)": ("n^2", 61.0, "n_i n_j", 2.55),
    "glarot (C++)": ("n^2", 4.0, "n_i n_j", 0.007),
    "li": ("n log n", 15.0, "g_i g_j", 47.0),
}
"""Describing and matching: worst-case order and median milliseconds (Intel i7-7500U)."""


def mean(table: tuple[tuple[float, ...], ...]) -> float:
    """Mean over the cells of a table."""
    cells = [value for row in table for value in row]
    return sum(cells) / len(cells)
