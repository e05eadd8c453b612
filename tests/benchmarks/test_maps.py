"""A small version of `make bench-maps`, and its page."""

from pathlib import Path

import pytest

from benchmarks import record
from benchmarks.maps import graphs, stands, tracks
from benchmarks.maps.__main__ import EXPERIMENTS
from benchmarks.maps.report import report
from benchmarks.markdown import FOLDER

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

DOCS = Path(__file__).parents[2] / "docs"


def test_false_loops_that_agree_with_each_other_do_not_fold_a_drive() -> None:
    """Seed 1 with 5 % of drift: graduated non-convexity alone, from all constraints at once, is 68 m off."""
    found = graphs.run_job(graphs.GraphJob(120, 0.05, 0.3, grouped=True, seed=1))
    assert found["false"] > 100 and found["false_kept"] == 0
    assert found["right_refused"] <= 2
    assert found["parts"] == 1 and found["after"] < 2.0 < found["before"]


def test_a_map_of_a_plantation_is_not_folded() -> None:
    """Of its 195 matches 116 were false, 3 were kept and folded the map, before each was compared with its rivals."""
    found = stands.run_job(stands.StandJob("rows 3 x 3 m, jitter 0.3 m", 2))
    assert found["matches"] > 70 and found["false"] == found["false_kept"] == 0
    assert found["largest"] > 30 and found["error"] < 0.3
    assert found["doubled"] + found["lost"] + found["mixed"] < 0.01 * found["trees"]


def test_a_track_through_a_real_stem_map() -> None:
    found = tracks.run_job(tracks.TrackJob("10 cm, 90 %", "lansing", 0, 0))
    assert found["right"] == found["steps"] == 23
    assert found["errors"].mean() < found["reference"].mean() + 0.02
    assert found["doubled"] + found["lost"] + found["mixed"] < 0.015 * found["trees"]


def test_the_page_is_made_of_the_figures_beside_it() -> None:
    paths = {name: DOCS / FOLDER / f"{name}.json" for name in EXPERIMENTS}
    figures = {name: record.read(path) for name, path in paths.items() if path.exists()}
    assert (DOCS / "maps.md").read_text() == report(figures)
