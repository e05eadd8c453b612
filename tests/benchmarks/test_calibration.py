"""The fitted lines of the confidence: where they come from, and that nothing they depend on has changed since."""

import json
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.robust import calibrate
from benchmarks.robust.known_places import ANSWER
from urquhart import SE2, Config
from urquhart.decide.confidence import CALIBRATION, Calibration, Line, chance_logit, combine, rival_logit
from urquhart.verify.evidence import EVIDENCE, PoseEvidence


def answers(count: int, seed: int) -> NDArray[Any]:
    """Answers of all kinds: with and without rivals, below and above every floor."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(count, ANSWER)
    rows["inliers"], rows["overlap"] = 20, rng.integers(10, 60, count)
    rows["evidence"], rows["log_odds"] = rng.uniform(5.0, 90.0, count), rng.uniform(-9.0, 30.0, count)
    rows["lead"] = np.where(rng.random(count) < 0.5, rng.uniform(-30.0, 80.0, count), np.nan)
    return rows


def test_nothing_that_the_fit_depends_on_has_changed_since() -> None:
    changed = calibrate.stale()
    assert not changed, (
        f"urquhart/calibration.json was fitted before {', '.join(changed)} changed: run `{calibrate.COMMAND} --record` "
        "and compare the lines in use with the new fit, or `--adopt` to use it"
    )


def test_a_changed_number_makes_the_fit_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urquhart.verify.evidence.EVIDENCE", EVIDENCE._replace(detection=(0.5, 0.7)))
    assert calibrate.stale() == ["urquhart.verify.evidence.EvidenceNumbers"]


def test_a_changed_parameter_makes_the_fit_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibrate, "Config", lambda: Config(lead_per_landmark=0.3))
    assert "config" in calibrate.stale()


def test_the_file_says_where_its_lines_come_from() -> None:
    held = calibrate.read()
    assert Calibration(*(Line(**held["in_use"][name]) for name in Calibration._fields)) == CALIBRATION
    assert held["fit"]["command"].startswith(calibrate.COMMAND)
    assert held["fit"]["seed"] == calibrate.SEED
    assert date.fromisoformat(held["fit"]["date"])
    assert not (held["fit"]["commit"] or "").endswith("-dirty")
    assert held["fit"]["result"]["wrong"] == held["fit"]["result_of_those_before"]["wrong"] == 0
    fitted = {name: held["fit"][name] for name in Calibration._fields}
    assert held["in_use"] == fitted or held["note"]


def test_the_command_that_is_kept_is_the_one_that_was_run() -> None:
    adopted = calibrate.command_of(calibrate.SEED, quick=False, record=False, adopt=True)
    assert adopted == "python -m benchmarks.robust.calibrate --adopt"
    recorded = calibrate.command_of(7, quick=True, record=True, adopt=False)
    assert recorded == "python -m benchmarks.robust.calibrate --seed 7 --record --quick"


def test_the_benchmark_converts_as_the_method_does() -> None:
    rows = answers(500, 0)
    expected = []
    for row in rows:
        indices = np.arange(20)
        verified = PoseEvidence(
            SE2.identity(), float(row["evidence"]), 0.0, indices, indices, np.zeros(20), int(row["overlap"]), 5, 0.1
        )
        lead = float(row["lead"]) if np.isfinite(row["lead"]) else None
        rival = rival_logit(verified, lead, Config().lead_per_landmark)
        expected.append(combine(chance_logit(float(row["log_odds"])), rival))
    np.testing.assert_allclose(calibrate.logits(rows, CALIBRATION), expected, rtol=1e-6, atol=1e-6)


def test_a_fit_finds_the_lines_that_answers_were_drawn_from() -> None:
    true = Calibration(Line(0.5, 4.0), Line(0.2, 6.0))
    rows = answers(60_000, 1)
    logit = calibrate.logits(rows, true)
    rows["right"] = np.random.default_rng(2).random(len(rows)) < 1.0 / (1.0 + np.exp(-logit))
    for found, line in zip(calibrate.fit(rows), true, strict=True):
        assert found.slope == pytest.approx(line.slope, rel=0.1)
        assert found.even == pytest.approx(line.even, abs=0.6)
    passed = calibrate.accepted(rows, true)
    assert passed["accepted"] == int((logit >= Config().gate).sum())
    assert passed["wrong"] <= 0.001 * passed["accepted"] + 5


def test_a_fit_is_recorded_beside_the_lines_in_use_or_takes_their_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = calibrate.read()
    monkeypatch.setattr(calibrate, "FILE", tmp_path / "calibration.json")
    calibrate.FILE.write_text(json.dumps(before | {"note": "kept", "depends_on": {}}))
    assert calibrate.stale()
    fitted = Calibration(Line(0.5, 4.0), Line(0.2, 6.0))
    calibrate.write(fitted, answers(100, 3), "a command", 7, adopt=False)
    recorded = calibrate.read()
    assert (recorded["in_use"], recorded["note"]) == (before["in_use"], "kept")
    assert (recorded["fit"]["seed"], recorded["fit"]["answers"]) == (7, 100)
    assert calibrate.stale() == []
    calibrate.write(fitted, answers(100, 3), "a command", 7, adopt=True)
    adopted = calibrate.read()
    assert adopted["in_use"] == {"chance": {"slope": 0.5, "even": 4.0}, "rival": {"slope": 0.2, "even": 6.0}}
    assert "note" not in adopted
