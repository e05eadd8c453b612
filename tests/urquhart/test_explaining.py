import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import SE2, Budget, Stage
from urquhart.budget import DeadlinePassed
from urquhart.decide.verdict import Reason
from urquhart.report.explanation import (
    REASONS,
    UNREFUSED,
    WIDTH,
    ExplainedFinding,
    Explanation,
    PoseDrawing,
    counted,
    draw_explanation,
    sentence,
)
from urquhart.report.match import partners

SVG = "{http://www.w3.org/2000/svg}"
XY = forests.uniform(np.random.default_rng(0), 40)
STAGES = (
    Stage("describe", 0.8, {"landmarks": 40, "hull_polygons": 3, "dangling_edges": 0}),
    Stage("find rivals", 0.0, {}),
)


def found(level: str, log_odds: float, refused: str | None = None, submap: str = "p7") -> ExplainedFinding:
    return ExplainedFinding(level, submap, 12, 30, 36, log_odds + 9.0, log_odds, refused)


def explanation(
    findings: list[ExplainedFinding] | None = None,
    laid: tuple[PoseDrawing, ...] = (),
    total: int = 0,
    missing: bool = False,
) -> Explanation:
    return Explanation(
        "query 1: ambiguous",
        ("a <b> & c",),
        "rival_too_close",
        6.9,
        STAGES,
        findings,
        total,
        XY,
        laid,
        missing,
    )


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in ET.fromstring(svg).iter(SVG + "text")]


def bars(svg: str, style: str) -> list[ET.Element]:
    return [element for element in ET.fromstring(svg).iter(SVG + "rect") if element.get("class") == style]


def test_every_reason_has_a_sentence_and_no_other_does() -> None:
    of_plots = {"angle_unit"}  # what a reader of files may find wrong with a plot
    assert set(get_args(Reason)) | of_plots == set(REASONS)
    assert len({*REASONS.values(), UNREFUSED}) == len(REASONS) + 1


def test_sentences_fit_their_column_and_unknown_reasons_stay() -> None:
    assert all(len(words) <= 48 for words in (*REASONS.values(), UNREFUSED))
    assert sentence("below_gate") == REASONS["below_gate"]
    assert sentence(None) == UNREFUSED
    assert sentence("of_another_version") == "of_another_version"


def test_the_picture_tells_verdict_stages_and_findings() -> None:
    svg = draw_explanation(
        explanation([found("polygons", 20.0), found("quads", -3.0, "verification_failed")], total=70)
    )
    said = texts(svg)
    for words in (
        "query 1: ambiguous",
        REASONS["rival_too_close"].capitalize() + ".",
        "a <b> & c",
        "0.80 ms",
        "landmarks\xa040, hull\xa0polygons\xa03",
        "gate 6.9",
        "polygons: 1 submap",
        "20.0",
        "30 of 36 trees, 0.8 each",
        UNREFUSED,
        REASONS["verification_failed"],
        "These are the strongest 2 of 70.",
    ):
        assert words in said
    assert counted(STAGES[0]) == "landmarks 40, hull polygons 3"
    assert len(bars(svg, "stage")) == 2
    right, wrong = bars(svg, "finding")
    assert right.get("fill") != wrong.get("fill")
    gate = next(line for line in ET.fromstring(svg).iter(SVG + "line") if line.get("class") == "gate")
    zero = float(right.get("x", ""))
    assert zero < float(gate.get("x1", "")) < zero + float(right.get("width", ""))
    assert float(wrong.get("x", "")) + float(wrong.get("width", "")) == pytest.approx(zero, abs=0.2)


def test_far_below_zero_a_bar_is_cut_and_the_weaker_ones_are_counted() -> None:
    rows = [found("exhaustive", value, "below_gate", "a" * 100) for value in (5.0, *range(-30, -300, -10))]
    svg = draw_explanation(explanation(rows))
    assert len(bars(svg, "finding")) == 8
    assert svg.count('class="cut"') == 7
    assert "20 weaker" in texts(svg)
    assert max(len(words) for words in texts(svg) if words.startswith("aaa")) == 18
    assert all(0.0 <= float(bar.get("x", "")) <= WIDTH for bar in bars(svg, "finding"))


def test_the_query_is_laid_over_candidate_and_rival() -> None:
    best = PoseDrawing("best: p7", "evidence 50", XY, SE2.identity())
    rival = PoseDrawing("rival: p7", "evidence 48", XY, SE2(3.0, 0.0, 1.0))
    alone = ET.fromstring(draw_explanation(explanation([], (best,))))
    both = ET.fromstring(draw_explanation(explanation([], (best, rival))))
    assert [float(view.get("width", "")) for view in alone.iter(SVG + "svg")] == [WIDTH, 640.0]
    places = [(float(view.get("x", "0")), float(view.get("width", ""))) for view in both.iter(SVG + "svg")]
    assert places == [(0.0, WIDTH), (0.0, WIDTH / 2.0), (WIDTH / 2.0, WIDTH / 2.0)]
    pairs = [
        sum(1 for line in view.iter(SVG + "line") if line.get("class") == "pair") for view in both.iter(SVG + "svg")
    ]
    assert pairs[1] == len(XY) > 3 * pairs[2]


def test_what_is_not_there_is_said() -> None:
    assert "Nothing." in texts(draw_explanation(explanation([])))
    assert "There was nothing to look up." in texts(draw_explanation(replace(explanation([]), stages=())))
    kept = texts(draw_explanation(explanation(None, missing=True)))
    assert "What the levels found was not kept with this answer." in kept
    assert "The candidate's landmarks are no longer those that were searched." in kept


def test_partners_are_each_others_nearest_and_near() -> None:
    query = np.array([[0.0, 0.0], [0.3, 0.0], [10.0, 0.0], [20.0, 0.0]])
    submap = np.array([[20.0, 0.7], [0.1, 0.0], [10.0, 0.8]])
    first, second = partners(query, submap)
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(0, 1), (3, 0)]
    assert not re.search(r"\bnan\b", draw_explanation(explanation([found("given", 0.0)])))


def test_the_picture_ends_with_its_budget() -> None:
    laid = PoseDrawing("best: p7", "", XY, SE2(0.0, 0.0, 0.0))
    with pytest.raises(DeadlinePassed):
        draw_explanation(explanation([], (laid,)), Budget(0.0))


def test_partners_in_the_middle_of_a_ring_are_not_compared_with_all_of_it() -> None:
    """All landmarks of the ring are equally far from a landmark in its middle, so the work is cut into portions."""
    turn = np.linspace(0.0, 2.0 * np.pi, 3_000, endpoint=False)
    ring = 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    middle = np.random.default_rng(0).normal(0.0, 1e-3, (3_000, 2))
    with pytest.raises(DeadlinePassed):
        partners(middle, ring, Budget(0.0))
    first, second = partners(middle, ring)
    assert 0 < len(first) == len(second) < 3_000
