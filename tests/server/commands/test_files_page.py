"""docs/files.md is true: its tables have the formats, headers and options that the code has."""

import re
from pathlib import Path

from server.commands.loading import COMMANDS
from server.commands.support.file_options import FILE_OPTIONS
from server.stem_maps.formats.files import CLOUD_SUFFIXES, TEXT_SUFFIXES, WORKBOOK_SUFFIXES
from server.stem_maps.formats.vector_files import VECTOR_FORMATS
from server.stem_maps.reading.headers import FAMILIES, FAMILY_UNITS, NAMES, PAIRS
from server.stem_maps.reading.options import KEYS

PAGE = (Path(__file__).parents[3] / "docs" / "files.md").read_text(encoding="utf-8")


def rows(section: str, first: str) -> dict[str, list[str]]:
    """The cells of a table below a heading, by their first cell; `first` is the table's first heading."""
    text = PAGE.split(f"\n## {section}\n")[1].split("\n## ")[0]
    table = text.split(f"| {first} |")[1].split("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[2:]]
    return {row[0].strip(): row[1:] for row in cells}


def test_every_format_is_in_the_table() -> None:
    suffixes = {suffix for row in rows("Formats", "format").values() for suffix in re.findall(r"`(\.\w+)`", row[0])}
    assert suffixes == {*TEXT_SUFFIXES, *WORKBOOK_SUFFIXES, *CLOUD_SUFFIXES, *VECTOR_FORMATS}
    assert {one.name for one in VECTOR_FORMATS.values()} <= rows("Formats", "format").keys()


def test_every_header_is_in_the_table() -> None:
    table = rows("Headers", "column")
    pairs = [tuple(pair.split(", ")) for pair in re.findall(r"`([^`]+)`", table.pop("positions")[0])]
    assert pairs == list(PAIRS)
    assert table.keys() == NAMES.keys()
    for meaning, row in table.items():
        assert re.findall(r"`([^`]+)`", row[0]) == [name for name in NAMES[meaning] if name], meaning
    programs = rows("Headers", "program")
    assert FAMILIES.keys() <= programs.keys()
    assert all(programs[family][1].startswith(unit) for family, unit in FAMILY_UNITS.items())


def test_every_option_is_in_the_table_and_in_the_commands() -> None:
    table = rows("Options", "option")
    assert [row[0].strip("`") for row in table.values()] == list(KEYS) == list(FILE_OPTIONS)
    assert [option.strip("`") for option in table] == [f"--{key.replace('_', '-')}" for key in KEYS]
    for command in ("index", "locate", "check"):
        taken = {name for parameter in COMMANDS[command].load(command).params for name in parameter.opts}
        assert {option.strip("`") for option in table} <= taken
