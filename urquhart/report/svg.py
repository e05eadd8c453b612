"""Drawing in metres as SVG, and the picture of a tessellation. North (y) is up; a scale bar shows metres."""

import math
from collections.abc import Sequence
from html import escape
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import UNBOUNDED, Budget
from urquhart.features.describe import Features

_SIZE: Final = 900.0
_MARGIN: Final = 40.0
_HEAD: Final = 44.0
_LINE: Final = 20.0
_WIDTH: Final = 620.0
MOST: Final = 5_000
"""Most landmarks of each side in a picture: more of them make tens of megabytes, and a black area."""
STYLE: Final = """
text{font:14px
system-ui,sans-serif;fill:#24332b}.head{font-size:18px;font-weight:600}.small{font-size:12px;fill:#5b6b62}
.triangle{fill:none;stroke:#d5ded8;stroke-width:1}.polygon{stroke:#2f6b4f;stroke-width:1.6;fill-opacity:.55}
.tree{fill:#1d4a36}.submap{fill:none;stroke:#2f6b4f;stroke-width:1.8}.query{fill:#d9622b}
.pair{stroke:#24332b;stroke-width:2}.miss{stroke:#b8321f;stroke-width:1.8;fill:none}.outside{opacity:.4}
.bar{stroke:#24332b;stroke-width:2}
"""


class Canvas:
    """Converts metres to pixels, with y up, and collects SVG elements.

    Args:
        points: (N, 2), metres, the points that must be in view.
        title, subtitles: text at the top.
        size: pixels, the longer side of the view.
        width: pixels, least width, for the text.
    """

    def __init__(
        self, points: NDArray[np.float64], title: str, *subtitles: str, size: float = _SIZE, width: float = _WIDTH
    ) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        extent = max(float((high - low).max()), 1e-9)
        self._scale = (size - 2.0 * _MARGIN) / extent
        self._dot = math.sqrt(size / _SIZE)
        self._low, self._high = low, high
        self.width = float(high[0] - low[0]) * self._scale + 2.0 * _MARGIN
        self._head = _HEAD + _LINE * len(subtitles)
        self.height = float(high[1] - low[1]) * self._scale + 2.0 * _MARGIN + self._head
        self.width = max(self.width, width)
        self._parts = [
            f'<text x="{_MARGIN:g}" y="28" class="head">{escape(title)}</text>',
            *(
                f'<text x="{_MARGIN:g}" y="{50 + _LINE * line:g}" class="small">{escape(subtitle)}</text>'
                for line, subtitle in enumerate(subtitles)
            ),
        ]
        self._scale_bar(extent)

    def at(self, point: NDArray[np.float64]) -> tuple[float, float]:
        x = _MARGIN + (float(point[0]) - float(self._low[0])) * self._scale
        return x, self._head + _MARGIN + (float(self._high[1]) - float(point[1])) * self._scale

    def circle(self, point: NDArray[np.float64], radius: float, style: str, label: str) -> None:
        x, y = self.at(point)
        self._parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius * self._dot:.3g}" class="{style}">'
            f"<title>{escape(label)}</title></circle>"
        )

    def cross(self, point: NDArray[np.float64], arm: float, style: str) -> None:
        x, y = self.at(point)
        arm *= self._dot
        side = f"{2.0 * arm:.3g}"
        self._parts.append(
            f'<path d="M{x - arm:.1f} {y - arm:.1f}l{side} {side}m0 -{side}l-{side} {side}" class="{style}"/>'
        )

    def line(self, a: NDArray[np.float64], b: NDArray[np.float64], style: str) -> None:
        (x1, y1), (x2, y2) = self.at(a), self.at(b)
        self._parts.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" class="{style}"/>')

    def label(self, point: NDArray[np.float64], text: str, style: str, shift: tuple[float, float] = (0.0, 0.0)) -> None:
        """Text whose lower left corner is `shift` pixels, right and down, from a point."""
        x, y = self.at(point)
        self._parts.append(f'<text x="{x + shift[0]:.1f}" y="{y + shift[1]:.1f}" class="{style}">{escape(text)}</text>')

    def ring(self, middle: NDArray[np.float64], metres: float, style: str) -> None:
        """A circle whose radius is in metres."""
        x, y = self.at(middle)
        self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{metres * self._scale:.1f}" class="{style}"/>')

    def north(self) -> None:
        """An arrow to the north at the upper right corner of the view."""
        x, y = self.width - 0.6 * _MARGIN, self._head + 8.0
        self._parts.append(f'<path d="M{x:.1f} {y:.1f}l6 18l-6 -5l-6 5z" class="tree"/>')
        self._parts.append(f'<text x="{x - 5:.1f}" y="{y + 32:.1f}" class="small">N</text>')

    def outline(self, points: NDArray[np.float64], style: str, fill: str | None = None) -> None:
        path = " ".join("{:.1f},{:.1f}".format(*self.at(point)) for point in points)
        paint = f' fill="{fill}"' if fill else ""
        self._parts.append(f'<polygon points="{path}" class="{style}"{paint}/>')

    def embed(self, x: float, y: float) -> str:
        """The elements as part of another picture, with their upper left corner at (x, y), pixels."""
        body = "\n".join(self._parts)
        return f'<svg x="{x:g}" y="{y:g}" width="{self.width:.0f}" height="{self.height:.0f}">\n{body}\n</svg>'

    def open_group(self, style: str) -> None:
        """Start a group with the CSS class `style`; all elements until `close_group` belong to it."""
        self._parts.append(f'<g class="{style}">')

    def close_group(self) -> None:
        """Close the group that was opened last."""
        self._parts.append("</g>")

    def render(self, style: str = "") -> str:
        """The elements as a complete picture; `style` is additional CSS."""
        return render(self._parts, self.width, self.height, style)

    def _scale_bar(self, extent: float) -> None:
        metres = 10.0 ** math.floor(math.log10(extent / 4.0))
        metres *= next(step for step in (5.0, 2.0, 1.0) if step * metres <= extent / 4.0 or step == 1.0)
        length, y = metres * self._scale, self.height - 14.0
        self._parts.append(
            f'<line x1="{_MARGIN:g}" y1="{y:.1f}" x2="{_MARGIN + length:.1f}" y2="{y:.1f}" class="bar"/>'
        )
        self._parts.append(f'<text x="{_MARGIN + length + 8:.1f}" y="{y + 4:.1f}" class="small">{metres:g} m</text>')


def render(parts: Sequence[str], width: float, height: float, style: str = "") -> str:
    """A complete picture from SVG elements, with its own background, `width` by `height` pixels; `style`: more CSS."""
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}">\n<style>{STYLE}{style}</style>\n'
        f'<rect width="100%" height="100%" fill="#fbfcfa"/>\n{body}\n</svg>\n'
    )


def draw_tessellation(features: Features, *, title: str = "", budget: Budget = UNBOUNDED) -> str:
    """Draw one submap as SVG: Delaunay triangles, interior Urquhart polygons (coloured by vertex count), landmarks.

    Of more than `MOST` landmarks, those nearest to the middle are drawn, with the triangles and polygons among them.

    Raises:
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the picture any more.
    """
    counts, t, xy = features.counts(), features.tessellation, features.landmarks
    nearest = np.argsort(np.hypot(*(xy - xy.mean(axis=0)).T), kind="stable")[:MOST]
    shown = np.zeros(len(xy), np.bool_)
    shown[nearest] = True
    canvas = Canvas(
        xy[shown],
        title or "Tessellation",
        f"{counts['landmarks']} landmarks, {counts['triangles']} triangles, {counts['polygons']} interior polygons",
        *left_out(len(xy), where=" nearest to the middle"),
    )
    for triangle in budget.each(t.triangles[shown[t.triangles].all(axis=1)]):
        canvas.outline(xy[triangle], "triangle")
    for i in budget.each(range(len(t))):
        vertices = t.polygon(i)
        if shown[vertices].all():
            # The golden angle gives neighbouring vertex counts distant hues.
            hue = (95.0 + 137.5 * (len(vertices) - 3)) % 360.0
            canvas.outline(xy[vertices], "polygon", f"hsl({hue:.0f} 45% 72%)")
    for i in budget.each(np.flatnonzero(shown).tolist()):
        canvas.circle(xy[i], 3.5, "tree", f"landmark {i}")
    return canvas.render()


def left_out(*sides: int, where: str = "") -> list[str]:
    """A note on landmarks that a picture does not show, from the number of landmarks of each side; else no note."""
    shown = sum(min(count, MOST) for count in sides)
    return [f"{shown:,} of {sum(sides):,} trees drawn{where}"] if shown < sum(sides) else []
