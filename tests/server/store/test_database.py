"""The file: versions, and what happens when it is another's, newer, full, read-only, busy or damaged."""

import re
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import alembic.op
import pytest
from fastapi import FastAPI
from sqlalchemy import create_engine, event

from server.app import create_app
from server.checks.database import discrepancies
from server.collections import crud
from server.config.settings import Limits, Settings
from server.errors import (
    DatabaseNotUpgraded,
    DatabaseTooNew,
    NotADatabase,
    StorageBusy,
    StorageDamaged,
    StorageFull,
    StorageReadOnly,
    StorageUnavailable,
)
from server.schemas.collections import CollectionPut
from server.schemas.submaps import NamedSubmap, SubmapInput
from server.service_parts import Service
from server.store.schema_version import expected_revision
from server.store.sqlite.database import Database
from server.store.sqlite.file_checks import schema_of
from server.store.sqlite.upgrade import migrations_runner
from server.store.tables import CollectionRow
from server.submaps import bulk_ingest, writes
from tests.server.factories import Client, TestClient, forest, points, put_submap


def test_migrations_make_what_the_tables_declare(tmp_path: Path) -> None:
    database = Database(tmp_path / "new.db")
    assert migrations_runner.upgrade(database) is True
    assert migrations_runner.upgrade(database) is False
    assert migrations_runner.current_revision(database) == expected_revision()
    assert migrations_runner.drift(database) == []
    with database.read_connection() as connection:
        made = schema_of(connection)
    with create_engine("sqlite://").begin() as connection:
        CollectionRow.metadata.create_all(connection)
        declared = schema_of(connection)
    assert {name: spelled(sql) for name, sql in made.items() if name != "alembic_version"} == {
        name: spelled(sql) for name, sql in declared.items()
    }
    assert list(discrepancies(database)) == []
    database.dispose()


def spelled(statement: str) -> str:
    """A statement without what means nothing in it: quotes around names, spaces, the ends of lines."""
    return re.sub(r"\s*([(),])\s*|\s+", lambda found: found[1] or " ", statement.replace('"', "")).strip()


def test_what_differs_from_the_migrations_is_named(database: Database) -> None:
    with database.write_connection() as connection:
        connection.exec_driver_sql("DROP INDEX ix_submaps_width")
        connection.exec_driver_sql("CREATE TABLE birds (name TEXT)")
        connection.exec_driver_sql("DROP TABLE map_frames")
        connection.exec_driver_sql("CREATE TABLE map_frames (frame_id TEXT)")
    assert migrations_runner.drift(database) == [
        "birds is not known",
        "ix_submaps_width is missing",
        "map_frames is another",
    ]


def test_a_failed_upgrade_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = Database(tmp_path / "new.db")
    statements = iter(range(5, -1, -1))
    execute = alembic.op.execute
    monkeypatch.setattr("alembic.op.execute", lambda statement: execute(statement) or 1 / next(statements))
    with pytest.raises(ZeroDivisionError):
        migrations_runner.upgrade(database)
    monkeypatch.undo()
    with closing(sqlite3.connect(database.path)) as connection, connection:
        assert connection.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
    connection.close()
    assert migrations_runner.upgrade(database) is True
    database.dispose()


def test_several_processes_may_upgrade_at_once(tmp_path: Path) -> None:
    databases = [Database(tmp_path / "new.db") for _ in range(4)]
    done: list[bool] = []
    threads = [
        threading.Thread(target=lambda one=one: done.append(migrations_runner.upgrade(one))) for one in databases
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(done) == [False, False, False, True]
    for database in databases:
        database.dispose()


def test_an_older_sqlite_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 34, 1))
    with pytest.raises(StorageUnavailable, match=r"3\.37 or newer"):
        Database(tmp_path / "new.db")


def test_pragmas(database: Database) -> None:
    with database.read_connection() as connection:
        values = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "foreign_keys", "synchronous", "busy_timeout")
        }
    assert values == {"journal_mode": "wal", "foreign_keys": 1, "synchronous": 2, "busy_timeout": 2000}


def test_a_newer_database_is_refused_and_left_alone(database: Database) -> None:
    with database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    database.dispose()
    before = database.path.read_bytes()
    with pytest.raises(DatabaseTooNew, match="newer version"):
        migrations_runner.upgrade(database)
    with pytest.raises(DatabaseTooNew), TestClient(create_app(Settings(database=str(database.path)))):
        raise AssertionError("started")
    database.dispose()
    assert database.path.read_bytes() == before


@pytest.mark.parametrize("content", [b"x_m,y_m\n1,2\n" * 100, b"SQLite format 3\x00" + b"\x99" * 2000])
def test_what_is_not_a_database_is_refused_and_left_alone(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "trees.csv"
    path.write_bytes(content)
    database = Database(path)
    with pytest.raises(NotADatabase, match="not a SQLite database"):
        migrations_runner.upgrade(database)
    database.dispose()
    assert path.read_bytes() == content


def test_a_database_of_something_else_is_refused(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "other.db")) as connection, connection:
        connection.execute("CREATE TABLE birds (name)")
    connection.close()
    before = (tmp_path / "other.db").read_bytes()
    database = Database(tmp_path / "other.db")
    with pytest.raises(NotADatabase, match="birds"):
        migrations_runner.upgrade(database)
    database.dispose()
    assert (tmp_path / "other.db").read_bytes() == before


def test_a_copy_that_lost_its_journal_mode_gets_it_back(database: Database, tmp_path: Path) -> None:
    with closing(sqlite3.connect(database.path)) as connection:
        connection.execute("VACUUM INTO ?", [str(tmp_path / "copy.db")])
    copy = Database(tmp_path / "copy.db")
    assert migrations_runner.upgrade(copy) is False
    copy.dispose()
    with closing(sqlite3.connect(copy.path)) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StorageUnavailable, match="folder"):
        migrations_runner.upgrade(Database(tmp_path / "no" / "such" / "file.db"))
    with pytest.raises(StorageUnavailable):
        migrations_runner.upgrade(Database(tmp_path))


def test_read_only_reads_and_asks_but_does_not_write(client: Client, settings: Settings) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    query = {"xy": points(forest(1))}
    read_only = create_app(Settings(database=f"sqlite:///{settings.database}?mode=ro"))
    with TestClient(read_only) as reader:
        assert reader.get("/v1/collections/plots/submaps/p").status_code == 200
        assert reader.post("/v1/collections/plots/queries", json=query).json()["verdict"] == "matched"
        assert put_submap(reader, "plots", "p", 1).json()["outcome"] == "unchanged"
        for response in (
            put_submap(reader, "plots", "q", 2),
            reader.put("/v1/collections/other", json={}),
            reader.delete("/v1/collections/plots/submaps/p"),
            reader.post("/v1/collections/plots/queries", json=query | {"store": True}),
        ):
            assert response.status_code == 503
            assert response.json()["type"] == "/problems/storage-read-only"
            assert "writable" in response.json()["detail"]


def test_read_only_and_old_cannot_be_upgraded(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "empty.db")) as connection, connection:
        connection.execute("PRAGMA user_version = 1")
    connection.close()
    database = Database(tmp_path / "empty.db", read_only=True)
    with pytest.raises((DatabaseNotUpgraded, StorageReadOnly)):
        migrations_runner.upgrade(database)
    database.dispose()


@contextmanager
def full_disk(database: Database) -> Iterator[None]:
    """No page can be added to the file, as on a full disk."""

    def limit(connection: sqlite3.Connection, _: object) -> None:
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
        connection.execute(f"PRAGMA max_page_count = {pages}")

    database.engine.dispose()
    event.listen(database.engine, "connect", limit)
    try:
        yield
    finally:
        event.remove(database.engine, "connect", limit)
        database.engine.dispose()


def test_a_full_disk_refuses_writes_and_keeps_what_is_there(client: Client, app: FastAPI) -> None:
    service: Service = app.state.service
    put_submap(client, "plots", "p", 1).raise_for_status()
    revision = client.get("/v1/collections/plots").json()["revision"]
    with full_disk(service.database):
        statuses = [put_submap(client, "plots", f"q{i}", i + 2).status_code for i in range(20)]
        assert statuses[-1] == 507
        stored = statuses.count(201)
        full = put_submap(client, "plots", "last", 99)
        assert (full.status_code, full.json()["type"]) == (507, "/problems/storage-full")
        assert "Free some space" in full.json()["detail"]
        answer = client.post("/v1/collections/plots/queries", json={"xy": points(forest(1))})
        assert answer.json()["verdict"] == "matched"
        assert client.get("/v1/collections/plots").json()["revision"] == revision + stored
    assert put_submap(client, "plots", "last", 99).status_code == 201
    assert list(discrepancies(service.database)) == []


def test_another_writer_for_too_long_is_busy(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    other = sqlite3.connect(database.path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    quick = Database(database.path, busy_timeout=0.05)
    body = SubmapInput.model_validate({"xy": points(forest(1))})
    with pytest.raises(StorageBusy, match="try again"):
        writes.put(quick, "plots", "p", body, Limits())
    assert crud.read(quick, "plots")[0].counts.submaps == 0
    other.execute("ROLLBACK")
    other.close()
    assert writes.put(quick, "plots", "p", body, Limits()).outcome == "created"
    with quick.write(), pytest.raises(StorageBusy):
        crud.delete(quick, "plots")
    quick.dispose()


def test_damage_is_named(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    for seed in range(20):
        writes.put(database, "plots", f"p{seed}", SubmapInput.model_validate({"xy": points(forest(seed))}), Limits())
    database.dispose()
    content = bytearray(database.path.read_bytes())
    content[4096 * 3 :] = b"\x5a" * (len(content) - 4096 * 3)
    database.path.write_bytes(content)
    with pytest.raises(StorageDamaged, match="db check"), database.read_connection() as connection:
        connection.exec_driver_sql("SELECT count(features) FROM submaps").all()


def test_a_full_disk_is_an_error_of_the_domain(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    bodies = (
        NamedSubmap.model_validate({"id": f"p{seed}", "xy": points(forest(seed)), "properties": {"x": "y" * 9000}})
        for seed in range(40)
    )
    with full_disk(database), pytest.raises(StorageFull):
        list(bulk_ingest.ingest_many(database, "plots", bodies, batch_size=1))
    assert list(discrepancies(database)) == []


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        ("DROP INDEX ix_submaps_footprint", "ix_submaps_footprint"),
        ("UPDATE collections SET config = '{\"colour\": 1}'", "configuration cannot be used"),
        ("INSERT INTO queries VALUES (1, 99, 7, 0, '[]', x'', NULL, CAST('{}' AS BLOB))", "not there"),
        ("INSERT INTO queries VALUES (1, 1, 7, 0, '[]', x'', NULL, CAST('{}' AS BLOB))", "query 7 is stored"),
        ("UPDATE submaps SET counts = '{}'", "the row says {}"),
        ("UPDATE submaps SET landmark_count = 59", "CHECK constraint failed in submaps"),
        ("UPDATE submaps SET landmarks = zeroblob(960)", "the landmarks are not those"),
    ],
)
def test_findings_name_each_kind_of_disagreement(database: Database, statement: str, told: str) -> None:
    crud.ensure(database, "plots", CollectionPut())
    writes.put(database, "plots", "p", SubmapInput.model_validate({"xy": points(forest(1))}), Limits())
    with closing(sqlite3.connect(database.path, isolation_level=None)) as connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        connection.execute(statement)
    assert told in "; ".join(finding.what for finding in discrepancies(database))


def test_text_whose_bytes_are_damaged(database: Database) -> None:
    crud.ensure(database, "plots", CollectionPut())
    with database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE collections SET title = CAST(x'ff70' AS TEXT)")
    with pytest.raises(StorageDamaged, match="db check"):
        list(discrepancies(database))


def test_findings_of_a_database_that_is_not_upgraded(tmp_path: Path) -> None:
    (tmp_path / "empty.db").touch()
    database = Database(tmp_path / "empty.db")
    (finding,) = discrepancies(database)
    assert "urquhart db upgrade" in finding.what
    database.dispose()


def test_a_configuration_of_another_version_is_named(client: Client, service: Service) -> None:
    with service.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE collections SET config = '{\"colour\": 1}'")
    put_submap(client, "plots", "p", 1)
    response = put_submap(client, "plots", "p", 1)
    assert (response.status_code, response.json()["type"]) == (503, "/problems/storage-unavailable")
    assert "colour" in response.json()["detail"]
