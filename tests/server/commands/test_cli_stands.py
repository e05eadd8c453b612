"""`urquhart stands`."""

import csv
import json
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from server.stem_maps.formats.files import file_digest
from tests.server.commands.cli_helpers import Urquhart, refused, write_observation
from urquhart import SE2

OPTIONS = ["--collection", "c", "--radius", 20, "--spacing", 14]


@pytest.fixture
def two_stands(urquhart: Urquhart, tmp_path: Path) -> Path:
    """A database with the stands `north` of 140 trees and `south` of 100, stored in this order."""
    for name, count in (("north", 140), ("south", 100)):
        trees = np.random.default_rng(count).uniform(0.0, (64.0, 52.0), (count, 2))
        write_observation(tmp_path / f"{name}.csv", trees)
    assert urquhart("index", "north.csv", "south.csv", *OPTIONS, "--processes", 1).code == 0
    return tmp_path / "urquhart.db"


def submaps_of(path: Path, stand: str) -> int:
    with closing(sqlite3.connect(path)) as connection:
        query = "SELECT count(*) FROM submaps WHERE id LIKE ? || '-%'"
        return int(connection.execute(query, [stand]).fetchone()[0])


def test_a_stand_from_its_listing_to_its_removal(urquhart: Urquhart, two_stands: Path) -> None:
    count, others = submaps_of(two_stands, "north"), submaps_of(two_stands, "south")
    listed = urquhart("stands", "list", "c").out.splitlines()
    assert re.search(rf"^ *north +140 +{count} +20 m +14 m +20\d\d-\d\d-\d\d \d\d:\d\d *$", listed[1])
    assert re.search(r"^ *south +100 ", listed[2])
    shown = urquhart("stands", "show", "c", "north").out
    digest = file_digest(two_stands.parent / "north.csv")
    assert re.search(rf"^file +{digest}$", shown, re.MULTILINE)
    assert re.search(rf"^submaps +{count}$", shown, re.MULTILINE)
    assert urquhart("stands", "remove", "c", "north").out == f"north: removed with {count} submaps\n"
    assert (submaps_of(two_stands, "north"), submaps_of(two_stands, "south")) == (0, others)
    assert "north" not in urquhart("stands", "list", "c").out
    assert "clean" in urquhart("db", "check").out
    refused(urquhart("stands", "remove", "c", "north"), "There is no stand 'north' here.")


def test_a_stand_keeps_the_system_of_its_file(urquhart: Urquhart, two_stands: Path, tmp_path: Path) -> None:
    assert "crs      not known\n" in urquhart("stands", "show", "c", "north").out
    trees = np.random.default_rng(140).uniform(0.0, (64.0, 52.0), (140, 2)) + (448100.0, 5411000.0)
    write_observation(tmp_path / "north.csv", trees)
    assert urquhart("index", "north.csv", *OPTIONS, "--crs", "EPSG:25832", "--processes", 1).code == 0
    assert "crs      EPSG:25832\n" in urquhart("stands", "show", "c", "north").out


def test_a_removed_stand_is_found_no_more(urquhart: Urquhart, two_stands: Path, tmp_path: Path) -> None:
    trees = np.random.default_rng(140).uniform(0.0, (64.0, 52.0), (140, 2))
    seen = write_observation(tmp_path / "seen.csv", trees[np.hypot(*(trees - (35.0, 15.0)).T) < 12.0])
    assert urquhart("locate", seen, "--collection", "c").out.startswith("matched")
    urquhart("stands", "remove", "c", "north")
    assert urquhart("locate", seen, "--collection", "c").out.startswith("no_match")
    assert "0 replaced" in urquhart("index", "north.csv", *OPTIONS, "--processes", 1).out
    assert urquhart("locate", seen, "--collection", "c").out.startswith("matched")


def test_a_submap_that_belongs_to_the_stand_no_more_stays(urquhart: Urquhart, two_stands: Path) -> None:
    count = submaps_of(two_stands, "north")
    with closing(sqlite3.connect(two_stands)) as connection, connection:
        connection.execute("UPDATE submaps SET stand_key = NULL WHERE id = (SELECT min(id) FROM submaps)")
    assert f"with {count - 1} submaps" in urquhart("stands", "remove", "c", "north").out
    assert submaps_of(two_stands, "north") == 1


def test_what_is_not_there(urquhart: Urquhart, tmp_path: Path) -> None:
    refused(urquhart("stands", "list", "c"), "no such database")
    assert list(tmp_path.iterdir()) == []
    urquhart("db", "upgrade")
    for arguments in (["list", "c"], ["show", "c", "north"], ["remove", "c", "north"]):
        refused(urquhart("stands", *arguments), "There is no collection 'c' here.")


# ---------------------------------------------------------------- one bad file of several


def test_a_bad_file_is_a_row_and_the_others_are_stored(urquhart: Urquhart, two_stands: Path, tmp_path: Path) -> None:
    count = submaps_of(two_stands, "south")
    write_observation(tmp_path / "east.csv", np.random.default_rng(3).uniform(0.0, (64.0, 52.0), (120, 2)))
    (tmp_path / "north.csv").write_text("tree_id,x_m,y_m\n1,2,3\n2,oak,4\n")
    write_observation(tmp_path / "few.csv", np.array([[0.0, 0.5], [3.1, 1.0], [7.2, 5.3]]))
    write_observation(tmp_path / "south.csv", np.array([(2.0 * i, float(i)) for i in range(40)]))
    files = ["north.csv", "none.csv", "few.csv", "south.csv", "east.csv"]
    said = urquhart("index", *files, *OPTIONS, "--processes", 1)
    assert said.code == 2
    rows = said.out.splitlines()
    assert [row.partition(".csv")[0] for row in rows[:4]] == [f"not stored: {name[:-4]}" for name in files[:4]]
    for row, word in zip(rows, ("north.csv:3:", "no such file", "at least 10", "keeps the submaps"), strict=False):
        assert word in row
    assert rows[5].startswith("east: 120 trees -> ")
    assert said.err.splitlines()[-1].startswith("urquhart: 4 of 5 files were not stored")
    assert submaps_of(two_stands, "north") and submaps_of(two_stands, "south") == count
    assert submaps_of(two_stands, "east")


def test_bad_files_alone_make_no_database(urquhart: Urquhart, tmp_path: Path) -> None:
    said = urquhart("index", "a.csv", "b.csv", *OPTIONS)
    assert (said.code, said.out.count("not stored: "), list(tmp_path.iterdir())) == (2, 2, [])


# ---------------------------------------------------------------- whole plots as submaps


def ids_in(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return [row[0] for row in connection.execute("SELECT id FROM submaps ORDER BY id")]


def test_a_whole_file_is_one_submap_and_takes_the_place_of_its_discs(urquhart: Urquhart, two_stands: Path) -> None:
    others = [name for name in ids_in(two_stands) if name.startswith("south-")]
    said = urquhart("index", "north.csv", "--collection", "c", "--one-submap", "--processes", 1)
    assert "north: 140 trees -> 1 submaps (1 new" in said.out
    assert "before, the radius was 20 m and the spacing 14 m" in said.out
    assert "0 trees in no submap" not in said.out
    assert ids_in(two_stands) == ["north", *others]
    trees = np.random.default_rng(140).uniform(0.0, (64.0, 52.0), (140, 2))
    here = SE2(35.0, 15.0, 0.4)
    near = trees[np.hypot(*(trees - (here.x, here.y)).T) < 15.0]
    write_observation(two_stands.parent / "seen.csv", here.inverse().apply(near))
    found = urquhart("locate", "seen.csv", "--collection", "c", "--seed", 1).out
    assert "pose in north: x 35.000 m, y 15.000 m, yaw 22.92 deg" in found
    radius = np.hypot(*(trees - (trees.min(axis=0) + trees.max(axis=0)) / 2).T).max()
    assert re.search(rf"^radius +{radius:g} m$", urquhart("stands", "show", "c", "north").out, re.MULTILINE)
    assert "1 unchanged" in urquhart("index", "north.csv", "--collection", "c", "--one-submap").out


def test_each_plot_is_one_submap_however_large(urquhart: Urquhart, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rows = [
        f"{plot},{tree},{x},{y}\n"
        for plot, side, count in (("1", 20.0, 40), ("2", 90.0, 70), ("3", 20.0, 5))
        for tree, (x, y) in enumerate(rng.uniform(0.0, side, (count, 2)).tolist())
    ]
    (tmp_path / "plots.csv").write_text("plot,tree,x,y\n" + "".join(rows))
    said = urquhart("index", "plots.csv", "--plot", "plot", "--collection", "c", "--one-submap", "--processes", 1)
    assert (said.code, ids_in(tmp_path / "urquhart.db")) == (0, ["plots-1", "plots-2"])
    assert "2 plots, each a place of its own; 1 plots left out with fewer than 10 trees, the first '3'" in said.out


def test_how_to_cut_is_said_once(urquhart: Urquhart, tmp_path: Path) -> None:
    write_observation(tmp_path / "few.csv", np.array([[0.0, 0.5], [3.1, 1.0], [7.2, 5.3]]))
    index = ("index", "few.csv", "--collection", "c")
    refused(urquhart(*index), "give --radius and --spacing, or --one-submap")
    refused(urquhart(*index, "--radius", 20), "give --radius and --spacing, or --one-submap")
    refused(urquhart(*index, "--radius", 20, "--one-submap"), "leave out --radius and --spacing")
    refused(urquhart(*index, "--one-submap"), "few.csv: the stem map has 3 trees, and a submap needs at least 10")
    assert not (tmp_path / "urquhart.db").exists()


def landmarks(urquhart: Urquhart, path: Path) -> dict[str, tuple[float, float]]:
    """The trees of the collection where they stand in the map, by id."""
    assert urquhart("export", "landmarks", path, "--collection", "c", "--frame", "north").code == 0
    with path.open(newline="") as file:
        return {row["id"]: (float(row["x"]), float(row["y"])) for row in csv.DictReader(file)}


def test_a_stand_is_moved_as_one_thing(urquhart: Urquhart, two_stands: Path, tmp_path: Path) -> None:
    before = landmarks(urquhart, tmp_path / "before.csv")
    said = urquhart("stands", "move", "c", "north", "--east", -4.2, "--north", 2.71, "--turn", 30, "--about", "10,20")
    assert said.out.endswith("submaps moved -4.2 m east, +2.71 m north, turned 30 deg clockwise\n"), said.err
    after = landmarks(urquhart, tmp_path / "after.csv")
    motion = SE2(5.8, 22.71, -np.pi / 6) @ SE2(-10.0, -20.0, 0.0)
    assert after.keys() == before.keys()
    np.testing.assert_allclose(
        [after[name] for name in before], motion.apply(np.array(list(before.values()))), atol=2e-4
    )
    assert "clean" in urquhart("db", "check").out
    seen = write_observation(tmp_path / "seen.csv", np.array([xy for xy in before.values() if max(xy) < 35.0]))
    found = json.loads(urquhart("locate", seen, "--collection", "c", "--json").out)["candidates"][0]["map_pose"]
    assert (found["x"], found["y"], found["yaw"]) == pytest.approx((motion.x, motion.y, motion.yaw), abs=1e-3)
    assert urquhart("index", "north.csv", *OPTIONS, "--processes", 1).code == 0
    assert landmarks(urquhart, tmp_path / "again.csv") == before


def test_the_frame_of_a_stand_is_placed_on_earth(urquhart: Urquhart, two_stands: Path) -> None:
    said = urquhart("stands", "move", "c", "north", "--crs", "EPSG:25832", "--origin", "448000,5411000")
    assert said.out == "north: now in EPSG:25832\n"
    for words, told in (
        (("--crs", "EPSG:4326"), "gives degrees"),
        (("--crs", "EPSG:25832", "--east", 1), "give one of both"),
        (("--origin", "1,2"), "--origin needs --crs"),
        ((), "nothing would move"),
        (("--east", 5e6), "outside the area of use"),
    ):
        refused(urquhart("stands", "move", "c", "north", *words), told)


def test_a_stand_is_replaced_under_its_name(urquhart: Urquhart, two_stands: Path, tmp_path: Path) -> None:
    trees = np.random.default_rng(140).uniform(0.0, (64.0, 52.0), (140, 2))
    write_observation(tmp_path / "corrected.csv", trees[:120] + (500.0, 0.0))
    said = urquhart("stands", "replace", "c", "north", "corrected.csv")
    assert said.code == 0, said.err
    assert "removed)" in said.out
    shown = urquhart("stands", "show", "c", "north").out
    assert re.search(r"^trees +120$", shown, re.MULTILINE) and re.search(r"^radius +20 m$", shown, re.MULTILINE)
    listed = urquhart("stands", "list", "c").out
    assert "corrected" not in listed and listed.count(" north ") == 1
    refused(urquhart("stands", "replace", "c", "west", "corrected.csv"), "'west'")
    again = urquhart("stands", "replace", "c", "north", "corrected.csv", "--one-submap")
    assert "north: 1 submaps" in again.out
    # A stand that is one submap stays one.
    kept = urquhart("stands", "replace", "c", "north", "corrected.csv")
    assert "north: 1 submaps" in kept.out, kept.out
