"""A process that is killed at any point loses nothing that it acknowledged."""

import json
from pathlib import Path

from benchmarks.crashes import Expected, changed, main, run


def test_a_few_kills(tmp_path: Path) -> None:
    report = run(tmp_path, 4, seed=3)
    assert report.problems == []
    assert report.rounds == 4
    assert report.writes > 4


def test_the_command() -> None:
    assert main(["--rounds", "1"]) == 0


def test_what_is_expected_is_read_off_the_journal(tmp_path: Path) -> None:
    journal, expected = tmp_path / "journal", Expected({"c": 9})
    lines = [
        ["begin", {"a": 1}],
        ["done", {"a": 1}],
        ["begin", {"a": None}],
        ["done", {"a": None}],
        ["begin", {"b": 2}],
    ]
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines) + '["done", {"b"')
    expected.read(journal)
    assert (expected.submaps, expected.under_way) == ({"c": 9}, {"b": 2})
    assert changed({"a": 1, "b": 2}, {"a": None, "c": 3}) == {"b": 2, "c": 3}
