"""Pictures of the figures, drawn from the JSON: SVG, no display needed, the same bytes for the same figures."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from benchmarks.paper import published
from benchmarks.paper.drive import DETECTIONS, SIGMAS
from benchmarks.paper.table1 import best_minimum, f1

COLOURS: Final = {
    "paper": "#0072b2",
    "glarot": "#d55e00",
    "glarot-local": "#d55e00",
    "li": "#009e73",
    "robust": "#1a1a1a",
    "true pairs": "#999999",
}
"""Told apart by readers who do not see red and green (Okabe and Ito's palette)."""
NAMES: Final = {
    "paper": "paper",
    "glarot": "GLAROT",
    "glarot-local": "GLAROT, local",
    "li": "Li et al.",
    "robust": "robust",
    "true pairs": "true pairs",
}
_STYLE: Final[dict[Any, Any]] = {
    "svg.hashsalt": "urquhart",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.0,
    "legend.frameon": False,
}


def draw(name: str, figures: dict[str, Any], path: Path) -> None:
    """Draw the picture `name` of `PICTURES` to `path`."""
    save(PICTURES[name], figures, path)


def save(picture: Callable[[dict[str, Any]], Figure], figures: dict[str, Any], path: Path) -> None:
    """Draw `figures` with `picture` in the style of all pictures, to `path`."""
    with matplotlib.rc_context(_STYLE):
        figure = picture(figures)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Thousands of points are an image inside the SVG; this is its resolution.
        metadata = {"Date": None} if path.suffix == ".svg" else None
        figure.savefig(path, metadata=metadata, facecolor="white", dpi=160)


def loop_closure(figures: dict[str, Any]) -> Figure:
    """F1 against noise, a column of panels for each detection: as in the letter, and verified."""
    methods = figures["rotations"]["full"]["methods"]
    figure = Figure(figsize=(9.6, 5.4), layout="constrained")
    axes = figure.subplots(2, len(DETECTIONS), sharex=True, sharey=True)
    noise = [100.0 * sigma for sigma in SIGMAS]

    def line(ax: Axes, d: int, name: str, scoring: dict[str, Any], style: str, label: str) -> None:
        cells = f1(scoring["counts"])[best_minimum(scoring)].reshape(len(SIGMAS), len(DETECTIONS))
        ax.plot(noise, cells[:, d], style, color=COLOURS[name], marker="o", label=label)

    for d, detection in enumerate(DETECTIONS):
        top, bottom = axes[0, d], axes[1, d]
        for name, table in published.TABLE1.items():
            for ax in (top, bottom)[: 2 if name == "paper" else 1]:
                label = f"{NAMES[name]}, published"
                ax.plot(noise, [row[d] for row in table], "--", color=COLOURS[name], alpha=0.65, label=label)
        for name, variant in (("paper", "paper-letter"), ("glarot", best_gate(methods)), ("li", "li")):
            line(top, d, name, methods[variant]["letter"], "-", f"{NAMES[name]}, here")
        for name in ("paper", "li", "glarot-local"):
            line(bottom, d, name, methods[name]["verified"], "-", NAMES[name])
        line(bottom, d, "robust", methods["robust"]["verdict"], "-", NAMES["robust"])
        top.set_title(f"{100 * detection:.0f} % of trees seen")
        bottom.set_xlabel("noise, cm")
        bottom.set_xticks(noise)
    axes[0, 0].set_ylabel("F1, scored as in the letter")
    axes[1, 0].set_ylabel("F1, verified")
    axes[0, 0].set_ylim(-0.03, 1.05)
    for row in axes:
        row[-1].legend(*row[0].get_legend_handles_labels(), loc="center left", bbox_to_anchor=(1.04, 0.5))
    return figure


def recall_by_distance(figures: dict[str, Any]) -> Figure:
    """Share of pairs found and right against the distance of their poses, over all cells."""
    bins, found = figures["bins"], figures["rotations"]["full"]["recall_by_distance"]
    middles = [0.5 * (a + b) for a, b in pairwise(bins)]
    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    ax = figure.subplots()
    for name in ("robust", "glarot-local", "li", "paper"):
        ax.plot(middles, found[name], marker="o", color=COLOURS[name], label=NAMES[name])
    ax.axvline(50.0, color="#999999", linewidth=1.0, linestyle=":")
    ax.set(xlabel="metres between the poses", ylabel="found and right, verified", ylim=(-0.03, 1.05))
    ax.legend()
    return figure


def pr_curves(figures: dict[str, Any]) -> Figure:
    """Precision against recall: a curve for each tau, and for each gamma."""
    figure = Figure(figsize=(9.0, 3.9), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, sweep, symbol in zip(axes, ("tau", "gamma"), ("\u03c4", "\u03b3"), strict=True):
        curves = [curve for curve in figures["curves"] if curve["sweep"] == sweep]
        shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(curves)))
        for curve, shade in zip(curves, shades, strict=True):
            recall = [point["recall"] for point in curve["points"]]
            precision = [point["precision"] for point in curve["points"]]
            best = max(point["f1"] for point in curve["points"])
            value = "all" if curve[sweep] is None else f"{curve[sweep]:g}"
            ax.plot(recall, precision, marker="o", color=shade, label=f"{symbol} = {value}, best F1 {best:.2f}")
        ax.set(xlabel="recall", xlim=(-0.03, 1.03), ylim=(0.0, 1.03))
        ax.legend(loc="lower left")
    axes[0].set(ylabel="precision", title="Largest descriptor distance")
    tau = next(curve["tau"] for curve in figures["curves"] if curve["sweep"] == "gamma")
    axes[1].set_title(f"Polygons taken from an observation, \u03c4 = {tau:g}")
    return figure


def ablation(figures: dict[str, Any]) -> Figure:
    """What tau does to each figure, and each choice at its best tau."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    default = [row for row in figures["rows"] if row["label"] == "plain, M = 20"]
    taus = [row["tau"] for row in default]
    scores: dict[str, tuple[str, str, Callable[[dict[str, Any]], float]]] = {
        "letter": ("#cc79a7", "pairs, as in the letter", lambda row: max(row["letter"])),
        "verified": ("#0072b2", "pairs, verified", lambda row: verified(row, figures)),
        "collection": ("#e69f00", "in a collection", lambda row: float(row["collection"])),
    }
    for colour, label, value in scores.values():
        left.plot(taus, [value(row) for row in default], marker="o", color=colour, label=label)
    left.axvline(figures["default"]["tau"], color="#999999", linewidth=1.0, linestyle=":")
    left.set(xlabel="\u03c4 (plain distance, M = 20)", ylabel="F1 (pairs), share found (collection)", ylim=(0.0, 1.03))
    left.legend(loc="lower left")
    chosen = best_rows(figures)
    heights = np.arange(len(chosen))[::-1]
    for colour, label, value in scores.values():
        right.plot([value(row) for row in chosen], heights, "o", color=colour, label=label)
    right.set_yticks(heights, [f"{row['label']}, \u03c4 = {row['tau']:g}" for row in chosen])
    right.set(xlabel="the same, each at its best \u03c4", xlim=(0.45, 1.02))
    return figure


def merging(figures: dict[str, Any]) -> Figure:
    """Mean alignment error, and steps that came out right, by map and method."""
    levels = figures["levels"]
    methods = ("true pairs", "robust", "glarot-local", "li", "paper")
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    axes = figure.subplots(len(levels), 2, sharey="row", sharex="col", squeeze=False)
    for (level, maps), (left, right) in zip(levels.items(), axes, strict=True):
        rows = np.arange(len(maps))[::-1]
        for m, name in enumerate(methods):
            at = rows + 0.3 - 0.15 * m
            error = [maps[key][name]["mean"] for key in maps]
            share = [maps[key][name]["right"] / maps[key][name]["steps"] for key in maps]
            marker = "|" if name == "true pairs" else "o"
            size = 11.0 if name == "true pairs" else 5.0
            style = {"color": COLOURS[name], "markersize": size, "markeredgewidth": 2.0 if marker == "|" else 0.5}
            shown = [np.nan if value is None else value for value in error]
            left.plot(shown, at, marker, label=NAMES[name], **style)
            right.plot(share, at, marker, **style)
        left.set_yticks(rows, [f"{key}" for key in maps])
        left.set(xscale="log", xlim=(0.08, 150.0), title=f"noise and detection: {level}")
        right.set_xlim(-0.03, 1.03)
    axes[-1, 0].set_xlabel("metres between true pairs after alignment, mean")
    axes[-1, 1].set_xlabel("steps aligned within a metre")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(methods))
    return figure


def merged_map(figures: dict[str, Any]) -> Figure:
    """The merged landmarks of one track, by method."""
    picture = figures["picture"]
    methods = [name for name in ("true pairs", "robust", "glarot-local", "li", "paper") if name in picture]
    reference = np.array(picture["true pairs"])
    low, high = reference.min(axis=0) - 20.0, reference.max(axis=0) + 20.0
    width, height = high - low
    figure = Figure(figsize=(9.6, 0.35 + 9.6 / len(methods) * height / width), layout="constrained")
    axes = figure.subplots(1, len(methods), squeeze=False)[0]
    for ax, name in zip(axes, methods, strict=True):
        landmarks = np.array(picture[name])
        ax.plot(*landmarks.T, ".", markersize=1.6, color=COLOURS[name], rasterized=True)
        ax.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]), title=f"{NAMES[name]}: {len(landmarks)}")
        ax.set(xticks=[], yticks=[])
        ax.grid(visible=False)
        for spine in ax.spines.values():
            spine.set(visible=True, color="#cccccc")
    return figure


def efficiency(figures: dict[str, Any]) -> Figure:
    """Milliseconds against landmarks, both logarithmic."""
    growth = figures["growth"]
    figure = Figure(figsize=(9.0, 3.7), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True)
    for ax, part in zip(axes, ("describe", "match"), strict=True):
        for name, times in growth["methods"].items():
            exponent = figures["slopes"][name][part]
            label = f"{NAMES[name]}, n^{exponent:.2f}"
            ax.plot(growth["landmarks"], times[part], marker="o", color=COLOURS[name], label=label)
        ax.set(xscale="log", yscale="log", xlabel="landmarks of an observation", title=f"{part}, milliseconds")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
        ax.legend()
    return figure


def best_gate(methods: dict[str, Any]) -> str:
    """The GLAROT variant whose gate on the whole observation serves best, scored as in the letter."""
    gated = [name for name in methods if name.startswith("glarot@")]
    return max(gated, key=lambda name: float(f1(methods[name]["letter"]["counts"]).mean(axis=1).max()))


def verified(row: dict[str, Any], figures: dict[str, Any]) -> float:
    """A row's mean F1 over verified pairs, at the default's least number of correspondences."""
    minimum = figures["minima"]["verified"].index(figures["default"]["correspondences"])
    return float(row["verified"][minimum])


def best_rows(figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Each variation at the tau where the mean of verified pairs and collection is best, in the order tried."""
    best: dict[str, dict[str, Any]] = {}
    for row in figures["rows"]:
        known = best.get(row["label"])
        if known is None or serves(row, figures) > serves(known, figures):
            best[row["label"]] = row
    return list(best.values())


def serves(row: dict[str, Any], figures: dict[str, Any]) -> float:
    """What a default is chosen by: the mean of verified pairs and collection."""
    return 0.5 * (verified(row, figures) + float(row["collection"]))


PICTURES: Final[dict[str, Callable[[dict[str, Any]], Figure]]] = {
    "table1": loop_closure,
    "recall_by_distance": recall_by_distance,
    "pr_curves": pr_curves,
    "ablation": ablation,
    "table2": merging,
    "merged_map": merged_map,
    "table3": efficiency,
}
SOURCES: Final = {"recall_by_distance": "table1", "merged_map": "table2"}
"""Which figures a picture is drawn from, where the names differ."""
