"""A small version of `make bench-levels`: it searches as the method does, and counts what a level adds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import record
from benchmarks.levels import cases
from benchmarks.levels.__main__ import main
from benchmarks.levels.asking import NAMES, ROW, SPARED, ask, search
from benchmarks.levels.report import NAME
from benchmarks.levels.summary import summarize
from benchmarks.markdown import FOLDER
from urquhart import Features
from urquhart.features.observation import describe_observation

ROOT = Path(__file__).parents[2]
SMALL = ("extended grid, one submap each", "plantations, 36 submaps")


@pytest.mark.parametrize("name", SMALL)
def test_it_searches_as_the_method_does(name: str) -> None:
    reached = set[str]()
    for question in cases.WORLDS[name].questions(7, 3, 2):
        recognizer = question.world.recognizer
        described = describe_observation(question.xy, recognizer.config)
        assert isinstance(described.result, Features)
        steps, whole = list(search(recognizer, described.result)), recognizer.recognize(described.result, limit=1)
        reached |= {step.level for step in steps}
        last = steps[-1].answer
        assert (last.verdict, last.reason, last.lead) == (whole.verdict, whole.reason, whole.lead)
        assert [c.confidence for c in last.candidates] == [c.confidence for c in whole.candidates]
        assert [c.transform for c in last.candidates] == [c.transform for c in whole.candidates]
    assert reached <= set(NAMES)
    assert reached


def test_a_question_is_asked_again_without_each_level_that_ran() -> None:
    job = cases.Job("plantations, 36 submaps", 2, 3, 3)
    rows = cases.run(job)
    assert len(rows) == 6
    assert rows["stored"].tolist() == [True] * 3 + [False] * 3
    assert (rows["milliseconds"][rows["ran"]] > 0.0).all()
    assert (rows["milliseconds"][~rows["ran"]] == 0.0).all()
    assert not rows["mistaken"].any()
    spared = np.array([name in SPARED for name in NAMES])
    same = ~rows["ran"] | ~spared
    last = np.broadcast_to(rows["right"][:, -1:], rows["right"].shape)
    assert (rows["right_without"][same] == last[same]).all()


def test_too_few_trees_are_no_question() -> None:
    question = next(cases.WORLDS["extended grid, one submap each"].questions(0, 3, 1))
    world = question.world
    assert ask(question) is not None
    assert ask(type(question)(world, question.xy[:2], 0, question.pose)) is None


SHOWN = ("the only submap", "rare quads", "polygons")


def row(stored: bool, ran: str, right: str, mistaken: str, without: str) -> NDArray[Any]:
    """A row of the levels `SHOWN`, each a letter: x for yes. No other level ran."""
    found = np.zeros((), ROW)
    found["stored"] = stored
    for field, letters in (("ran", ran), ("right", right), ("mistaken", mistaken), ("right_without", without)):
        at = [max(sum(NAMES.index(name) <= level for name in SHOWN) - 1, 0) for level in range(len(NAMES))]
        said = [letters[place] == "x" for place in at]
        found[field] = [yes and (field != "ran" or name in SHOWN) for yes, name in zip(said, NAMES, strict=True)]
    found["milliseconds"] = np.where(found["ran"], 2.0, 0.0)
    return found


def test_what_a_level_adds_and_costs_is_counted() -> None:
    rows = np.array(
        [
            row(True, "-x-", "-xx", "---", "xxx"),
            row(True, "-xx", "--x", "---", "xx-"),
            row(True, "-xx", "-x-", "---", "---"),
            row(False, "-xx", "---", "--x", "---"),
        ],
        ROW,
    )
    found = summarize(rows)
    assert (found["stored"], found["elsewhere"]) == (3, 1)
    assert (found["right"], found["wrong"], found["false"]) == (2, 0, 1)
    assert found["milliseconds"] == pytest.approx(10.0 / 3.0)
    assert set(found["levels"]) == set(SHOWN[1:])
    first, second = (found["levels"][name] for name in SHOWN[1:])
    assert (first["ran"], first["ran_elsewhere"], first["answered"]) == (3, 1, 1)
    assert (first["added"], first["removed"], first["mistaken"]) == (2, 0, 0)
    assert (second["answered"], second["added"], second["removed"], second["mistaken"]) == (1, 1, 1, 1)
    assert (second["milliseconds"], second["each"]) == (2.0, pytest.approx(4.0 / 3.0))
    assert SHOWN[1] not in SPARED
    assert first["missed_without"] is None
    assert (second["missed_without"], second["gained_without"]) == (1, 0)


def test_the_readme_has_the_figures_that_are_published() -> None:
    worlds = record.read(ROOT / "docs" / FOLDER / f"{NAME}.json")["worlds"]
    totals = {key: sum(world[key] for world in worlds.values()) for key in ("stored", "elsewhere", "wrong", "false")}
    told = (
        f"{len(worlds)} worlds, level by level: {totals['stored']:,} places that are stored, {totals['elsewhere']:,} "
        f"that are not | {totals['wrong']} wrong, {totals['false']} matched falsely"
    )
    assert told in (ROOT / "README.md").read_text(encoding="utf-8")


def test_a_quick_run_leaves_figures_and_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cases, "WORLDS", {name: cases.WORLDS[name] for name in SMALL[:1]})
    main(quick=True, out=tmp_path, seed=1, workers=1)
    figures = record.read(tmp_path / FOLDER / f"{NAME}.json")
    assert figures["command"] == "python -m benchmarks.levels --quick --seed 1"
    assert set(figures["worlds"]) == {SMALL[0]}
    assert "### Extended grid, one submap each" in (tmp_path / "results.md").read_text()
