"""`urquhart keys`."""

import re
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest

from server.security import api_keys
from server.security.principal import Scope
from server.store.sqlite.database import Database
from server.store.sqlite.key_listing import stored_keys
from server.store.sqlite.upgrade import migrations_runner
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


def test_the_short_way_to_the_keys_finds_what_the_usual_one_does(tmp_path: Path) -> None:
    path = tmp_path / "keys.db"
    database = Database(path)
    migrations_runner.upgrade(database)
    database.use_wal()
    later = datetime(2031, 5, 6, 7, 8, 9, 123456, UTC)
    for name, scope, expires in (("robot", Scope.READ, None), ("für später", Scope.ADMIN, later)):
        _, made = api_keys.make(database, name, [scope], ["plots-*", "x"], expires)
    api_keys.revoke(database, made.id)
    listed = list(api_keys.listed(database))
    assert stored_keys(path, read_only=False) == listed, "beside a service, whose log is not folded yet"
    assert path.with_name("keys.db-wal").stat().st_size > 0
    database.dispose()
    assert stored_keys(path, read_only=False) == listed
    assert not path.with_name("keys.db-wal").exists()


def test_what_has_no_keys_of_this_version_is_left_to_the_usual_way(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    assert stored_keys(path, read_only=False) is None
    assert not path.exists()
    path.write_bytes(b"no database at all" * 100)
    assert stored_keys(path, read_only=False) is None
    path.unlink()
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE alembic_version (version_num)")
        other.execute("INSERT INTO alembic_version VALUES ('0001')")
        other.commit()
    assert stored_keys(path, read_only=True) is None


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
