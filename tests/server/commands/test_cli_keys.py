"""`urquhart keys`."""

import re
from pathlib import Path

import pytest

from tests.server.commands.cli_helpers import Urquhart, refused


def test_a_key_from_its_making_to_its_end(urquhart: Urquhart) -> None:
    urquhart("db", "upgrade")
    assert "no keys" in urquhart("keys", "list").out
    said = urquhart("keys", "create", "robot 2", "--scope", "read", "--scope", "write", "--collections", "plots-*")
    assert (said.code, said.err.count("\n")) == (0, 1)
    match = re.fullmatch(r"urq_([A-Za-z0-9]{8})_[A-Za-z0-9]{43}\n", said.out)
    assert match is not None
    urquhart("keys", "create", "survey", "--scope", "admin", "--expires", "90d")
    listed = urquhart("keys", "list").out
    assert said.out.strip() not in listed
    assert re.search(rf"{match[1]} +robot 2 +read, write +plots-\* +\S+ +never +usable", listed)
    assert re.search(r"survey +admin +\* +\S+ +20\d\d-\d\d-\d\d \d\d:\d\d +usable", listed)
    assert urquhart("keys", "revoke", match[1]).out == f"key {match[1]} revoked\n"
    assert re.search(rf"{match[1]} .*revoked", urquhart("keys", "list").out)
    refused(urquhart("keys", "revoke", match[1]), "was revoked")


def test_looking_at_keys_makes_no_database(urquhart: Urquhart, tmp_path: Path) -> None:
    for arguments in (["list"], ["revoke", "Ab3dE6gH"]):
        refused(urquhart("keys", *arguments, "--database", tmp_path / "mistyped.db"), "no such database")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["create", "x"], "scope"),
        (["create", "x", "--scope", "all"], "all"),
        (["create", " ", "--scope", "read"], "name"),
        (["create", "x", "--scope", "read", "--collections", "a/*"], "pattern"),
        (["create", "x", "--scope", "read", "--expires", "soon"], "soon"),
        (["create", "x", "--scope", "read", "--expires", "2020-01-01"], "is in the past"),
        (["create", "x", "--scope", "read", "--expires", "9999999w"], "9999999w"),
        (["revoke", "nobody"], "nobody"),
    ],
)
def test_what_cannot_be(urquhart: Urquhart, arguments: list[str], said: str) -> None:
    urquhart("db", "upgrade")
    refused(urquhart("keys", *arguments), said)
