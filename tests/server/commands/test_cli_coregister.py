"""`urquhart coregister`: a season in one command."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from server.coregistration.journal import JOURNAL, Journal
from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, Said, Urquhart, refused
from urquhart import SE2

CENTRES = {"P1": (60.0, 60.0), "P2": (100.0, 100.0), "P3": (140.0, 60.0)}
"""Of plots in longleaf, metres; P2 is in the middle between four discs of 40 m."""
MOVED = SE2(4.2, -2.7, 0.026)
"""What the surveyors' coordinates are off by: `plot_T_map`, about each plot's centre."""


def seen_from(centre: tuple[float, float], radius: float = 24.0) -> tuple[list[str], NDArray[np.float64]]:
    """Ids and positions, as surveyed, of the trees around a point."""
    trees = read_stem_map(LONGLEAF)
    inside = np.flatnonzero(np.hypot(*(trees.xy - centre).T) < radius)
    noise = np.random.default_rng(int(sum(centre))).normal(0.0, 0.05, (len(inside), 2))
    return [trees.ids[tree] for tree in inside], MOVED.apply(trees.xy[inside] - centre) + centre + noise


def season_csv(path: Path, **more: str) -> Path:
    """A season of the plots of `CENTRES`, of one that is elsewhere, and of one with a bad row."""
    rows = ["plot,tag,x,y"]
    for plot, centre in CENTRES.items():
        ids, xy = seen_from(centre)
        rows += [f"{plot},{tag},{x:.4f},{y:.4f}" for tag, (x, y) in zip(ids, xy.tolist(), strict=True)]
    elsewhere = np.random.default_rng(3).uniform(0.0, 40.0, (30, 2)) + (300.0, 300.0)
    rows += [f"P4,{tag},{x:.4f},{y:.4f}" for tag, (x, y) in enumerate(elsewhere.tolist())]
    rows += [f"P5,{tag},{500 + 7 * tag},{500 + tag * tag}" for tag in range(12)] + [more.get("bad", "P5,12,none,3")]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def place(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> Urquhart:
    """Runs `urquhart coregister` in the collection of longleaf, into the folder `out`."""

    def call(*plots: object) -> Said:
        where = ["--collection", "stand", "--database", indexed, "--out", tmp_path / "out", "--effort", "fast"]
        return urquhart("coregister", *plots, *where)

    return call


def test_a_season_is_placed_and_bad_plots_are_rows(place: Urquhart, tmp_path: Path) -> None:
    said = place(season_csv(tmp_path / "season.csv"))
    assert said.code == 2
    assert "5 plots: 3 matched, 1 no match, 1 not read" in said.out
    out = tmp_path / "out"
    plots = {row["plot"]: row for row in table(out / "plots.csv")}
    assert [plots[name]["verdict"] for name in ("P1", "P2", "P3", "P4", "P5")] == [
        *["matched"] * 3,
        "no_match",
        "not_read",
    ]
    assert "season.csv:" in plots["P5"]["sentence"]
    assert "has no value" in plots["P5"]["sentence"]
    for name, centre in CENTRES.items():
        ids, _ = seen_from(centre)
        row = plots[name]
        assert int(row["inliers"]) == len(ids)  # of all trees of the map, whatever submap it was found in
        at = MOVED.inverse().apply(np.array([[float(row["x"]), float(row["y"])]]) - centre)[0] + centre
        np.testing.assert_allclose([float(row["E"]), float(row["N"])], at, atol=4 * float(row["sigma_E"]) + 0.001)
        assert float(row["turn_cw_deg"]) == pytest.approx(np.degrees(MOVED.yaw), abs=5 * float(row["sigma_turn_deg"]))
        assert float(row["dE"]) == pytest.approx(float(row["E"]) - float(row["x"]), abs=0.0015)
    trees = table(out / "trees.csv")
    assert all(row["tag"] == row["partner"] for row in trees if row["plot"] in CENTRES)
    assert {row["E"] for row in trees if row["plot"] == "P4"} == {""}
    check_transforms(out, trees)
    check_layers(out, plots)
    check_report(out)
    assert {row["seen"] for row in table(out / "pairs.csv")} >= {"both"}
    assert sorted(path.name for path in (out / "pictures").iterdir()) == ["P1.svg", "P2.svg", "P3.svg", "P4.svg"]


def check_transforms(out: Path, trees: list[dict[str, str]]) -> None:
    """The matrices lead from the original to the corrected positions, in both kinds of files."""
    known = json.loads((out / "transforms.json").read_text("utf-8"))["transforms"]
    for name in CENTRES:
        matrix = np.loadtxt(out / "transforms" / f"{name}.txt")
        np.testing.assert_allclose(matrix, known[name]["matrix"])
        rows = [row for row in trees if row["plot"] == name]
        original = np.array([[float(row["x"]), float(row["y"]), 0.0, 1.0] for row in rows])
        corrected = np.array([[float(row["E"]), float(row["N"])] for row in rows])
        np.testing.assert_allclose((original @ matrix.T)[:, :2], corrected, atol=0.002)


def check_layers(out: Path, plots: dict[str, dict[str, str]]) -> None:
    """The GeoPackages have the same rows, and this program reads the trees again."""
    again = read_stem_map(out / "trees.gpkg")
    placed = [row for row in table(out / "trees.csv") if row["E"]]
    np.testing.assert_allclose(again.xy, [[float(row["E"]), float(row["N"])] for row in placed], atol=1e-9)
    import pyogrio.raw  # type: ignore[import-untyped]

    meta, _, geometry, values = pyogrio.raw.read(out / "plots.gpkg", layer="plots")
    columns = dict(zip(meta["fields"].tolist(), values, strict=True))
    assert columns["plot"].tolist() == list(plots)
    assert [shape is None for shape in geometry] == [row["E"] == "" for row in plots.values()]
    assert np.isnan(columns["dE"]).tolist() == [row["dE"] == "" for row in plots.values()]


def check_report(out: Path) -> None:
    """One file that fetches nothing, with what needs eyes before everything else."""
    html = (out / "report.html").read_text("utf-8")
    assert html.count("data:image/svg+xml") == 4
    assert 'src="http' not in html
    assert "<link" not in html
    eyes = html[html.index("What needs eyes first") : html.index("<h2>Map longleaf")]
    assert eyes.index("P5") < eyes.index("P4")
    assert "P1" not in eyes


def test_a_second_run_looks_up_only_what_changed(place: Urquhart, tmp_path: Path) -> None:
    path = season_csv(tmp_path / "season.csv", bad="P5,12,604,3")
    assert place(path).code == 0
    journal = tmp_path / "out" / JOURNAL
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:2]) + lines[2][:100])  # as a kill leaves it
    assert "(2 known from an earlier run)" in place(path).out
    before = table(tmp_path / "out" / "plots.csv")
    text = path.read_text("utf-8")
    first = next(line for line in text.splitlines() if line.startswith("P2"))
    path.write_text(text.replace(f"{first}\n", ""), encoding="utf-8")
    assert "(4 known from an earlier run)" in place(path).out
    after = table(tmp_path / "out" / "plots.csv")
    changed = [a["plot"] for a, b in zip(before, after, strict=True) if a != b]
    assert changed == ["P2"]


def test_a_plot_that_fits_two_places_is_ambiguous_and_says_where(urquhart: Urquhart, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    rows = ["plot,tree,azimuth,distance,x,y"]
    for plot, at in (("A", 0.0), ("B", 0.0), ("C", 1.0)):
        rng = np.random.default_rng(int(at))
        polar = np.column_stack([rng.uniform(0.0, 360.0, 20), 15.0 * np.sqrt(rng.uniform(0.02, 1.0, 20))])
        east = 448000 + 400 * "ABC".index(plot)
        rows += [f"{plot},{tree},{a:.2f},{d:.3f},{east},5411000" for tree, (a, d) in enumerate(polar.tolist())]
    (tmp_path / "plots.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    known = ["--collection", "c", "--crs", "EPSG:25832", "--angle", "deg", "--unit", "m"]
    assert urquhart("index", "plots.csv", "--plot", "plot", "--one-submap", *known, "--processes", 1).code == 0
    said = urquhart("coregister", "plots.csv", *known, "--out", "out")
    assert said.code == 0, said.err
    assert "look at A: ambiguous: has the same trees as B of this season" in said.out
    found = {row["plot"]: row for row in table(tmp_path / "out" / "plots.csv")}
    assert [found[name]["verdict"] for name in "ABC"] == ["ambiguous", "ambiguous", "matched"]
    assert "fits 2 places about equally well" in found["A"]["sentence"]
    places = {(row["places"], row["rival_E"]) for row in (found["A"], found["B"])}
    assert {count for count, _ in places} == {"2"}
    assert {float(east) for _, east in places} <= {448000.0, 448400.0}
    assert (found["C"]["E"], found["C"]["crs"]) == ("448800.0", "EPSG:25832")
    assert float(found["C"]["x"]) == 448800.0  # what its trees were measured from


def test_plots_are_searched_where_they_ought_to_be_first(place: Urquhart, tmp_path: Path) -> None:
    positions, plots = ["plot,x,y"], tmp_path / "plots"
    plots.mkdir()
    for name, centre in CENTRES.items():
        ids, xy = seen_from(centre)
        text = "".join(f"{tag},{x:.3f},{y:.3f}\n" for tag, (x, y) in zip(ids, (xy - centre).tolist(), strict=True))
        (plots / f"{name}.csv").write_text(f"tag,x,y\n{text}")  # about the point 0, 0 of each plot
        there = np.array(centre) + (MOVED.inverse().x + 1.5, MOVED.inverse().y - 1.0)
        positions.append(f"{name},{there[0]},{there[1]}")
    (plots / "gnss.csv").write_text("\n".join(positions) + "\n")
    refused(place(plots, "--positions", plots / "gnss.csv"), "--at-sigma")
    assert place(plots, "--positions", plots / "gnss.csv", "--at-sigma", 3, "--heading-sigma", 3).code == 0
    found = {row["plot"]: row for row in table(tmp_path / "out" / "plots.csv")}
    assert found.keys() == CENTRES.keys()
    (plots / "gnss.csv").write_text("\n".join([positions[0], "Z,1,2", *positions[2:]]) + "\n")
    told = place(plots, "--positions", plots / "gnss.csv", "--at-sigma", 3, "--heading-sigma", 3).err
    assert "gnss.csv: 1 names have no position and are searched everywhere: " in told
    assert "gnss.csv: 1 names are no plot: Z" in told
    for name, centre in CENTRES.items():
        assert (found[name]["verdict"], found[name]["searched"]) == ("matched", "near")
        matrix = np.loadtxt(tmp_path / "out" / "transforms" / f"{name}.txt")
        truth = np.array(centre) + (MOVED.inverse().x, MOVED.inverse().y)
        np.testing.assert_allclose(matrix[:2, 3], truth, atol=0.5)
        shift = np.array([float(found[name]["dE"]), float(found[name]["dN"])])
        np.testing.assert_allclose(matrix[:2, 3] - shift, truth + (1.5, -1.0), atol=0.01)


def test_what_cannot_be_done_is_said_first(urquhart: Urquhart, place: Urquhart, indexed: Path, tmp_path: Path) -> None:
    path = season_csv(tmp_path / "season.csv")
    refused(urquhart("coregister", path, "--collection", "other", "--database", indexed, "--out", "out"), "'other'")
    refused(urquhart("coregister", tmp_path / "no.csv", "--collection", "stand", "--database", indexed, "--out", "o"),
            "no.csv", "no such file")  # fmt: skip
    (tmp_path / "empty").mkdir()
    refused(place("empty"), "no file of trees")
    (tmp_path / "out").mkdir(exist_ok=True)
    with Journal(tmp_path / "out"):
        refused(place(path), "another run")
    (tmp_path / "out" / JOURNAL).unlink()
    (tmp_path / "out" / "mine.txt").write_text("mine", encoding="utf-8")
    refused(place(path), "not results of coregister")
