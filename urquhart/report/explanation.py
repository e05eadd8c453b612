"""The explanation of an answer: each reason in words, and one picture of the whole search.

The picture shows, from the top: the verdict; milliseconds and counts of the stages; the log-odds of the findings of
each level in each submap, against the gate; and the query over the best candidate and over its strongest rival.
"""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from urquhart.budget import UNBOUNDED, Budget
from urquhart.report.match import LEGEND, PARTNERS, overlay, partners
from urquhart.report.svg import Canvas, left_out, render
from urquhart.se2 import SE2
from urquhart.trace import SearchEnd, Skipped, Stage, StoppedBy

REASONS: Final[Mapping[str, str]] = {
    "verified": "chance and every rival pose are ruled out",
    "below_gate": "too little to rule out chance or trees in rows",
    "rival_too_close": "another pose cannot be ruled out",
    "outside_prior": "the place seems to lie outside of the prior",
    "contradicting_maps": "submaps that fit have contradicting map poses",
    "verification_failed": "more trees speak against the pose than for it",
    "no_proposal": "no submap has anything like these trees",
    "empty_collection": "there is no submap to look in",
    "all_filtered_out": "all submaps are excluded, or none is near",
    "too_few_landmarks": "fewer than three trees fix no pose",
    "collinear_landmarks": "trees on one line fix no pose",
    "deadline": "the time ran out before the search was complete",
    "angle_unit": "the azimuths fit in gon, not in degrees",
}
"""A sentence for each reason of a verdict or a refusal."""
STOPS: Final[Mapping[StoppedBy, str]] = {
    "decided": "the first candidate is so sure that searching on could not change the answer",
    "beats_chance": "chance is ruled out for the first candidate; searching on would only add weaker poses",
    "evidence_bound": "a stored place would have shown more evidence by now, if the query is as good as promised",
    "effort": "the effort fast ends here, which says nothing about so few trees; search with the effort full",
    "exhausted": "everything that this method can try was tried",
    "window": "every pose of the prior's window was tried, and none outside of it",
    "deadline": "the time ran out before all was searched; with a prior, give a heading or a smaller sigma",
    "not_started": "there was nothing to search for, or nothing to search in",
}
"""A sentence for each value of `SearchEnd.stopped_by`."""
SKIPS: Final[Mapping[Skipped, str]] = {
    "quad_hits": "the limit on quad hits was reached before all quads of the query were looked for",
    "common_quads": "quads of the query that are too common in the collection were passed over",
    "exhaustive": "the collection is too large to try every rotation and shift in it",
    "exhaustive_rest": "only the most similar submaps and headings were searched shift by shift, and the others not",
}
"""A sentence for each value of `SearchEnd.skipped`."""
UNREFUSED: Final = "enough evidence; only a rival could refuse it"
"""The sentence for a finding that is not refused."""
WIDTH: Final = 1000.0
"""Pixels: width of the picture."""
_LEFT, _BARS, _NUMBERS, _MIDDLE, _WORDS, _RIGHT = 40.0, 204.0, 425.0, 440.0, 615.0, 960.0
_BAR: Final = 160.0
_ALONE: Final = 640.0
"""Pixels: side of the view if there is only one."""
_ROW: Final = 20.0
_SHOWN: Final = 8
"""Most findings that are drawn of each level: the best ones."""
_NAME: Final = 18
"""Characters of a name that fit into the left column."""
_COUNTS: Final = 70
_COLOURS: Final = {"polygons": "#2f6b4f", "quads": "#3f6fb0", "exhaustive": "#8a5aa8", "paper": "#8b6b3d"}
_OTHER: Final = "#5b6b62"
_STYLE: Final = """
.section{font-size:15px;font-weight:600}.rule{stroke:#d5ded8;stroke-width:1}
.axis{stroke:#5b6b62;stroke-width:1}.gate{stroke:#b8321f;stroke-width:1.5;stroke-dasharray:4 3}
.gatename{font-size:12px;fill:#b8321f}.right{text-anchor:end}.cut{fill:#5b6b62}.level{font-size:12px;font-weight:600}
"""


@dataclass(frozen=True, slots=True)
class ExplainedFinding:
    """A finding for people: the fields of `Finding`, with the name of the submap instead of its key."""

    level: str
    submap: str
    support: int
    inliers: int
    overlap_count: int
    evidence: float
    log_odds: float
    refused: str | None


@dataclass(frozen=True, slots=True, eq=False)
class PoseDrawing:
    """A view of the query over one submap.

    Attributes:
        title, subtitle: text above the drawing.
        submap_xy: (M, 2) float64, metres, the submap's landmarks as posted.
        transform: `submap_T_query`.
    """

    title: str
    subtitle: str
    submap_xy: NDArray[np.float64]
    transform: SE2


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """An answer and the search that led to it, as they are drawn.

    Attributes:
        title, subtitles: text at the top.
        reason: of the verdict.
        gate: least log-odds that a pose without rivals needs; see `urquhart.decide.confidence.Gates`.
        stages: of the search, in order.
        findings: by level, the best first; None if they were not kept.
        findings_total: number of all findings, of which `findings` may be only the strongest.
        query_xy: (N, 2) float64, metres, as posted.
        drawings: the poses to show side by side: the best candidate's, and its strongest rival's if there is one.
        missing: whether there are candidates whose landmarks are no longer stored.
    """

    title: str
    subtitles: Sequence[str]
    reason: str
    gate: float
    stages: Sequence[Stage]
    findings: Sequence[ExplainedFinding] | None
    findings_total: int
    query_xy: NDArray[np.float64]
    drawings: Sequence[PoseDrawing]
    missing: bool = False


def sentence(reason: str | None) -> str:
    """The sentence for a reason; None is a finding that is not refused. An unknown word is returned unchanged."""
    return UNREFUSED if reason is None else REASONS.get(reason, reason)


def search_sentence(end: SearchEnd) -> str:
    """A sentence on why a search ended, and what its limits left out."""
    return "; ".join([STOPS[end.stopped_by], *(SKIPS[limit] for limit in end.skipped)])


def counted(stage: Stage) -> str:
    """The counts of a stage as text, without zeros."""
    return ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in stage.counts.items() if count)


def draw_explanation(explanation: Explanation, budget: Budget = UNBOUNDED) -> str:
    """Draw an explanation as SVG, `WIDTH` pixels wide.

    Raises:
        DeadlinePassed: the deadline passed first.
        Abandoned: nobody waits for the picture any more.
    """
    page = _Page()
    page.text(_LEFT, explanation.title, "head", 34.0)
    page.text(_LEFT, sentence(explanation.reason).capitalize() + ".", "", 24.0)
    for subtitle in explanation.subtitles:
        page.text(_LEFT, subtitle, "small", _ROW)
    _draw_stages(page, explanation.stages)
    _draw_findings(page, explanation)
    _draw_laid(page, explanation, budget)
    return render(page.parts, WIDTH, page.y + 16.0, _STYLE)


class _Page:
    """SVG elements, from the top down; `y`, in pixels, is where the last ones end."""

    def __init__(self) -> None:
        self.parts: list[str] = []
        self.y = 0.0

    def text(self, x: float, text: str, style: str, down: float = 0.0, *, tip: str = "", paint: str = "") -> None:
        self.y += down
        painted = f' style="fill:{paint}"' if paint else ""
        title = f"<title>{escape(tip)}</title>" if tip else ""
        self.parts.append(f'<text x="{x:.1f}" y="{self.y:.1f}" class="{style}"{painted}>{escape(text)}{title}</text>')

    def section(self, name: str) -> None:
        self.y += 22.0
        self.line(_LEFT, self.y, _RIGHT, self.y, "rule")
        self.text(_LEFT, name, "section", 26.0)

    def line(self, x1: float, y1: float, x2: float, y2: float, style: str) -> None:
        self.parts.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" class="{style}"/>')

    def bar(self, start: float, end: float, style: str, tip: str, paint: str = "#9db8a9") -> None:
        self.parts.append(
            f'<rect x="{min(start, end):.1f}" y="{self.y - 10.0:.1f}" width="{max(abs(end - start), 1.0):.1f}" '
            f'height="12" class="{style}" fill="{paint}"><title>{escape(tip)}</title></rect>'
        )


def _draw_stages(page: _Page, stages: Sequence[Stage]) -> None:
    page.section("What each stage took and counted")
    if not stages:
        page.text(_LEFT, "There was nothing to look up.", "small", 24.0)
    longest = max((stage.milliseconds for stage in stages), default=0.0) or 1.0
    page.y += 6.0
    for stage in stages:
        page.text(_LEFT, _cut(stage.name), "small", _ROW, tip=stage.name)
        page.bar(_BARS, _BARS + _BAR * stage.milliseconds / longest, "stage", stage.name)
        page.text(_NUMBERS, f"{stage.milliseconds:.2f} ms", "small right")
        # A line is broken between counts only.
        whole = counted(stage).replace(" ", "\N{NO-BREAK SPACE}").replace(",\N{NO-BREAK SPACE}", ", ")
        for number, line in enumerate(textwrap.wrap(whole, _COUNTS)):
            page.text(_MIDDLE, line, "small", 16.0 if number else 0.0)


def _draw_findings(page: _Page, explanation: Explanation) -> None:
    page.section("What each level found, one pose a submap, before rivals were looked for")
    found = explanation.findings
    if not found:
        nothing = "Nothing." if found is not None else "What the levels found was not kept with this answer."
        page.text(_LEFT, nothing, "small", 24.0)
        return
    axis = _Axis(found, explanation.gate)
    page.text(_LEFT, "log-odds", "small", 28.0)
    page.text(axis.at(0.0) - 4.0, "0", "small right")
    page.text(axis.at(explanation.gate) - 3.0, f"gate {explanation.gate:.1f}", "gatename")
    top = page.y + 5.0
    for level, group in groupby(found, key=lambda one: one.level):
        rows = list(group)
        submaps = f"{len(rows)} submap{'s' if len(rows) > 1 else ''}"
        page.text(_LEFT, f"{level}: {submaps}", "level", _ROW + 2.0, paint=_COLOURS.get(level, _OTHER))
        for one in rows[:_SHOWN]:
            _draw_finding(page, one, axis)
        if len(rows) > _SHOWN:
            page.text(_LEFT, f"{len(rows) - _SHOWN} weaker", "small", _ROW)
    for value, style in ((0.0, "axis"), (explanation.gate, "gate")):
        page.line(axis.at(value), top, axis.at(value), page.y + 6.0, style)
    if explanation.findings_total > len(found):
        page.text(_LEFT, f"These are the strongest {len(found)} of {explanation.findings_total}.", "small", 26.0)


def _draw_finding(page: _Page, one: ExplainedFinding, axis: "_Axis") -> None:
    tip = f"{one.submap}: evidence {one.evidence:.1f}, support {one.support} by {one.level}"
    page.text(_LEFT, _cut(one.submap), "small", _ROW, tip=tip)
    page.bar(axis.at(0.0), axis.at(one.log_odds), "finding", tip, _COLOURS.get(one.level, _OTHER))
    if axis.is_cut(one.log_odds):
        page.parts.append(f'<path d="M{_BARS - 3.0:g} {page.y - 10.0:.1f}v12l-6 -6z" class="cut"/>')
    page.text(_NUMBERS, f"{one.log_odds:.1f}", "small right")
    each = one.evidence / max(one.overlap_count, 1)
    page.text(_MIDDLE, f"{one.inliers} of {one.overlap_count} trees, {each:.1f} each", "small")
    page.text(_WORDS, sentence(one.refused), "small")


def _draw_laid(page: _Page, explanation: Explanation, budget: Budget) -> None:
    if not (explanation.drawings or explanation.missing):
        return
    rival = ", and over its strongest rival" if len(explanation.drawings) > 1 else ""
    page.section(f"The query over the best candidate{rival}")
    if not explanation.drawings:
        page.text(_LEFT, "The candidate's landmarks are no longer those that were searched.", "small", 24.0)
        return
    legend = f"filled: query, ring: submap, joined: partners within {PARTNERS:g} m, {LEGEND}"
    page.text(_LEFT, legend, "small", 24.0)
    page.y += 8.0
    side = WIDTH / 2.0 if len(explanation.drawings) > 1 else _ALONE
    views = [_view(explanation.query_xy, laid, side, budget) for laid in explanation.drawings]
    for place, view in enumerate(views):
        page.parts.append(view.embed(place * side, page.y))
    page.y += max(view.height for view in views)


def _view(query_xy: NDArray[np.float64], laid: PoseDrawing, side: float, budget: Budget) -> Canvas:
    query, submap = laid.transform.apply(query_xy), laid.submap_xy
    notes = [laid.subtitle, *left_out(len(query), len(submap))]
    both = np.concatenate([submap, query])
    view = Canvas(both, _cut(laid.title, 40), "; ".join(notes), size=side, width=side)
    overlay(view, query, submap, *partners(query, submap, budget), budget)
    return view


class _Axis:
    """Converts log-odds to pixels. Zero and the gate are always in view; bars far below zero are cut off."""

    def __init__(self, found: Sequence[ExplainedFinding], gate: float) -> None:
        self._high = 1.1 * max(gate, *(one.log_odds for one in found), 1.0)
        self._low = max(min(0.0, *(one.log_odds for one in found)), -0.4 * self._high)

    def is_cut(self, value: float) -> bool:
        return value < self._low

    def at(self, value: float) -> float:
        share = (max(value, self._low) - self._low) / (self._high - self._low)
        return _BARS + _BAR * share


def _cut(name: str, length: int = _NAME) -> str:
    return name if len(name) <= length else name[: length - 1] + "\u2026"
