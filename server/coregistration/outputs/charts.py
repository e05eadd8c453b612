"""The drawings of the report: an overview map and histograms, as SVG that takes its colours from the page."""

import math
from collections.abc import Sequence
from html import escape
from typing import Final

import numpy as np

from server.coregistration.results import PlotResult

_WIDTH: Final = 940.0
_TALLEST: Final = 700.0
_MARGIN: Final = 46.0
_MOST_DOTS: Final = 15_000
"""Trees in the overview: more make a slow page, and a black area."""
_BINS: Final = 16


def draw_overview(results: Sequence[PlotResult]) -> str:
    """All plots of one map: placed ones with their trees and shifts, others where their own coordinates say.

    Returns an empty string if no plot is placed.
    """
    placed = [one for one in results if one.pose is not None]
    if not placed:
        return ""
    centres = np.array([(one.pose.e, one.pose.n) for one in placed if one.pose is not None])
    radius = max(one.radius for one in results)
    low, high = centres.min(axis=0) - 2.0 * radius, centres.max(axis=0) + 2.0 * radius
    reach = 0.5 * float((high - low).max())
    others = [
        one
        for one in results
        if one.pose is None and one.centre is not None and not one.is_local
        and bool(((np.array(one.centre) > low - reach) & (np.array(one.centre) < high + reach)).all())
    ]  # fmt: skip
    for one in others:
        low, high = np.minimum(low, np.array(one.centre) - radius), np.maximum(high, np.array(one.centre) + radius)
    view = _View(low, high)
    for one in placed:
        view.trees(one)
    every = math.ceil(sum(len(one.trees) for one in placed) / _MOST_DOTS)
    parts = [*view.dots(every)]
    for one in (*placed, *others):
        parts += view.plot(one, named=len(placed) + len(others) <= 150)
    parts += view.frame()
    size = f'viewBox="0 0 {view.width:.0f} {view.height:.0f}"'
    return f'<svg class="map" {size} role="img" aria-label="Map of the plots">{"".join(parts)}</svg>'


class _View:
    """Metres to pixels, north up."""

    def __init__(self, low: np.ndarray, high: np.ndarray) -> None:
        wide, tall = (high - low).tolist()
        self._scale = min((_WIDTH - 2 * _MARGIN) / wide, (_TALLEST - 2 * _MARGIN) / tall)
        self._low, self._high = low, high
        self.width, self.height = _WIDTH, tall * self._scale + 2 * _MARGIN
        self._left = (_WIDTH - wide * self._scale) / 2
        self._dots: list[tuple[float, float]] = []

    def at(self, e: float, n: float) -> tuple[float, float]:
        return self._left + (e - self._low[0]) * self._scale, _MARGIN + (self._high[1] - n) * self._scale

    def trees(self, result: PlotResult) -> None:
        self._dots += [self.at(tree.e, tree.n) for tree in result.trees if tree.e is not None and tree.n is not None]

    def dots(self, every: int) -> list[str]:
        """The trees, one of `every` so many."""
        marks = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in self._dots[:: max(every, 1)])
        return [f'<path class="dots" d="{marks}"/>'] if marks else []

    def plot(self, result: PlotResult, *, named: bool) -> list[str]:
        """A plot: its circle, the way from where its own coordinates put it, and its name."""
        pose, parts = result.pose, list[str]()
        e, n = (pose.e, pose.n) if pose is not None else result.centre or (0.0, 0.0)
        x, y = self.at(e, n)
        r = max(result.radius * self._scale, 4.0)
        if pose is not None and pose.shift_e is not None and pose.shift_n is not None and not result.is_local:
            x0, y0 = self.at(e - pose.shift_e, n - pose.shift_n)
            inside = 0 <= x0 <= self.width and 0 <= y0 <= self.height
            if inside and math.hypot(x - x0, y - y0) > 3.0:
                parts.append(f'<path class="way" d="M{x0:.1f} {y0:.1f}L{x:.1f} {y:.1f}"/>')
        told = escape(f"{result.name}: {result.outcome}. {result.sentence}")
        parts.append(
            f'<a href="#{anchor(result)}"><circle class="{result.outcome}" cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}">'
            f"<title>{told}</title></circle></a>"
        )
        if named:
            parts.append(f'<text class="name" x="{x + r + 3:.1f}" y="{y + 4:.1f}">{escape(result.name)}</text>')
        return parts

    def frame(self) -> list[str]:
        """North, a scale bar, and the corner's coordinates."""
        metres = 10.0 ** math.floor(math.log10(float((self._high - self._low).max()) / 3.0))
        x, y = _MARGIN / 2, self.height - 14.0
        length = metres * self._scale
        return [
            f'<path class="bar" d="M{x:.1f} {y:.1f}h{length:.1f}"/>',
            f'<text class="small" x="{x + length + 6:.1f}" y="{y + 4:.1f}">{metres:g} m</text>',
            f'<path class="arrow" d="M{self.width - 20:.1f} 14l6 18l-6 -5l-6 5z"/>',
            f'<text class="small" x="{self.width - 24:.1f}" y="46">N</text>',
        ]


def anchor(result: PlotResult) -> str:
    """The place of a plot in the report."""
    return "plot-" + "".join(letter if letter.isalnum() else f"_{ord(letter):x}_" for letter in result.name)


def draw_histogram(title: str, unit: str, values: Sequence[float]) -> str:
    """A histogram with round bins, its median and its extremes; empty without values."""
    if not values:
        return ""
    data = np.array(values)
    low, high = float(data.min()), float(data.max())
    step = _round_step((high - low) / _BINS) if high > low else max(abs(high), 1.0) * 0.01
    first = math.floor(low / step) * step
    counts = np.bincount(np.floor((data - first) / step + 1e-9).astype(int))
    width, tall, base = 300.0, 110.0, 128.0
    each = (width - 20.0) / len(counts)
    bars = "".join(
        f'<rect class="bar-of" x="{10 + at * each:.1f}" y="{base - tall * count / counts.max():.1f}" '
        f'width="{max(each - 1.5, 1.0):.1f}" height="{tall * count / counts.max():.1f}">'
        f"<title>{first + at * step:.4g} to {first + (at + 1) * step:.4g} {unit}: {count} plots</title></rect>"
        for at, count in enumerate(counts.tolist())
        if count
    )
    last = first + len(counts) * step
    return (
        f"<figure><figcaption>{escape(title)}: median {np.median(data):.3g} {unit}, {low:.3g} to {high:.3g}"
        "</figcaption>"
        f'<svg viewBox="0 0 {width:.0f} 150" role="img" aria-label="{escape(title)}">{bars}'
        f'<path class="bar" d="M10 {base}h{width - 20:.0f}"/><text class="small" x="10" y="144">{first:.4g}</text>'
        f'<text class="small" x="{width - 10:.0f}" y="144" text-anchor="end">{last:.4g} {unit}</text></svg></figure>'
    )


def _round_step(rough: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough)
