"""docs/tutorial.md is true: its commands run one after the other, and print what the page shows."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from tests.server.commands.cli_helpers import Urquhart

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")


def steps() -> list[tuple[list[str], list[str]]]:
    """The words of each `urquhart` command on the page, and the lines that it shows below."""
    found: list[tuple[list[str], list[str]]] = []
    for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((shlex.split(line[2:]), []))
            else:
                found[-1][1].append(line)
    return [(words[1:], shown) for words, shown in found if words[0] == "urquhart"]


def test_the_tutorial_does_what_it_says(urquhart: Urquhart, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.spec_from_file_location("forest_season", ROOT / "examples" / "forest_season.py")
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.write(tmp_path / "tutorial")
    monkeypatch.chdir(tmp_path / "tutorial")
    commands = steps()
    assert [words[0] for words, _ in commands] == ["check", "index", "coregister"]
    for words, shown in commands:
        said = urquhart(*words)
        told = (said.out + said.err).splitlines()
        for line in shown:
            assert any(one.startswith(line.removesuffix("...")) for one in told), (line, told)
    season = tmp_path / "tutorial" / "season"
    assert (season / "report.html").exists()
    images = tmp_path / "images"
    images.mkdir()
    example.main(["--pictures", str(season), str(images)])
    assert {one.name for one in images.iterdir()} == set(re.findall(r"images/([\w-]+\.svg)", PAGE))
    assert all((ROOT / "docs" / "images" / one.name).exists() for one in images.iterdir())
