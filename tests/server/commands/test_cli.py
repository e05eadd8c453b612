"""The command line as a whole, `index` and `locate`."""

import errno
import json
import math
import sqlite3
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tests.server.commands.cli_helpers import LONGLEAF, POSE, Urquhart, refused, write_observation
from urquhart import SE2
from urquhart.report.explanation import REASONS

STAND = ["--collection", "c", "--radius", "1", "--spacing", "1"]

# ------------------------------------------------------------------- root


def test_version_and_help(urquhart: Urquhart) -> None:
    assert urquhart("--version").out.startswith("urquhart ")
    assert "Usage: urquhart" in urquhart().out
    for verb in ("serve", "index", "locate", "demo", "db", "db check", "db upgrade", "keys create"):
        said = urquhart(*verb.split(), "--help")
        assert (said.code, said.err) == (0, "")
        assert f"Usage: urquhart {verb}" in said.out


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["bogus"], "No such command 'bogus' (see urquhart --help)"),
        (["db"], "Missing command (see urquhart db --help)"),
        (["index"], "Missing argument 'FILE...' (see urquhart index --help)"),
        (["index", "a.csv", "--radius", "1", "--spacing", "1"], "--collection"),
        (
            ["index", "a.csv", "--collection", "c", "--radius", "wide", "--spacing", "1"],
            "'wide' must be a number",
        ),
        (["index", "a.csv", *STAND, "--dbh-unit", "ft"], "'--dbh-unit': 'ft' is not one of 'cm', 'mm', 'm', 'in' (see"),
        (
            ["locate", "a.csv", "--collection", "c", "--effort", "quick"],
            "'quick' is not one of 'fast', 'full' (",
        ),
        (
            ["locate", "a.csv", "--collection", "c", "--limit", "0"],
            "'0' must be at least 1 (see urquhart locate",
        ),
        (
            ["keys", "create", "a", "--scope", "own"],
            "'read', 'write', 'admin' (see urquhart keys create",
        ),
        (["serve", "--port", "99999"], "'--port': '99999' must be at most 65,535 (see urquhart serve --help)"),
        (["demo", "--observations", "0"], "--observations"),
    ],
)
def test_a_wrong_command_line_is_one_line(urquhart: Urquhart, arguments: list[str], word: str) -> None:
    said = urquhart(*arguments)
    refused(said, word, "--help)")
    for of_the_library in ("Value error", "Input should"):
        assert of_the_library not in said.err


def test_a_setting_that_makes_no_sense_is_one_line(urquhart: Urquhart, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URQUHART_LIMITS__PAGE_DEFAULT", "0")
    refused(urquhart("db", "upgrade"), "URQUHART_LIMITS__PAGE_DEFAULT")


def test_a_defect_of_ours_is_not_hidden(urquhart: Urquhart, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(path: Path, *_: object) -> None:
        raise OSError(errno.EIO, "without a file")

    monkeypatch.setattr("server.commands.index.read_stem_map", broken)
    with pytest.raises(OSError, match="without a file"):
        urquhart("index", "a.csv", "--collection", "c", "--radius", 1, "--spacing", 1)


def test_an_interruption_is_no_traceback(urquhart: Urquhart, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(path: Path, *_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("server.commands.index.read_stem_map", interrupted)
    said = urquhart("index", "a.csv", "--collection", "c", "--radius", 1, "--spacing", 1)
    assert (said.code, said.out, said.err) == (130, "", "")


# ------------------------------------------------------------------ index


def test_index_stores_discs_and_counts_what_it_left_out(urquhart: Urquhart, tmp_path: Path) -> None:
    options = ["--collection", "stand", "--radius", 30, "--spacing", 40, "--database", "a.db"]
    said = urquhart("index", LONGLEAF, *options)
    assert said.code == 0
    assert "longleaf: 584 trees -> 30 submaps (30 new, 0 replaced, 0 unchanged)" in said.out
    assert "6 grid points skipped (fewer than 10 trees)" in said.out
    assert "0 trees merged with a thicker neighbour within 1 cm" in said.out
    assert "8 trees in no submap" in said.out
    assert "submaps/s" in said.out
    again = urquhart("index", LONGLEAF, *options)
    assert "30 submaps (0 new, 0 replaced, 30 unchanged)" in again.out
    with closing(sqlite3.connect(tmp_path / "a.db")) as connection, connection:
        rows = connection.execute(
            "SELECT id, frame_id, map_frame_id, map_yaw FROM submaps ORDER BY key LIMIT 1"
        ).fetchall()
    assert rows == [("longleaf-0-1", "longleaf-0-1", "longleaf", 0.0)]


def test_index_merges_and_leaves_out_and_says_so(urquhart: Urquhart, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    crowd = rng.uniform(0.0, 20.0, (60, 2))
    write_observation(tmp_path / "plot.csv", np.concatenate([crowd, crowd[:2], [[200.0, 10.0]]]))
    said = urquhart("index", "plot.csv", "--collection", "c", "--radius", 15, "--spacing", 20)
    assert "2 trees merged" in said.out
    assert "1 trees in no submap" in said.out
    assert (tmp_path / "urquhart.db").exists()


def test_index_reports_submaps_that_are_refused(urquhart: Urquhart, tmp_path: Path) -> None:
    rows = [(2.0 * i, float(i)) for i in range(40)]
    write_observation(tmp_path / "row.csv", np.array(rows))
    said = urquhart("index", "row.csv", "--collection", "c", "--radius", 100, "--spacing", 200)
    assert said.code == 0
    assert "1 submaps refused, the first:" in said.out
    assert "line" in said.out


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (None, ["none.csv"], ["none.csv: no such file"]),
        (None, ["."], ["is a directory"]),
        ("x,z\n1,2\n", ["plot.csv"], ["plot.csv:1:", "y_m"]),
        ("x,y\n1,2\n3,oak\n", ["plot.csv"], ["plot.csv:3:", "not a number"]),
        ("x,y\n1,2\n3,4\n", ["plot.csv"], ["plot.csv: the stem map has 2 trees, and a submap needs at least 10"]),
        ("x,y\n1,2\n3,4\n", ["plot.csv", "--radius", "-1"], ["plot.csv: the radius must be a positive number"]),
        (LONGLEAF.read_text(), ["plot.csv", LONGLEAF, "sub/longleaf.csv"], ["two files are called 'longleaf'"]),
        (LONGLEAF.read_text(), ["plot.csv", "--collection", "a/b"], ["collection 'a/b'", "an id has"]),
        (LONGLEAF.read_text().replace("\n7,", "\na\x07b,"), ["plot.csv"], ["plot.csv: plot: tree value", "control"]),
    ],
)
def test_index_refuses_bad_input_in_one_line(
    urquhart: Urquhart, tmp_path: Path, text: str | None, arguments: list[str], words: list[str]
) -> None:
    if text is not None:
        (tmp_path / "plot.csv").write_text(text)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "longleaf.csv").write_text(LONGLEAF.read_text())
    options = ["--collection", "c", "--radius", "30", "--spacing", "40"]
    said = urquhart("index", *options, *arguments)
    refused(said, *words)


def test_a_file_whose_name_cannot_be_an_id_is_refused(urquhart: Urquhart, tmp_path: Path) -> None:
    (tmp_path / "plot 7.csv").write_text(LONGLEAF.read_text())
    refused(urquhart("index", "plot 7.csv", "--collection", "c", "--radius", 30, "--spacing", 40), "rename it")
    assert not (tmp_path / "urquhart.db").exists()


# ----------------------------------------------------------------- locate


def test_locate_finds_the_place(urquhart: Urquhart, indexed: Path, observation: Path) -> None:
    said = urquhart("locate", observation, "--collection", "stand", "--database", indexed, "--seed", 1)
    assert said.code == 0
    assert said.out.startswith("matched (verified)")
    assert "pose in longleaf: x 10" in said.out
    assert "one sigma" in said.out
    assert "inliers: " in said.out
    assert "log odds" in said.out


def test_locate_tells_whole_names_and_poses_whatever_the_width(
    urquhart: Urquhart, indexed: Path, observation: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wide = urquhart("locate", observation, "--collection", "stand", "--database", indexed, "--seed", 1).out
    assert " longleaf-2-2 " in wide
    monkeypatch.setenv("COLUMNS", "80")
    assert urquhart("locate", observation, "--collection", "stand", "--database", indexed, "--seed", 1).out == wide
    monkeypatch.setenv("FORCE_COLOR", "1")  # as on a terminal
    narrow = urquhart("locate", observation, "--collection", "stand", "--database", indexed, "--seed", 1).out
    assert "longleaf-2-2" in narrow


def test_locate_tells_all_as_json_and_draws(
    urquhart: Urquhart, indexed: Path, observation: Path, tmp_path: Path
) -> None:
    said = urquhart(
        "locate",
        observation,
        "--collection",
        "stand",
        "--database",
        indexed,
        "--json",
        "--svg",
        "match.svg",
        "--limit",
        3,
    )
    assert said.code == 0
    assert said.err == ("seen.csv: read tree_id from 'tree_id', x_m from 'x_m', y_m from 'y_m'\ndrawn: match.svg\n")
    answer = json.loads(said.out)
    assert answer["verdict"] == "matched"
    assert 1 <= len(answer["candidates"]) <= 3
    best = answer["candidates"][0]
    pose = best["map_pose"]
    assert pose["frame_id"] == "longleaf"
    metres, radians = SE2(pose["x"], pose["y"], pose["yaw"]).distance(POSE)
    assert metres < 0.5
    assert math.degrees(radians) < 1.0
    assert best["inliers"][0]["query"].startswith("q")
    assert ElementTree.fromstring((tmp_path / "match.svg").read_text()).tag.endswith("svg")


def test_locate_ends_well_whatever_the_verdict(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> None:
    for points in (np.empty((0, 2)), np.array([[0.0, 0.0], [3.0, 4.0]])):
        file = write_observation(tmp_path / "few.csv", points)
        said = urquhart("locate", file, "--collection", "stand", "--database", indexed, "--svg", "few.svg")
        assert (said.code, REASONS["too_few_landmarks"] in said.out) == (0, True)
        assert said.out.startswith("no_match (too_few_landmarks)")
        assert "nothing to draw" in said.out
    assert not (tmp_path / "few.svg").exists()
    other = write_observation(tmp_path / "other.csv", np.random.default_rng(3).uniform(-40, 40, (60, 2)))
    said = urquhart("locate", other, "--collection", "stand", "--database", indexed)
    assert said.code == 0
    assert said.out.startswith("no_match")


def test_trees_at_one_place_are_one_tree_and_told(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> None:
    twice = write_observation(tmp_path / "twice.csv", np.array([[0, 0], [1, 1], [1, 1], [5, 2.0]]))
    said = urquhart("locate", twice, "--collection", "stand", "--database", indexed)
    assert "no_match (" in said.out
    assert ", 3 trees" in said.out
    assert "1 trees merged with a thicker neighbour within 1 cm" in said.out


def test_locate_refuses_bad_input_in_one_line(
    urquhart: Urquhart, indexed: Path, observation: Path, tmp_path: Path
) -> None:
    known = ["--collection", "stand", "--database", indexed]
    refused(urquhart("locate", "none.csv", *known), "none.csv: no such file")
    refused(urquhart("locate", observation, "--collection", "moon", "--database", indexed), "no collection 'moon'")
    refused(
        urquhart("locate", observation, "--collection", "stand", "--database", "none.db"), "none.db: no such database"
    )
    assert not (tmp_path / "none.db").exists()
    refused(urquhart("locate", observation, *known, "--limit", 1000), "at most")
    refused(urquhart("locate", observation, *known, "--min-confidence", 1), "must be below 1, not 1.0 (see urquhart")
    refused(urquhart("locate", observation, *known, "--svg", tmp_path), str(tmp_path), "directory")
    (tmp_path / "long.csv").write_text(f"id,x,y\n{'a' * 200},1,2\n")
    refused(urquhart("locate", "long.csv", *known), "long.csv: tree value")


def test_it_may_be_given_up_while_it_is_loaded() -> None:
    """Ctrl-C in the first second, before anything of the command is there."""
    loading = """
import sys
from server.__main__ import main

class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == "server.cli":
            raise KeyboardInterrupt
        return None

sys.meta_path.insert(0, Interrupted())
main()
"""
    done = subprocess.run([sys.executable, "-c", loading], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
