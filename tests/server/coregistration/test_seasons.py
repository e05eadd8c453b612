"""Reading a season's plots, and which of them need eyes."""

from pathlib import Path

import numpy as np

from server.coregistration.journal import Journal
from server.coregistration.outputs.attention import needs_attention
from server.coregistration.outputs.folder import file_names
from server.coregistration.results import PlotPose, PlotResult, PlotTree, from_json
from server.coregistration.season import plot_files, read_season
from server.stem_maps.reading.options import ReadOptions

RNG = np.random.default_rng(4)


def write(path: Path, header: str, rows: list[str]) -> Path:
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def rows_of(plot: str, count: int = 12, at: float = 0.0) -> list[str]:
    return [f"{plot},{tree},{at + x:.2f},{y:.2f}" for tree, (x, y) in enumerate(RNG.uniform(0.0, 20.0, (count, 2)))]


def test_a_folder_is_a_season_and_names_are_unique(tmp_path: Path) -> None:
    write(tmp_path / "s" / "north.csv", "plot,tag,x,y", rows_of("P1") + rows_of("P2"))
    write(tmp_path / "s" / "south.csv", "plot,tag,x,y", rows_of("P1", at=400.0) + rows_of("P3", at=800.0))
    write(tmp_path / "s" / "west.csv", "tag,x,y", [row.partition(",")[2] for row in rows_of("")])
    (tmp_path / "s" / "notes.md").write_text("not a file of trees", encoding="utf-8")
    (tmp_path / "s" / "2025").mkdir()
    files = plot_files([tmp_path / "s"])
    assert files.passed_over == (
        "s: 1 folders in it are not read: 2025; name them, too",
        "s: 1 files are of no format of trees and not read: notes.md",
    )
    season = read_season(files.paths, ReadOptions())
    assert [plot.name for plot in season.plots] == ["north-P1", "P2", "south-P1", "P3", "west"]
    assert season.plots[0].trees.ids == tuple(map(str, range(12)))  # tags as they are, though they repeat
    assert not season.unread
    assert len(season.told) == 3


def test_a_plot_with_a_bad_row_keeps_no_other_back(tmp_path: Path) -> None:
    path = write(
        tmp_path / "s.csv", "plot,tag,x,y", [*rows_of("P1"), "P2,1,1.0,2.0", "P2,2,,3.0", "P3,1", *rows_of("P4")]
    )
    season = read_season([path], ReadOptions())
    assert [plot.name for plot in season.plots] == ["P1", "P4"]
    unread = {one.name: one.why for one in season.unread}
    assert set(unread) == {"P2", "s"}  # a row that is cut off is of no plot
    assert "s.csv:15" in unread["P2"]
    kept = read_season([path], ReadOptions(skip_bad=True))
    assert [plot.name for plot in kept.plots] == ["P1", "P2", "P4"]


def test_the_centre_is_what_a_plot_was_measured_from(tmp_path: Path) -> None:
    polar = [f"P1,{tree},{30 * tree},{3 + tree / 2}" for tree in range(12)]
    centres = write(tmp_path / "s" / "centres.csv", "plot,x,y", ["P1,448000,5411000"])
    write(tmp_path / "s" / "polar.csv", "plot,tag,azimuth,distance", polar)
    options = ReadOptions(centres=centres, azimuth="azimuth", distance="distance", angle="deg")
    (plot,) = read_season(plot_files([tmp_path / "s"]).paths, options).plots
    assert plot.centre == (448000.0, 5411000.0)
    assert plot.measured
    (cut,) = read_season([write(tmp_path / "p.csv", "plot,tag,x,y", rows_of("P1"))], ReadOptions()).plots
    assert not cut.measured


def result_at(name: str, e: float, n: float, shift: float = 0.0, trees: int = 10) -> PlotResult:
    """A matched plot; its trees are the same for the same number of them, but turned."""
    turn = np.random.default_rng(len(name) + trees).uniform(0, 6.28)
    xy = np.random.default_rng(trees).uniform(0.0, 20.0, (trees, 2))
    c, s = np.cos(turn), np.sin(turn)
    turned = xy @ np.array([[c, s], [-s, c]]) + (e, n)
    pose = PlotPose("m", None, e, n, shift, 0.0, 0.0, None, None, 0.01, 0.01, 0.1, np.eye(4).tolist())
    return PlotResult(
        name, "f.csv", name, "matched", "verified", "found", centre=(e, n), radius=10.0, pose=pose, inliers=trees,
        share=1.0, rms=0.1, scale=1.0, trees=[PlotTree(str(i), x, y, None) for i, (x, y) in enumerate(turned.tolist())],
    )  # fmt: skip


def test_plots_that_stand_out_need_eyes() -> None:
    plain = [result_at(f"P{i}", 100.0 * i, 0.0, shift=0.1 * i, trees=10 + i) for i in range(9)]
    assert needs_attention(plain) == []
    far = result_at("far", 2000.0, 0.0, shift=40.0, trees=30)
    twin, there = result_at("twin", 4000.0, 0.0, trees=10), result_at("there", 100.5, 0.0, trees=31)
    unread = PlotResult("bad", "f.csv", "", "not_read", "not_read", "f.csv:3: x is missing")
    found = needs_attention([*plain, far, twin, there, unread])
    why = {one.result.name: " ".join(one.why) for one in found}
    assert next(iter(why)) == "bad"
    assert set(why) == {"bad", "far", "P0", "twin", "P1", "there"}
    assert "39" in why["far"] or "40" in why["far"]
    assert "same trees as twin" in why["P0"]
    assert "is placed where there is, too" in why["P1"]


def test_results_come_back_from_the_journal(tmp_path: Path) -> None:
    results = [result_at("a", 1.0, 2.0), PlotResult("b", "f.csv", "b", "no_match", "below_gate", "not found")]
    with Journal(tmp_path / "out") as journal:
        for one in results:
            journal.add(one)
    with (tmp_path / "out" / "results.jsonl").open("ab") as file:
        file.write(b'{"of": "another version"}\n' + results[0].to_json()[:40])
    with Journal(tmp_path / "out") as journal:
        assert [journal.find(one.key) for one in results] == results
        journal.add(results[0])
    assert from_json((tmp_path / "out" / "results.jsonl").read_bytes().splitlines()[-1]) == results[0]


def test_files_of_plots_have_names_that_every_system_takes() -> None:
    names = file_names([result_at(name, 0.0, 0.0) for name in ("A/1", "a 1", "A_1", "..", "Größe")])
    assert len({name.lower() for name in names.values()}) == 5
    assert names["Größe"] == "Größe"
    assert all("/" not in name and name.strip(".") for name in names.values())
