"""Commands load what they work with, and nothing else."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import typer

from server.commands.loading import COMMANDS
from tests.server.commands.cli_helpers import Urquhart

ROOT = Path(__file__).parents[3]
HEAVY = {
    "numpy",
    "numba",
    "scipy",
    "faiss",
    "pyproj",
    "sqlalchemy",
    "alembic",
    "fastapi",
    "uvicorn",
    "pydantic_settings",
}


def loaded_by(*arguments: str) -> set[str]:
    """The heavy packages that are loaded when a command has ended."""
    code = (
        "import sys; from server.cli import run; assert run(sys.argv[1:]) == 0; "
        "print('loaded:', *{name.partition('.')[0] for name in sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return HEAVY & set(done.stdout.rpartition("loaded:")[2].split())


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["demo", "--help"]])
def test_version_and_help_load_no_part_of_the_service(arguments: list[str]) -> None:
    assert loaded_by(*arguments) == set()


def test_keys_are_listed_without_what_a_service_needs(tmp_path: Path, urquhart: Urquhart) -> None:
    database = str(tmp_path / "forest.db")
    assert urquhart("db", "upgrade", "--database", database).code == 0
    assert loaded_by("keys", "list", "--database", database) == {"pydantic_settings"}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_says_of_itself(name: str) -> None:
    entry = COMMANDS[name]
    command = getattr(import_module(entry.module), entry.attribute)
    whole = command.info.help if isinstance(command, typer.Typer) else command.__doc__
    assert whole is not None
    assert " ".join(whole.split("\n\n")[0].split()) == entry.summary
