"""Databases from before the tables were strict: every row is copied, or nothing is changed."""

import errno
import os
import shutil
import sqlite3
import threading
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import orjson
import pytest
from alembic import command
from alembic.script import ScriptDirectory

from server.app import create_app
from server.checks.all_checks import inspect
from server.config.settings import Settings
from server.errors import Conflict, DatabaseNotUpgraded, DomainError, StorageFull
from server.snapshots.restoring import find, restore
from server.store.schema_version import SCHEMA, alembic_config, expected_revision
from server.store.sqlite import database_lock
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.sqlite.upgrade.feature_backfill import bring_up_to_date
from server.store.sqlite.upgrade.old_contents import changes_since
from tests.server.commands.cli_helpers import Urquhart
from tests.server.factories import TestClient, forest, observed
from tests.server.steps import killed_at_every_step
from tests.server.store import older
from urquhart import SE2, Config

PLOTS = "/v1/collections/plots"
MORE = (
    "INSERT INTO api_keys VALUES (3, 'abc', 'robot', zeroblob(32), '[\"read\"]', '[\"*\"]', 5, NULL, 6)",
    "INSERT INTO segments VALUES (9, 1, 'gone', 0, 3, 3, 4096, 7)",
)


def upgraded(path: Path) -> None:
    """Upgrade a database, and prove it sound."""
    database = Database(path, busy_timeout=5.0)
    assert bring_up_to_date(database) is True
    assert (list(inspect(database)), migrations_runner.drift(database)) == ([], [])
    assert migrations_runner.upgrade(database) is False
    database.dispose()


def beside(path: Path) -> list[Path]:
    """What lies beside a database, its lock left out."""
    return sorted(found for found in path.parent.iterdir() if found not in (path, database_lock.lock_path(path)))


def revision_of(path: Path) -> str:
    with closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("SELECT version_num FROM alembic_version").fetchone()[0])


# ------------------------------------------------------------------------------ what is kept


def test_a_database_of_0013_gets_the_tables_of_constraints_in_place(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db", "0011")
    upgraded(path)
    before = older.rows(path)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "DROP TABLE constraints; DROP TABLE searched_submaps; UPDATE alembic_version SET version_num = '0013'"
        )
    there = beside(path)
    upgraded_in_place = Database(path)
    assert migrations_runner.upgrade(upgraded_in_place) is True
    assert (list(inspect(upgraded_in_place)), migrations_runner.drift(upgraded_in_place)) == ([], [])
    upgraded_in_place.dispose()
    assert (older.rows(path), revision_of(path), beside(path)) == (before, expected_revision(), there)


def test_every_row_is_kept_with_its_keys(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db", "0011", *MORE)
    before, content = older.rows(path), path.read_bytes()
    path.chmod(0o640)
    database = Database(path)
    assert migrations_runner.upgrade(database) is True
    database.dispose()
    after = older.rows(path)
    assert after == before
    assert sum(map(len, after.values())) > 20
    assert all(after[table] for table in after)
    (kept,) = beside(path)
    assert kept.name.startswith("old.db.before-upgrade-")
    assert (kept.read_bytes()[100:], revision_of(kept)) == (content[100:], "0011")
    assert path.stat().st_mode & 0o777 == 0o640
    with closing(sqlite3.connect(path)) as connection:
        strict = connection.execute("SELECT name, strict FROM pragma_table_list WHERE schema = 'main'").fetchall()
        assert {name for name, is_strict in strict if not is_strict} == {"alembic_version", "sqlite_schema"} | {
            name for name, _ in strict if name.startswith("sqlite_")
        }


@pytest.mark.parametrize("revision", older.REVISIONS)
def test_a_database_of_any_revision_is_upgraded(tmp_path: Path, revision: str) -> None:
    path = older.make(tmp_path / "old.db", revision)
    before = older.rows(path)
    upgraded(path)
    after = older.rows(path)
    for table in before.keys() - {"collections", "submaps"}:
        kept = [{name: row[name] for name in row if name not in ("worker", "heartbeat")} for row in before[table]]
        assert after[table] == kept, table
    renamed = {"config", "attributes", "etag"} if revision < "0011" else set()
    for table in ("collections", "submaps"):
        for old, new in zip(before[table], after[table], strict=True):
            changed = {name for name in old if old[name] != new[name]}
            assert changed <= (renamed | {"features"} if revision == "0001" else renamed)
    assert len(after["deletions"]) == 1
    stands = {row["stand_key"] for row in after["submaps"]}
    assert stands == ({None} if revision < "0008" else {None, 1})


@pytest.mark.parametrize("revision", ["0001", "0004", "0010", "0011"])
def test_it_answers_as_before(tmp_path: Path, revision: str) -> None:
    path = older.make(tmp_path / "old.db", revision)
    with TestClient(create_app(Settings(database=str(path)))) as client:
        for seed, name in enumerate(["rich", "moved", "plain"]):
            xy, truth = observed(forest(seed, 24, 18.0), 5)
            answer = client.post(f"{PLOTS}/queries", json={"xy": xy}).json()
            best = answer["candidates"][0]
            assert (answer["verdict"], best["submap_id"]) == ("matched", name)
            found = SE2(*(best["transform"][axis] for axis in ("x", "y", "yaw")))
            assert found.distance(truth)[0] < 0.2
        assert client.get(f"{PLOTS}/submaps/rich").json()["properties"] == {"a": [1, None, {"b": "ü"}]}
        stored = client.get(f"{PLOTS}/queries/1").json()
        assert (stored["verdict"], stored["candidates"][0]["submap_id"]) == ("matched", "rich")
        assert client.get(f"{PLOTS}/queries/1/candidates/1/match", headers={"Accept": "image/svg+xml"}).is_success
        # A key that was given out is not given out again, and a submap that is there does not come twice.
        body = {"xy": forest(9, 24, 18.0).tolist()}
        client.put(f"{PLOTS}/submaps/new", json=body).raise_for_status()
        assert client.put(f"{PLOTS}/submaps/new", json=body).json()["outcome"] == "unchanged"
    assert max(row["key"] for row in older.rows(path)["submaps"]) == 9


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({}, {}),
        ({"margin": 0.5, "share": 0.1}, {"lead_per_landmark": 0.5}),
        ({"sweeps": 8}, {"exhaustive_submaps": 8}),
        ({"pairs": 48}, {}),
        ({"gate": 9.5}, {"gate": 9.5}),
    ],
)
def test_configurations_of_the_first_revision(tmp_path: Path, old: dict[str, Any], new: dict[str, Any]) -> None:
    kept = {name: value for name, value in older.CONFIG.items() if name not in ("share", "margin", "sweeps")}
    path = older.make(tmp_path / "old.db", "0001")
    with closing(sqlite3.connect(path)) as connection, connection:
        values = orjson.dumps(older.CONFIG | old).decode()
        connection.execute("UPDATE collections SET config = ?", [values])
    upgraded(path)
    found = [orjson.loads(row["config"]) for row in older.rows(path)["collections"]]
    assert found == [kept | new] * 2
    assert Config.from_dict(found[0]) == Config.from_dict(new)


@pytest.mark.parametrize(
    ("frames", "named"),
    [
        ([None, None], []),
        (["map", None], []),
        (["north", "north"], ["north"]),
        (["north", "south"], []),
        (["map", "north"], []),
        (["north", None], ["north"]),
    ],
)
def test_a_crs_becomes_that_of_the_only_frame(tmp_path: Path, frames: list[str | None], named: list[str]) -> None:
    path = older.make(tmp_path / "old.db", "0008", "DELETE FROM submaps WHERE key NOT IN (1, 2)")
    pose = "map_x = 1, map_y = 1, map_yaw = 0, map_min_x = 0, map_min_y = 0, map_max_x = 9, map_max_y = 9"
    nothing = ", ".join(f"{one.split(' = ')[0]} = NULL" for one in (*pose.split(", "), "map_covariance = "))
    with closing(sqlite3.connect(path)) as connection, connection:
        for key, frame in enumerate(frames, 1):
            values = nothing if frame is None else pose
            connection.execute(f"UPDATE submaps SET map_frame_id = ?, {values} WHERE key = ?", [frame, key])  # noqa: S608
    database = Database(path)
    migrations_runner.upgrade(database)
    database.dispose()
    assert [(row["frame_id"], row["crs"]) for row in older.rows(path)["map_frames"]] == [
        (name, "EPSG:25832") for name in named
    ]


def test_attributes_get_their_units(tmp_path: Path) -> None:
    """Each diameter is the same to the last bit of its features, and the submap the same to whoever puts it again."""
    path = older.make(tmp_path / "old.db", "0010")
    before = older.rows(path)["submaps"][0]
    old = orjson.loads(before["attributes"])
    upgraded(path)
    after = older.rows(path)["submaps"][0]
    new = orjson.loads(after["attributes"])
    assert (list(old), list(new)) == (["dbh", "height", "species"], ["dbh_cm", "height_m", "species"])
    assert new["dbh_cm"] == [None if i == 3 else 15.0 + i for i in range(24)]
    assert (new["height_m"], new["species"]) == (old["height"], old["species"])
    assert after["features"] == before["features"]
    with TestClient(create_app(Settings(database=str(path)))) as client:
        stored = client.get(f"{PLOTS}/submaps/rich").json()
        members = ("frame_id", "session", "stamp", "map_pose", "properties", "landmarks")
        put = client.put(f"{PLOTS}/submaps/rich", json={name: stored[name] for name in members})
        assert put.json()["outcome"] == "unchanged"


def test_diameters_become_centimetres_of_the_same_float32(tmp_path: Path) -> None:
    metres = [0.29, 0.31, 0.305, 0.123456789, 0.57, None, *np.random.default_rng(1).uniform(0.01, 2.0, 500).tolist()]
    metres += [1e300, 1e308]  # as an early version let them in
    with closing(sqlite3.connect(":memory:")) as connection:
        changes_since(connection, "0010")
        packed = connection.execute("SELECT attributes_of_now(?)", [orjson.dumps({"dbh": metres})]).fetchone()[0]
    found = orjson.loads(packed)["dbh_cm"]
    assert found[:6] == [29.0, 31.0, 30.5, 12.3456789, 57.0, None]
    assert found[-1] is None
    for old, new in zip(metres[:-2], found[:-2], strict=True):
        assert (old is None and new is None) or np.float32(new / 100.0) == np.float32(old)


def test_a_snapshot_of_an_older_version_is_restored(tmp_path: Path) -> None:
    source = older.make(tmp_path / "older.db", "0004")
    with closing(sqlite3.connect(source)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    content = source.read_bytes()
    (tmp_path / "new").mkdir()
    path = tmp_path / "new/new.db"
    restore(find(path, str(source)), path)
    assert (source.read_bytes(), beside(path)) == (content, [])
    database = Database(path)
    assert migrations_runner.upgrade(database) is False
    assert list(inspect(database)) == []
    database.dispose()


def test_what_lies_in_the_log_is_upgraded(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db")
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE submaps SET session = 'logged'")
        connection.commit()
        copy = tmp_path / "copy" / "old.db"
        copy.parent.mkdir()
        for ending in ("", "-wal"):
            shutil.copy(f"{path}{ending}", f"{copy}{ending}")
    database = Database(copy)
    migrations_runner.upgrade(database)
    database.dispose()
    assert {row["session"] for row in older.rows(copy)["submaps"]} == {"logged"}


def test_the_command_says_what_it_did(urquhart: Urquhart, tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db", "0001")
    said = urquhart("db", "check", "--database", path)
    assert (said.code, "run `urquhart db upgrade`" in said.out) == (1, True)
    said = urquhart("db", "upgrade", "--database", path)
    assert (said.code, said.err) == (0, "")
    assert said.out == f"{path}: schema {expected_revision()}, features of 7 submaps rebuilt\n"
    assert "nothing to do" in urquhart("db", "upgrade", "--database", path).out
    assert urquhart("db", "check", "--database", path).out.endswith("clean\n")


# --------------------------------------------------------------------------- what is refused


class Bad(NamedTuple):
    """A change that no service makes, and what the refusal says."""

    change: str
    said: str


BAD = (
    Bad("UPDATE submaps SET map_x = NULL WHERE key = 1", "Row 1 of submaps .*whole_map_pose"),
    Bad("UPDATE submaps SET landmark_count = 23 WHERE key = 3", "Row 3 of submaps .*positions_of_every_landmark"),
    Bad("UPDATE submaps SET revision = 'x' WHERE key = 5", "Row 5 of submaps .*cannot store TEXT"),
    Bad("UPDATE submaps SET stand_key = 7 WHERE key = 6", "Row 6 of submaps .*row of stands that is not there"),
    Bad("UPDATE submaps SET stand_key = 1, collection_key = 2 WHERE key = 5", "Row 5 of submaps .*row of stands"),
    Bad("UPDATE collections SET config = '{' WHERE key = 2", "Row 2 of collections .*config_is_json"),
    Bad("UPDATE jobs SET state = 'lost'", "Row 1 of jobs .*known_state"),
    Bad("UPDATE queries SET landmarks = 'text'", "Row 1 of queries .*cannot store TEXT"),
)


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.said.split("*")[-1])
def test_a_row_that_cannot_be_stops_the_upgrade(tmp_path: Path, bad: Bad) -> None:
    path = older.make(tmp_path / "old.db", "0011", bad.change)
    before = older.rows(path)
    database = Database(path)
    with pytest.raises(DatabaseNotUpgraded, match=bad.said):
        migrations_runner.upgrade(database)
    database.dispose()
    assert (older.rows(path), revision_of(path), beside(path)) == (before, "0011", [])


def test_a_row_that_cannot_be_is_one_line(urquhart: Urquhart, tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db", "0011", BAD[0].change)
    for verb in (["db", "upgrade"], ["serve", "--port", "0"]):
        said = urquhart(*verb, "--database", path)
        assert (said.code, said.out) == (2, "")
        (line,) = [line for line in said.err.splitlines() if line.startswith("urquhart: ")]
        assert "Row 1 of submaps cannot be upgraded" in line
        assert "Nothing was changed" in line
    assert revision_of(path) == "0011"


def test_nobody_may_have_it_open(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db")
    database = Database(path, busy_timeout=0.1)
    held = database_lock.share(path, 1.0)
    assert held is not None
    with pytest.raises(Conflict, match="stop the service"):
        migrations_runner.upgrade(database)
    database_lock.release(held)
    with closing(sqlite3.connect(path)) as other:  # a program that knows nothing of the lock
        other.execute("SELECT count(*) FROM submaps").fetchone()
        with pytest.raises(Conflict, match="another program"):
            migrations_runner.upgrade(database)
    database.dispose()
    upgraded(path)


def test_what_may_not_be_written_is_not_upgraded(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db")
    database = Database(path, read_only=True)
    with pytest.raises(DatabaseNotUpgraded, match="read-only"):
        migrations_runner.upgrade(database)
    database.dispose()
    assert revision_of(path) == "0011"


# ---------------------------------------------------------------------------- interruption


def test_several_processes_may_upgrade_at_once(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db")
    before = older.rows(path)
    databases, done = [Database(path) for _ in range(4)], list[bool]()
    threads = [
        threading.Thread(target=lambda one=one: done.append(migrations_runner.upgrade(one))) for one in databases
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for database in databases:
        database.dispose()
    assert len(done) == 4
    assert any(done)
    assert (older.rows(path), len(beside(path))) == (before, 1)


def test_killed_at_any_step(tmp_path: Path) -> None:
    path = older.make(tmp_path / "old.db")
    before, content, seen = older.rows(path), path.read_bytes(), set()

    def upgrade() -> None:
        migrations_runner.upgrade(Database(path))

    for _ in killed_at_every_step(upgrade):
        found = revision_of(path)
        seen.add(found)
        assert older.rows(path) == before
        database = Database(path)
        migrations_runner.upgrade(database)
        database.dispose()
        assert (older.rows(path), revision_of(path)) == (before, expected_revision())
        for left in beside(path):
            if left.is_dir():  # killed while it was removed; whatever replaces the file next does it
                assert (left.name, found) == ("old.db.upgrading", expected_revision())
                shutil.rmtree(left)
                continue
            assert left.name.startswith("old.db.before-upgrade-")
            assert (older.rows(left), left.stat().st_nlink) == (before, 1)
            left.unlink()
        path.write_bytes(content)
    assert seen == {"0011", expected_revision()}


@pytest.mark.parametrize("place", ["fsync", "link", "replace"])
def test_a_full_disk_leaves_the_old_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    path = older.make(tmp_path / "old.db")
    before = older.rows(path)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    database = Database(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, place, full)
        with pytest.raises(StorageFull):
            migrations_runner.upgrade(database)
    assert (older.rows(path), revision_of(path)) == (before, "0011")
    migrations_runner.upgrade(database)
    database.dispose()
    assert (older.rows(path), revision_of(path)) == (before, expected_revision())


def test_a_disk_without_room_is_seen_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = older.make(tmp_path / "old.db")
    database = Database(path)
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=100_000))
    with pytest.raises(StorageFull, match="bytes, but 100,000 are free"):
        migrations_runner.upgrade(database)
    database.dispose()
    assert (revision_of(path), beside(path)) == ("0011", [])


def test_a_folder_that_may_not_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = older.make(tmp_path / "old.db")

    def forbidden(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    database = Database(path)
    monkeypatch.setattr(Path, "mkdir", forbidden)
    with pytest.raises(DomainError, match="cannot be written"):
        migrations_runner.upgrade(database)
    database.dispose()
    assert revision_of(path) == "0011"


def test_later_schemas_are_changed_in_place(tmp_path: Path) -> None:
    database = Database(tmp_path / "forest.db")
    migrations_runner.claim(database)
    database.use_wal()
    with database.write_connection() as connection:
        command.upgrade(alembic_config(connection), "0012")
        connection.exec_driver_sql(
            "INSERT INTO collections VALUES (1, 'c', NULL, '{}', 'f', NULL, NULL, NULL, 1, 0, 0, 0, 0, 0, 0, 0)"
        )
        connection.exec_driver_sql("INSERT INTO stands VALUES (1, 1, 'plot', 'plot', 'a', 'b', 30, 20, 15, 0, 0)")
    database.dispose()
    assert migrations_runner.upgrade(database)
    assert not migrations_runner.upgrade(database)
    with database.read() as tx:
        stand = tx.stands(1).counted("plot")
        assert stand is not None
        assert (stand.tree_count, stand.radius, stand.crs, stand.submap_count) == (30, 20.0, None, 0)
    assert migrations_runner.drift(database) == []
    database.dispose()
    assert [path.name for path in tmp_path.iterdir() if "before-upgrade" in path.name] == []


def test_the_newest_revision_is_what_alembic_finds() -> None:
    assert ScriptDirectory.from_config(alembic_config()).get_current_head() == SCHEMA
