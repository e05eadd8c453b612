"""Pictures of maps, drawn from the JSON."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

RIGHT, FALSE, TRUTH, PATH = "#0072b2", "#d55e00", "#bbbbbb", "#1a1a1a"


def drive(figures: dict[str, Any]) -> Figure:
    """A drive by odometry alone, with every loop, and as a map, with the loops that were kept."""
    shown = figures["picture"]
    figure = Figure(figsize=(9.6, 4.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    before, after, truth = (np.array(shown[name]) for name in ("before", "after", "truth"))
    loops = shown["loops"]
    for axes, path, kept, title in (
        (left, before, loops, "by odometry, with every loop that was found"),
        (right, after, [loop for loop in loops if not loop[3]], "the map, with the loops that were kept"),
    ):
        _loops(axes, path, kept)
        axes.plot(*truth.T, color=TRUTH, linewidth=3.0, label="true path", zorder=0)
        axes.plot(*path.T, color=PATH, linewidth=1.0, marker=".", markersize=3.0, label="path")
        false = sum(bool(loop[2]) for loop in kept)
        axes.set(title=f"{title}\n{len(kept) - false} right, {false} false", aspect="equal", xlabel="m")
        axes.grid(visible=False)
    left.legend(loc="lower left", fontsize=7)
    return figure


def _loops(axes: Axes, path: Any, loops: list[Any]) -> None:
    for first, second, false, _ in loops:
        ends = path[[first, second]].T
        axes.plot(*ends, color=FALSE if false else RIGHT, linewidth=0.5, alpha=0.7, zorder=1 if false else 0.5)
