"""A process that is killed while it applies a map leaves all poses or none."""

import os
from pathlib import Path

import orjson

from tests.server.forked import Forked
from tests.server.maps.kill_applying import NAMES

ROOT = Path(__file__).parents[3]


def test_a_process_killed_while_it_applies_a_map_leaves_all_poses_or_none(tmp_path: Path) -> None:
    output, errors = tmp_path / "told", tmp_path / "errors"
    arguments = [str(tmp_path / "runs")]
    killed = Forked(
        "tests.server.maps.kill_applying", arguments, folder=ROOT, environment=os.environ, output=output, errors=errors
    )
    assert killed.wait(120.0) == 0, errors.read_text()
    told = [tuple(orjson.loads(line)) for line in output.read_bytes().splitlines()]
    before, after = (len(NAMES), 0), (len(NAMES) + 1, len(NAMES))
    states = [(revision, placed) for _, revision, placed in told]
    assert states == sorted(states) and set(states) == {before, after}
    commit = next(number for number, (kind, *_) in enumerate(told) if kind == "after do_commit")
    assert commit > 4 and states[commit - 1 : commit + 1] == [before, after]
    assert told[-1][0] == "done"
