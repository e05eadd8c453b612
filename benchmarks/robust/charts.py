"""Pictures of the figures, drawn from the JSON: SVG, no display needed, the same bytes for the same figures."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from benchmarks.robust.grid import CLUTTERS, DETECTIONS, SIGMAS
from benchmarks.robust.table1 import PEERS

COLOURS: Final = {"robust": "#1a1a1a", "paper": "#0072b2", "glarot-local": "#d55e00", "li": "#009e73"}
NAMES: Final = {"robust": "this project", "paper": "paper, verified", "glarot-local": "GLAROT", "li": "Li et al."}
KINDS: Final = {
    "robust_table1": "Table I",
    "robust_grid": "extended grid",
    "robust_rows": "plantations",
    "robust_edges": "edges of plantations",
    "robust_few_trees": "few trees",
    "robust_stands": "real trees",
}
_PALETTE: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def loop_closure(figures: dict[str, Any]) -> Figure:
    """F1 and milliseconds in the 20 cells, all methods."""
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    cells = [f"{100 * s:.0f} cm\n{100 * d:.0f} %" for s, d in (cell["cell"] for cell in figures["cells"])]
    at = np.arange(len(cells))
    lines = {"robust": [float(np.mean(cell["f1_by_seed"])) for cell in figures["cells"]]}
    times = {"robust": [cell["milliseconds_first"] for cell in figures["cells"]]}
    for name in PEERS:
        lines[name], times[name] = figures["peers"][name]["f1"], figures["peers"][name]["milliseconds"]
    for name in lines:
        left.plot(at, lines[name], marker="o", color=COLOURS[name], label=NAMES[name])
        right.plot(at, times[name], marker="o", color=COLOURS[name], label=NAMES[name])
    left.set(ylabel="F1", ylim=(0.3, 1.02))
    right.set(ylabel="milliseconds a pair, one core", yscale="log")
    right.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for ax in (left, right):
        ax.set_xticks(at[::2], cells[::2], fontsize=7)
    left.legend(loc="lower left")
    return figure


def grid(figures: dict[str, Any]) -> Figure:
    """Recall of the look-up, and over the oracle's, as tables of colours."""
    figure = Figure(figsize=(9.6, 5.6), layout="constrained")
    axes = figure.subplots(2, len(CLUTTERS), sharex=True, sharey=True)
    found, oracle = grid_rates(figures)
    for k, clutter in enumerate(CLUTTERS):
        share = np.where(oracle[k] > 0.02, found[k] / np.maximum(oracle[k], 1e-9), np.nan)
        _table(axes[0, k], found[k])
        _table(axes[1, k], share)
        axes[0, k].set_title(f"false landmarks: {100 * clutter:.0f} %")
        axes[1, k].set_xlabel("noise, cm")
    axes[0, 0].set_ylabel("found and right\ntrees seen, %")
    axes[1, 0].set_ylabel("of what the oracle accepts\ntrees seen, %")
    return figure


def grid_rates(figures: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of the positive pairs found and right, and accepted by the oracle: (clutter, detection, sigma)."""
    shape = (len(CLUTTERS), len(DETECTIONS), len(SIGMAS))
    rows = figures["summaries"]
    found = np.array([row["right"] / row["inside"] for row in rows]).reshape(shape)
    oracle = np.array([row["oracle"] / row["inside"] for row in rows]).reshape(shape)
    return found, oracle


def reliability(figures: dict[str, Any]) -> Figure:
    """Share of right answers against confidence."""
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _reliable(left, figures["bins"], "#1a1a1a", "all answers together")
    kinds = figures["by_kind"]
    for colour, (name, found) in zip(_PALETTE[: len(kinds)], kinds.items(), strict=True):
        _reliable(right, found, colour, KINDS[name])
    for ax in (left, right):
        ax.plot([0, 1], [0, 1], ":", color="#999999", linewidth=1.0)
        ax.set(xlabel="confidence", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        ax.legend(loc="upper left")
    left.set_ylabel("share that is right")
    return figure


def _reliable(ax: Axes, found: list[dict[str, float]], colour: str, label: str) -> None:
    p = np.array([one["confidence"] for one in found])
    share, count = np.array([one["right"] for one in found]), np.array([one["count"] for one in found])
    # Two standard deviations of a share that is what it is said to be.
    spread = 2.0 * np.sqrt(np.maximum(p * (1.0 - p), 1e-6) / count)
    ax.errorbar(p, share, spread, color=colour, marker="o", linestyle="-", capsize=2.0, linewidth=1.0, label=label)


def _table(ax: Axes, values: NDArray[np.float64]) -> None:
    ax.imshow(values, vmin=0.0, vmax=1.0, cmap="viridis", aspect="auto")
    ax.grid(False)
    for (a, b), value in np.ndenumerate(values):
        text = "-" if np.isnan(value) else f"{value:.2f}"
        ax.text(b, a, text, ha="center", va="center", fontsize=7, color="white" if not value > 0.6 else "black")
    ax.set_xticks(range(len(SIGMAS)), [f"{100 * sigma:.0f}" for sigma in SIGMAS])
    ax.set_yticks(range(len(DETECTIONS)), [f"{100 * detection:.0f}" for detection in DETECTIONS])


PICTURES: Final[dict[str, Callable[[dict[str, Any]], Figure]]] = {
    "robust_table1": loop_closure,
    "robust_grid": grid,
    "robust_reliability": reliability,
}
