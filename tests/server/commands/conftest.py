"""Fixtures of the command line's tests."""

from pathlib import Path

import numpy as np
import pytest

from server.cli import run
from server.stem_maps.reader import read_stem_map
from tests.server.commands.cli_helpers import LONGLEAF, POSE, write_observation
from urquhart.evaluation.simulation import Sensor, observe


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
