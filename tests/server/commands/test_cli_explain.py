"""`locate` with stem diameters, rivals, and the reasons for its answer."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, POSE, Urquhart, refused, write_observation
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, plantation
from urquhart.report.explanation import REASONS, UNREFUSED


def test_locate_asks_with_the_diameters_of_the_file(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> None:
    stand = read_stem_map(LONGLEAF)
    assert stand.dbh_cm is not None
    seen = observe(stand.xy, POSE, Sensor(40.0, sigma=0.1, detection=0.95), np.random.default_rng(5))
    known = ["--collection", "stand", "--database", indexed, "--json"]
    write_observation(tmp_path / "plain.csv", seen.xy)
    write_observation(tmp_path / "measured.csv", seen.xy, stand.dbh_cm[seen.trees])
    plain, measured = (
        json.loads(urquhart("locate", name, *known).out)["candidates"][0] for name in ("plain.csv", "measured.csv")
    )
    assert measured["submap_id"] == plain["submap_id"]
    assert measured["evidence"] > plain["evidence"] + 10.0
    write_observation(tmp_path / "wide.csv", seen.xy, np.full(len(seen.xy), 2e6))
    refused(urquhart("locate", "wide.csv", *known), "the median of the column 'dbh_cm' is 2e+06 cm", "--dbh-unit")


def test_locate_explains(urquhart: Urquhart, indexed: Path, observation: Path, tmp_path: Path) -> None:
    known = ["--collection", "stand", "--database", indexed]
    said = urquhart("locate", observation, *known, "--explain", "--explain-svg", "why.svg")
    assert (said.code, said.err) == (0, "")
    for words in (REASONS["verified"], "describe", "landmarks", "verify quads", UNREFUSED, "drawn: why.svg"):
        assert words in said.out
    drawing = ElementTree.fromstring((tmp_path / "why.svg").read_text())
    assert any(text.text == "seen: matched" for text in drawing.iter())
    told = urquhart("locate", observation, *known, "--explain", "--json")
    assert json.loads(told.out)["findings"]
    assert json.loads(urquhart("locate", observation, *known, "--json").out)["findings"] is None
    refused(urquhart("locate", observation, *known, "--explain-svg", tmp_path), str(tmp_path), "directory")


def test_locate_explains_a_no(urquhart: Urquhart, indexed: Path, tmp_path: Path) -> None:
    known = ["--collection", "stand", "--database", indexed, "--explain", "--explain-svg", "why.svg"]
    write_observation(tmp_path / "none.csv", np.empty((0, 2)))
    said = urquhart("locate", "none.csv", *known)
    assert (said.code, REASONS["too_few_landmarks"] in said.out) == (0, True)
    write_observation(tmp_path / "other.csv", np.random.default_rng(3).uniform(-40, 40, (150, 2)))
    said = urquhart("locate", "other.csv", *known)
    assert said.out.startswith("no_match")
    assert REASONS["verification_failed"] in said.out
    assert (tmp_path / "why.svg").exists()


def test_locate_tells_the_rivals_of_an_ambiguous_answer(urquhart: Urquhart, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    rows = plantation(90.0, 90.0, rng, jitter=0.05, survival=0.97)
    write_observation(tmp_path / "rows.csv", observe(rows, SE2(45.0, 45.0, 0.3), Sensor(20.0, sigma=0.1), rng).xy)
    write_observation(tmp_path / "seen.csv", observe(rows, SE2(46.0, 47.0, -2.0), Sensor(20.0, sigma=0.1), rng).xy)
    assert urquhart("index", "rows.csv", "--collection", "c", "--radius", 30, "--spacing", 100).code == 0
    said = urquhart("locate", "seen.csv", "--collection", "c", "--explain")
    assert said.out.startswith("ambiguous (rival_too_close)")
    assert "\npossible place: " in said.out and "places about equally well" in said.out
    assert REASONS["rival_too_close"] in said.out
    assert "lead over the best other pose: " in said.out
