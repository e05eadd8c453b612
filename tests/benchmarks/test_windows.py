"""Searches within a prior: where their confidence comes from, and a few windows of the benchmark."""

from datetime import date
from pathlib import Path

import numpy as np
import pytest

from benchmarks import record
from benchmarks.markdown import FOLDER
from benchmarks.windows import calibrate, scenes
from benchmarks.windows.__main__ import NAME, figures_of, summarize
from benchmarks.windows.report import write_report
from benchmarks.windows.searching import FOUND, MATCHED
from urquhart.decide.confidence import Calibration, Line
from urquhart.prior.confidence import WINDOW_CALIBRATION
from urquhart.prior.region import REGION

RESULTS = Path(__file__).parents[2] / "docs" / FOLDER


def test_nothing_that_the_fit_depends_on_has_changed_since() -> None:
    changed = calibrate.stale()
    assert not changed, f"{', '.join(changed)} changed: run `{calibrate.COMMAND} --adopt`"


def test_a_changed_number_makes_the_fit_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urquhart.prior.region.REGION", REGION._replace(wide=3.0))
    assert "urquhart.prior.region.RegionNumbers" in calibrate.stale()


def test_the_file_says_where_its_lines_come_from() -> None:
    held = calibrate.read()
    assert Calibration(*(Line(**held["in_use"][name]) for name in Calibration._fields)) == WINDOW_CALIBRATION
    assert held["fit"]["command"].startswith(calibrate.COMMAND)
    assert date.fromisoformat(held["fit"]["date"])
    assert held["fit"]["result"]["wrong"] == 0
    assert held["fit"]["wrong_priors"] == calibrate.WRONG


def test_no_forest_is_both_fitted_and_held_out() -> None:
    assert not set(scenes.FITTED) & set(scenes.HELD_OUT)
    assert not scenes.PLANTED["fitted"].keys() & scenes.PLANTED["held out"].keys()


def test_a_fit_finds_the_lines_that_windows_were_drawn_from() -> None:
    rng, true = np.random.default_rng(1), Calibration(Line(0.9, -2.0), Line(0.5, 1.0))
    found = np.zeros(4_000, FOUND)
    found["near"], found["apart"] = rng.uniform(-8.0, 20.0, 4_000), rng.uniform(-8.0, 12.0, 4_000)
    found["repeated"], found["inside"] = rng.uniform(-8.0, 12.0, 4_000), rng.random(4_000) < 1.0 - calibrate.WRONG
    found["right"] = rng.random(4_000) < 1.0 / (1.0 + np.exp(-calibrate.logits(found, true)))
    for line, drawn in zip(calibrate.fit(found), true, strict=True):
        assert line.slope == pytest.approx(drawn.slope, rel=0.2)
        assert line.even == pytest.approx(drawn.even, abs=1.0)


def test_figures_count_what_was_found() -> None:
    rows = np.zeros(3, FOUND)
    rows["inside"], rows["right"], rows["verdict"] = [True, True, False], [True, False, False], MATCHED
    assert {name: summarize(rows)[name] for name in ("right", "wrong", "false")} == {"right": 1, "wrong": 1, "false": 1}
    assert figures_of([(("forests", 0.3, True), rows)])["parts"][0]["outside"] == 1


def test_a_plot_is_found_in_its_window_and_not_elsewhere() -> None:
    found = calibrate.run(calibrate.Job("lansing", 0.3, True, 5, (1, 2)))
    assert (found["right"] == found["inside"]).all()
    assert not (found["verdict"][~found["inside"]] == MATCHED).any()


def test_the_published_figures_have_no_wrong_match() -> None:
    figures = record.read(RESULTS / f"{NAME}.json")
    assert sum(part["outside"] for part in figures["parts"]) >= 1_000
    assert sum(part["wrong"] + part["false"] for part in figures["parts"]) == 0
    assert "searches within a prior" in write_report({NAME: figures})
