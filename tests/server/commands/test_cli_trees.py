"""`urquhart locate` for foresters: tree by tree, with a picture, and the places that fit equally well."""

import csv
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from server.cli import run
from tests.server.commands.cli_helpers import Urquhart

RADIUS = 14.0


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stem map of 80 x 80 m with tags and diameters."""
    rng = np.random.default_rng(3)
    xy = rng.uniform(0.0, 80.0, (400, 2))
    rows = [
        f"m{i},{x:.3f},{y:.3f},{d:.1f}\n" for i, ((x, y), d) in enumerate(zip(xy, rng.uniform(8, 60, 400), strict=True))
    ]
    path = tmp_path_factory.mktemp("map") / "survey2010.csv"
    path.write_text("tag,x_m,y_m,dbh_cm\n" + "".join(rows))
    return path


@pytest.fixture(scope="module")
def mapped(map_file: Path) -> Path:
    """A database with that map in discs of 15 m, so that no disc has all trees of a plot."""
    path = map_file.with_name("map.db")
    options = ["--collection", "forest", "--radius", "15", "--spacing", "12", "--database", str(path)]
    assert run(["index", str(map_file), *options]) == 0
    return path


@pytest.fixture
def plot_file(map_file: Path, tmp_path: Path) -> Path:
    """A plot about 37, 42 surveyed again: two trees are gone, one is new, and all are 1 cm thicker."""
    rng = np.random.default_rng(4)
    with map_file.open() as file:
        trees = list(csv.DictReader(file))
    near = [t for t in trees if np.hypot(float(t["x_m"]) - 37, float(t["y_m"]) - 42) < RADIUS]
    inner = sorted(near, key=lambda t: np.hypot(float(t["x_m"]) - 37, float(t["y_m"]) - 42))
    felled = {inner[0]["tag"], inner[1]["tag"]}
    lines = ["tag,x_m,y_m,dbh_cm\n", "new,0.40,0.30,7.5\n"]
    for t in near:
        if t["tag"] not in felled:
            x, y = rng.normal([float(t["x_m"]) - 37, float(t["y_m"]) - 42], 0.05).tolist()
            lines.append(f"p{t['tag']},{x:.3f},{y:.3f},{float(t['dbh_cm']) + 1:.1f}\n")
    path = tmp_path / "plot7.csv"
    path.write_text("".join(lines))
    return path


def test_every_tree_is_told_with_its_partner_in_the_whole_map(
    urquhart: Urquhart, mapped: Path, plot_file: Path, tmp_path: Path
) -> None:
    pairs, svg = tmp_path / "pairs.csv", tmp_path / "match.svg"
    said = urquhart("locate", plot_file, "--collection", "forest", "--database", mapped, "--pairs", pairs, "--svg", svg)
    assert said.code == 0, said.err
    count = len(plot_file.read_text().splitlines()) - 1
    assert f"inliers: {count - 1} of {count} trees are in the map" in said.out
    assert "1 are not (ingrowth" in said.out and "2 trees of the map are not in plot7 (felled" in said.out
    with pairs.open() as file:
        rows = list(csv.DictReader(file))
    both = [row for row in rows if row["seen"] == "both"]
    assert len(both) == count - 1
    assert all(row["tag"] == f"p{row['partner']}" for row in both)
    assert all(abs(float(row["dbh_cm"]) - float(row["partner_dbh_cm"]) - 1.0) < 0.06 for row in both)
    assert [row["tag"] for row in rows if row["seen"] == "plot"] == ["new"]
    assert len([row for row in rows if row["seen"] == "map"]) == 2
    drawn = svg.read_text()
    ElementTree.fromstring(drawn)
    assert "plot7" in drawn and "forest" in drawn and ">new<" in drawn and "N</text>" in drawn


def test_trees_that_are_not_found_have_no_pairs(urquhart: Urquhart, mapped: Path, tmp_path: Path) -> None:
    xy = np.random.default_rng(9).uniform(0.0, 25.0, (40, 2))
    path = tmp_path / "elsewhere.csv"
    path.write_text("tag,x_m,y_m\n" + "".join(f"{i},{x:.3f},{y:.3f}\n" for i, (x, y) in enumerate(xy.tolist())))
    pairs = tmp_path / "pairs.csv"
    said = urquhart("locate", path, "--collection", "forest", "--database", mapped, "--pairs", pairs)
    assert (said.code, pairs.exists()) == (0, False)
    assert "no pairs to write: the trees are not matched" in said.out


def test_places_that_fit_equally_are_told_once_and_in_the_map(urquhart: Urquhart, tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(0.0, 60.0, 3.0), np.arange(0.0, 60.0, 3.0))
    lattice = np.column_stack([x.ravel(), y.ravel()]) + np.random.default_rng(5).normal(0.0, 0.03, (400, 2))
    for name, trees in (
        ("rows", lattice + (500.0, 700.0)),
        ("seen", lattice[(np.abs(lattice - 30.0) < 11.0).all(axis=1)] - 30.0),
    ):
        lines = "".join(f"{i},{a:.3f},{b:.3f}\n" for i, (a, b) in enumerate(trees.tolist()))
        (tmp_path / f"{name}.csv").write_text("tag,x_m,y_m\n" + lines)
    database = tmp_path / "rows.db"
    where = ("--collection", "rows", "--database", database)
    assert urquhart("index", tmp_path / "rows.csv", *where, "--radius", "20", "--spacing", "15").code == 0
    said = urquhart("locate", tmp_path / "seen.csv", *where)
    assert "ambiguous (rival_too_close)" in said.out
    places = [line for line in said.out.splitlines() if line.startswith("possible place: ")]
    assert f"fits {len(places)} places about equally well" in said.out
    assert len(places) > 1 and len(set(places)) == len(places)
    assert all(500.0 < float(line.split()[2]) < 560.0 for line in places)
    assert "say that chance hardly explains this many trees. The confidence is" in said.out
