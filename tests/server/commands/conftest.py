"""Fixtures of the command line's tests."""

from pathlib import Path

import numpy as np
import pytest

from server.cli import run
from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, POSE, Said, Urquhart, write_observation
from urquhart.evaluation.simulation import Sensor, observe


@pytest.fixture
def urquhart(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Urquhart:
    """Runs the command in a directory of its own, on a wide terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*arguments: object) -> Said:
        capfd.readouterr()
        code = run([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return Said(code, out, err)

    return call


@pytest.fixture(scope="session")
def indexed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with longleaf in the collection `stand`, 40 m discs; not to be changed."""
    path = tmp_path_factory.mktemp("indexed") / "stand.db"
    options = ["--collection", "stand", "--radius", "40", "--spacing", "40", "--database", str(path)]
    assert run(["index", str(LONGLEAF), *options]) == 0
    return path


@pytest.fixture
def observation(tmp_path: Path) -> Path:
    """A noisy observation of longleaf from `POSE`."""
    trees = read_stem_map(LONGLEAF).xy
    seen = observe(trees, POSE, Sensor(40.0, sigma=0.1, detection=0.95), np.random.default_rng(5))
    return write_observation(tmp_path / "seen.csv", seen.xy)
