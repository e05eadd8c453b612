"""`urquhart check`: what a file holds, as figures, a drawing and a list of rows that cannot be used."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from tests.server.commands.cli_helpers import LONGLEAF, Said, Urquhart, refused

TREES = np.random.default_rng(41).uniform(0.0, (60.0, 40.0), (80, 2)).round(2)


def write(folder: Path, text: str = "", header: str = "id,x,y,dbh_cm", scale: float = 1.0) -> Path:
    path = folder / "stand.csv"
    rows = "".join(f"t{n},{scale * x},{scale * y},{20 + n % 30}\n" for n, (x, y) in enumerate(TREES.tolist()))
    path.write_text(f"{header}\n{rows}{text}")
    return path


def test_the_figures_of_a_file(urquhart: Urquhart, tmp_path: Path) -> None:
    said = urquhart("check", LONGLEAF, "--svg", "longleaf.svg")
    assert (said.code, said.err) == (0, "")
    for figure in (
        "longleaf.csv: read tree_id from 'tree_id', x_m from 'x_m'",
        "trees      584",
        "box        x 0.00 to 200.00 m",
        "trees on a hectare",
        "spacing    median",
        "dbh        known of 584 of 584 trees, median 26.1 cm",
        "duplicates 0 trees within 1 cm",
        "outliers   none",
        "system     not known: name it with --crs",
        "drawn: longleaf.svg",
    ):
        assert figure.split("  ")[0] in said.out
        assert figure.split("  ")[-1] in said.out, said.out
    circles = [
        one
        for one in ElementTree.fromstring((tmp_path / "longleaf.svg").read_text()).iter()
        if one.tag.endswith("circle")
    ]
    assert len(circles) == 584
    assert not (tmp_path / "urquhart.db").exists()


def test_duplicates_and_outliers_are_counted_and_named(urquhart: Urquhart, tmp_path: Path) -> None:
    x, y = TREES[0]
    said = urquhart("check", write(tmp_path, f"a,{x + 0.005},{y},30\nb,{x + 0.2},{y},30\nlone,900,900,30\n"))
    assert said.code == 0, said.err
    assert "2 trees within 1 cm of another one, 3 within 0.3 m" in said.out
    assert "1 trees stand far from all others: 'lone' (stand.csv:84)" in said.out


def test_all_bad_rows_are_listed(urquhart: Urquhart, tmp_path: Path) -> None:
    write(tmp_path, "".join(f"bad{n},oak,{n},30\n" for n in range(24)) + "x,1,2\n")
    said = urquhart("check", "stand.csv", "--errors", "bad.txt")
    assert said.code == 2
    assert "80, and 25 rows that cannot be used" in said.out
    lines = said.err.splitlines()
    assert lines[0] == "stand.csv:82: x: not a number: 'oak'"
    assert (len(lines), lines[-1]) == (21, "and 5 more: all 25 are in bad.txt")
    listed = (tmp_path / "bad.txt").read_text().splitlines()
    assert (listed[:20], len(listed), listed[-1]) == (lines[:20], 25, "stand.csv:106: 3 fields where the header has 4")
    skipped = urquhart("check", "stand.csv", "--skip-bad")
    assert (skipped.code, skipped.err) == (0, "")
    assert "left out 25 rows that cannot be used" in skipped.out


def stopped(said: Said, *words: str) -> None:
    """The figures are shown, and then what stops the file."""
    assert said.code == 2
    assert "trees" in said.out
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err


@pytest.mark.parametrize(("scale", "words"), [(3.2808, "--unit ft"), (0.1, "trees on a hectare: name the unit")])
def test_what_stops_index_stops_check_after_the_figures(
    urquhart: Urquhart, tmp_path: Path, scale: float, words: str
) -> None:
    write(tmp_path, scale=scale)
    stopped(urquhart("check", "stand.csv"), words)
    refused(urquhart("index", "stand.csv", "--collection", "c", "--radius", 20, "--spacing", 15), words)
    refused(urquhart("locate", "stand.csv", "--collection", "c"), words)
    assert urquhart("check", "stand.csv", "--unit", "m").code == 0


def test_files_without_trees_are_refused(urquhart: Urquhart, tmp_path: Path) -> None:
    (tmp_path / "none.csv").write_text("x,y\n")
    said = urquhart("check", "none.csv")
    assert (said.code, "has a header but no trees" in said.err) == (2, True)
    refused(urquhart("check", "gone.csv"), "no such file")
