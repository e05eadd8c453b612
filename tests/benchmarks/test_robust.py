"""A small version of what `make bench-robust` measures: orderings that must hold, whatever the seed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import record
from benchmarks.markdown import FOLDER
from benchmarks.paper.drive import CELLS
from benchmarks.paper.tracks import BESIDE
from benchmarks.robust import edges, few_trees, grid, rows, stands, table1
from benchmarks.robust.__main__ import EXPERIMENTS, FULL, RELIABILITY, main
from benchmarks.robust.calibration_curve import LEAST, bins, expected_error
from benchmarks.robust.charts import PICTURES
from benchmarks.robust.known_places import ANSWER, MATCHED, STRICT, AskedPart, RobustWorld, TruePlace, gather, summarize
from benchmarks.robust.report import SECTIONS
from urquhart import SE2, Config
from urquhart.evaluation.simulation import Sensor, observe, paper_forest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / FULL / FOLDER
SEED = 21


def cell(sigma: float, detection: float, clutter: float) -> int:
    return grid.CELLS.index((sigma, detection, clutter))


def test_the_default_finds_what_its_peers_find_and_more() -> None:
    hard = CELLS.index((0.4, 0.8))
    result = table1.run_cell(table1.Job(4, SEED, hard, peers=True))
    ours = table1.outcome(result)
    assert ours.false_positives == 0
    assert ours.f1 >= 0.98
    for name in table1.PEERS:
        right, wrong, missed = result.counts[name].T
        assert ours.f1 >= (2.0 * right / (2.0 * right + wrong + missed)).max() - 0.01
        assert result.milliseconds[name] > 0.0
    paper = result.counts["paper"]
    assert (2.0 * paper[:, 0] / (2.0 * paper[:, 0] + paper[:, 1] + paper[:, 2])).max() < 0.8


@pytest.mark.parametrize(
    ("sigma", "detection", "clutter", "least"),
    [(0.0, 1.0, 0.0, 1.0), (0.2, 0.6, 0.0, 0.9), (0.4, 0.8, 0.0, 0.9), (0.0, 0.9, 1.0, 0.9), (0.2, 0.8, 0.3, 0.9)],
)
def test_far_beyond_the_papers_grid(sigma: float, detection: float, clutter: float, least: float) -> None:
    answers = grid.run_cell(AskedPart(cell(sigma, detection, clutter), SEED, 15, 40))
    found = summarize(answers)
    assert (found["false"], found["wrong"]) == (0, 0)
    assert found["right"] >= least * found["inside"]
    assert found["right"] >= 0.95 * found["oracle"] - 1


def test_more_noise_is_found_less_and_where_nothing_can_be_known_it_is_said() -> None:
    found = [summarize(grid.run_cell(AskedPart(cell(s, 0.7, 0.3), SEED, 10, 10))) for s in (0.2, 0.6, 1.0)]
    assert found[0]["right"] > found[1]["right"] >= found[2]["right"]
    assert all(row["false"] + row["wrong"] == 0 for row in found)


def test_a_dozen_trees_are_recognised_among_hundreds_of_submaps() -> None:
    cells = [few_trees.CELLS.index((trees, (0.2, 0.9))) for trees in (8, 10, 12)]
    found = [summarize(few_trees.run_cell(AskedPart(cell, SEED, 20, 20))) for cell in cells]
    assert all(row["false"] + row["wrong"] == 0 for row in found)
    assert [row["right"] >= least for row, least in zip(found, (6, 14, 17), strict=True)] == [True] * 3


@pytest.mark.parametrize("kind", [0, 5, 13])
def test_in_plantations_nothing_false_is_matched(kind: int) -> None:
    found = summarize(rows.run_kind(AskedPart(kind, SEED, 4, 12)))
    assert (found["false"], found["wrong"]) == (0, 0)
    assert found["right"] >= 0.7 * found["oracle"]
    assert found["alone"] >= found["oracle"]


@pytest.mark.parametrize("kind", range(0, len(edges.KINDS), 3))
def test_no_edge_of_a_plantation_is_taken_for_another(kind: int) -> None:
    stands = 1 if edges.KINDS[kind].scene == "inside" else 2
    found = summarize(edges.run_kind(edges.Job(kind, SEED, stands)))
    assert (found["false"], found["wrong"]) == (0, 0)
    assert found["right"] >= 0.5 * found["oracle"]
    if edges.KINDS[kind].jitter >= 0.2:
        assert found["right"] >= found["inside"] - 1


def test_real_stands_that_are_shipped_are_recognised() -> None:
    for name in ("lansing", "bei"):
        answers = stands.run_stand(stands.Job(name, SEED, 3))
        found = summarize(np.concatenate([answers["0.1 m, 95 %"], answers["0.2 m, 95 %"]]))
        assert found["wrong"] == 0
        assert found["right"] >= 5


@pytest.mark.skipif(not (BESIDE / "rioja").is_dir(), reason="the plots surveyed twice are not beside the checkout")
def test_plots_surveyed_twice_are_recognised_among_all_others() -> None:
    for with_diameters in (False, True):
        found = stands.run_plots(stands.Job("plots", SEED, 0), with_diameters=with_diameters)
        assert all(row["wrong"] == 0 for row in found.values())
        assert found["prf025"]["right"] == 1
        assert found["rioja"]["right"] == 8
        assert found["t3upland"]["right"] >= 17


def test_a_world_knows_right_from_wrong() -> None:
    rng = np.random.default_rng(3)
    forest = paper_forest(rng, 300.0)
    here, there = SE2(120.0, 140.0, 0.4), SE2(126.0, 133.0, -2.0)
    world = RobustWorld([TruePlace(observe(forest, here, Sensor(40.0, sigma=0.1), rng).xy, 0, here)], Config(), STRICT)
    seen = observe(forest, there, Sensor(40.0, sigma=0.1), rng).xy
    right = world.ask(seen, 0, there)
    assert [int(right[name]) for name in ("verdict", "right", "oracle", "alone")] == [MATCHED, 1, 1, 1]
    elsewhere = world.ask(seen, 0, SE2(150.0, 133.0, -2.0))
    assert [int(elsewhere[name]) for name in ("verdict", "right", "oracle")] == [MATCHED, 0, 0]
    unknown = world.ask(seen, None, there)
    assert [int(unknown[name]) for name in ("verdict", "right", "inside")] == [MATCHED, 0, 0]
    found = summarize(gather([right, elsewhere, unknown]))
    assert (found["right"], found["wrong"], found["false"]) == (1, 1, 1)


def answers(p: NDArray[np.float64], right: NDArray[np.bool_]) -> NDArray[Any]:
    rows = np.zeros(len(p), ANSWER)
    rows["confidence"], rows["right"], rows["inliers"] = p, right, 5
    return rows


def test_bins_hold_enough_and_tell_a_true_confidence_from_a_false_one() -> None:
    rng = np.random.default_rng(0)
    p = 1.0 / (1.0 + np.exp(-rng.normal(0.0, 4.0, 40_000)))
    honest = answers(p, rng.random(len(p)) < p)
    boasting = answers(np.minimum(1.0, p + 0.3), honest["right"])
    found = bins(honest, LEAST)
    assert sum(one["count"] for one in found) == len(p)
    assert all(one["count"] >= LEAST for one in found)
    assert len(found) > 10
    assert [one["confidence"] for one in found] == sorted(one["confidence"] for one in found)
    assert expected_error(honest) < 0.01 < 0.1 < expected_error(boasting)


def test_an_experiment_leaves_figures_and_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    main(quick=True, out=tmp_path, only=["robust_edges"], seed=1, workers=1)
    figures = record.read(tmp_path / FOLDER / "robust_edges.json")
    assert figures["command"] == "python -m benchmarks.robust --quick --seed 1 --only robust_edges"
    assert "answers" not in figures
    assert "## Edges of plantations" in (tmp_path / "results.md").read_text()


def test_the_published_figures_hold_what_is_claimed() -> None:
    figures = {name: record.read(RESULTS / f"{name}.json") for name in (*EXPERIMENTS, RELIABILITY)}
    assert set(figures) == set(SECTIONS)
    assert all((RESULTS / f"{name}.svg").exists() for name in PICTURES)
    cells = figures["robust_table1"]["cells"]
    assert len(figures["robust_table1"]["seeds"]) >= 3
    assert min(min(one["f1_by_seed"]) for one in cells) >= 0.99
    assert sum(row["false"] for row in figures["robust_grid"]["summaries"]) == 0
    assert all(row["outside"] >= 2_000 for row in figures["robust_grid"]["summaries"])
    planted = figures["robust_rows"]["summaries"]
    assert sum(row["outside"] for row in planted) >= 10_000
    assert sum(row["false"] + row["wrong"] for row in planted) == 0
    assert sum(row["right"] for row in planted) >= 0.95 * sum(row["oracle"] for row in planted)
    edged = figures["robust_edges"]["summaries"]
    assert all(row["inside"] + row["outside"] >= 30 for row in edged)
    assert sum(row["false"] + row["wrong"] for row in edged) == 0
    assert sum(row["right"] for row in edged) >= 0.95 * sum(row["oracle"] for row in edged)
    for (_, _, jitter, _), row in zip(figures["robust_edges"]["kinds"], edged, strict=True):
        assert row["right"] >= (0.8 * row["inside"] if jitter >= 0.1 else 0)
    few = figures["robust_few_trees"]["summaries"]
    assert sum(row["false"] + row["wrong"] for row in few) == 0
    assert all(row["outside"] >= 300 for row in few)
    real = [row for levels in figures["robust_stands"]["stands"].values() for row in levels.values()]
    assert sum(row["wrong"] + row["false"] for row in real) == 0
    for group in figures["robust_stands"]["plots"]:
        assert (group["rioja"]["right"], group["prf025"]["right"]) == (8, 1)
        assert group["t3upland"]["right"] >= 18
        assert sum(row["wrong"] for row in group.values()) == 0
    assert all(one["count"] >= LEAST for one in figures[RELIABILITY]["bins"])
    assert figures[RELIABILITY]["expected_error"] < 0.03
