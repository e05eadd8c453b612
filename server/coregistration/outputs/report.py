"""The report of a season: one HTML file that opens without a network, with all pictures in it."""

import base64
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Final

from server.coregistration.outputs.attention import Attention
from server.coregistration.outputs.charts import anchor, draw_histogram, draw_overview
from server.coregistration.results import Outcome, PlotResult
from server.platform.version import service_version

_SHOWN: Final = 12
"""Plots that need eyes which stand above the map; the others are folded away."""
_WORDS: Final[Mapping[Outcome, str]] = {
    "matched": "placed",
    "ambiguous": "ambiguous",
    "no_match": "not found",
    "not_read": "not read",
    "failed": "failed",
}
_MEANING: Final[Mapping[Outcome, str]] = {
    "matched": "found in the map; chance and every other place are ruled out",
    "ambiguous": "fits several places, so it is not placed",
    "no_match": "not found in the map",
    "not_read": "the file or its rows cannot be used",
    "failed": "read, but cannot be looked up",
}


@dataclass(frozen=True, slots=True)
class ReportHead:
    """What stands at the top of a report: the collection, when it was made, and what was read as what."""

    collection: str
    made: str
    told: Sequence[str]
    notes: Sequence[str]


def write_report(
    path: Path,
    head: ReportHead,
    results: Sequence[PlotResult],
    attention: Sequence[Attention],
    pictures: Mapping[str, str],
) -> None:
    """Write the report. `pictures`: SVG by the names of the plots. A reader never sees half of it."""
    beside = path.with_name(f"{path.name}.part")
    with beside.open("w", encoding="utf-8") as file:
        for part in _page(head, results, attention, pictures):
            file.write(part)
    beside.replace(path)


def _page(
    head: ReportHead,
    results: Sequence[PlotResult],
    attention: Sequence[Attention],
    pictures: Mapping[str, str],
) -> Sequence[str]:
    here = Path(__file__).parent
    style, script = (here / "report.css").read_text("utf-8"), (here / "report.js").read_text("utf-8")
    title = f"Coregistration in {head.collection}"
    notes = "".join(f"<p class=note>{escape(note)}</p>" for note in head.notes)
    return [
        f"<!doctype html><html lang=en><head><meta charset=utf-8><title>{escape(title)}</title>"
        f'<meta name=viewport content="width=device-width"><style>{style}</style></head><body>',
        f"<h1>{escape(title)}</h1><p class=lead>{len(results)} plots, {escape(head.made)}</p>",
        _cards(results),
        notes,
        _eyes(attention),
        *_maps(results),
        _histograms(results),
        _table(results),
        "<h2>Each plot</h2>",
        *(_picture(one, pictures.get(one.name)) for one in results if one.trees),
        _footer(head),
        f"<script>{script}</script></body></html>\n",
    ]


def _cards(results: Sequence[PlotResult]) -> str:
    counts = Counter(one.outcome for one in results)
    cards = "".join(
        f"<div class='card {word}'><b>{counts[word]}</b>{_WORDS[word]}<small>{_MEANING[word]}</small></div>"
        for word in _WORDS
        if counts[word]
    )
    return f"<div class=cards>{cards}</div>"


def _eyes(attention: Sequence[Attention]) -> str:
    if not attention:
        return "<h2>What needs eyes first</h2><p>Nothing: every plot is placed, and none stands out.</p>"
    rows = [
        f"<tr><td>{_badge(one.result)}<td>{_link(one.result)}<td>{'<br>'.join(map(escape, one.why))}"
        for one in attention
    ]
    more = ""
    if len(rows) > _SHOWN:
        rest = "".join(rows[_SHOWN:])
        more = f"<details><summary>{len(rows) - _SHOWN} more plots</summary><table class=eyes>{rest}</table></details>"
    return f"<h2>What needs eyes first</h2><table class=eyes>{''.join(rows[:_SHOWN])}</table>{more}"


def _link(result: PlotResult) -> str:
    name = escape(result.name)
    return f'<a href="#{anchor(result)}">{name}</a>' if result.trees else name


def _badge(result: PlotResult) -> str:
    return f"<span class='badge {result.outcome}'>{_WORDS[result.outcome]}</span>"


def _maps(results: Sequence[PlotResult]) -> list[str]:
    """An overview for each map that plots were found in; plots of none are in the one with most plots."""
    frames = Counter(one.pose.frame_id for one in results if one.pose is not None)
    parts = []
    for at, (frame_id, _) in enumerate(frames.most_common(8)):
        chosen = [one for one in results if (at == 0 if one.pose is None else one.pose.frame_id == frame_id)]
        crs = next((one.pose.crs for one in chosen if one.pose is not None), None)
        heading = f"Map {frame_id}" + (f", {crs}" if crs else "")
        parts.append(
            f"<h2>{escape(heading)}</h2>{draw_overview(chosen)}<p class=small>Circles are plots, dots their trees. "
            "A line leads from where a plot's own coordinates put it. Plots that are not placed stand where their own "
            "coordinates put them, if that is near. Click a plot for its picture.</p>"
        )
    return parts


def _histograms(results: Sequence[PlotResult]) -> str:
    placed = [one for one in results if one.pose is not None]
    shifts = [
        math.hypot(one.pose.shift_e, one.pose.shift_n)
        for one in placed
        if one.pose is not None and one.pose.shift_e is not None and one.pose.shift_n is not None and not one.is_local
    ]
    drawn = (
        draw_histogram("Shift of the centre", "m", shifts),
        draw_histogram("Turn, clockwise", "deg", [one.pose.turn_cw for one in placed if one.pose is not None]),
        draw_histogram("Typical distance of paired trees", "m", [one.rms for one in placed if one.rms is not None]),
        draw_histogram("Trees found in the map", "%", [100.0 * one.share for one in placed if one.share is not None]),
    )
    return f"<h2>Distributions</h2><div class=charts>{''.join(drawn)}</div>" if any(drawn) else ""


_COLUMNS: Final[Sequence[tuple[str, Callable[[PlotResult], float | int | None], str]]] = (
    ("E", lambda one: one.pose.in_system[0] if one.pose else None, ".2f"),
    ("N", lambda one: one.pose.in_system[1] if one.pose else None, ".2f"),
    ("dE m", lambda one: one.pose.shift_e if one.pose else None, "+.2f"),
    ("dN m", lambda one: one.pose.shift_n if one.pose else None, "+.2f"),
    ("turn deg", lambda one: one.pose.turn_cw if one.pose else None, "+.2f"),
    ("sigma E m", lambda one: one.pose.sigma_e if one.pose else None, ".3f"),
    ("sigma N m", lambda one: one.pose.sigma_n if one.pose else None, ".3f"),
    ("sigma turn deg", lambda one: one.pose.sigma_turn if one.pose else None, ".3f"),
    ("trees", lambda one: len(one.trees) or None, "d"),
    ("paired", lambda one: one.inliers if one.pose else None, "d"),
    ("share", lambda one: one.share, ".0%"),
    ("rms m", lambda one: one.rms, ".3f"),
    ("scale", lambda one: one.scale, ".4f"),
    ("confidence", lambda one: one.confidence, ".4f"),
    ("places", lambda one: len(one.places) or None, "d"),
)


def _table(results: Sequence[PlotResult]) -> str:
    names = "".join(f"<th class=n>{name}" for name, _, _ in _COLUMNS)
    rows = []
    for one in results:
        cells = [(value(one), form) for _, value, form in _COLUMNS]
        numbers = "".join(
            "<td class=n>" if v is None else f'<td class=n data-v="{v!r}">{v:{form}}' for v, form in cells
        )
        rows.append(f"<tr><td>{_link(one)}<td>{_badge(one)}{numbers}")
    return (
        "<h2>All plots</h2><p class=small>Click a heading to sort. E and N are the plot's centre in the map, in the "
        "unit of the map's system; dE, dN and turn (clockwise) lead there from the plot's own coordinates, about that "
        "centre.</p>"
        f"<div class=wide><table class=sortable><thead><tr><th>plot<th>verdict{names}</thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _picture(result: PlotResult, svg: str | None) -> str:
    image = ""
    if svg is not None:
        data = base64.b64encode(svg.encode()).decode()
        image = f'<img loading=lazy alt="Trees of {escape(result.name)}" src="data:image/svg+xml;base64,{data}">'
    return (
        f'<details id="{anchor(result)}"><summary>{_badge(result)} {escape(result.name)}: {escape(result.sentence)}'
        f"</summary><p class=small>{escape(result.file)}</p>{image}</details>"
    )


def _footer(head: ReportHead) -> str:
    told = "".join(f"<li>{escape(line)}" for line in head.told)
    return (
        "<h2>Beside this report</h2><ul><li><code>plots.csv</code>, <code>plots.gpkg</code>: the table above"
        "<li><code>trees.csv</code>, <code>trees.gpkg</code>: each tree with its corrected and its original position"
        "<li><code>pairs.csv</code>: each tree with its partner in the map, and trees that only one side has"
        "<li><code>transforms.json</code>, <code>transforms/</code>: 4x4 matrices, plot to map"
        "<li><code>pictures/</code>: the pictures above</ul>"
        f"<h2>How the files were read</h2><ul class=small>{told}</ul><footer>urquhart {service_version()}</footer>"
    )
