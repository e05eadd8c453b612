"""The database file is moved, deleted, replaced or cut off under services that write to it; no write is lost."""

import os
import shutil
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import httpx
import pytest

from server.checks.all_checks import inspect
from server.collections import crud
from server.config.settings import Limits
from server.errors import StorageAltered
from server.schemas.collections import CollectionPut
from server.schemas.submaps import SubmapInput
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import writes
from tests.server.factories import forest, points
from tests.server.processes import Server

SUBMAPS = "/v1/collections/plots/submaps"
TREES = points(forest(1, 12, 20.0))
_PATIENCE = 60.0


class Writers:
    """Threads that store submaps through several services, and what these acknowledged."""

    def __init__(self, servers: list[Server]) -> None:
        self.acknowledged: list[str] = []
        self.begun: dict[str, float] = {}
        """When the first byte of each was sent, by the monotonic clock."""
        self.others: list[httpx.Response] = []
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._write, args=(server, f"{i}-{k}"))
            for i, server in enumerate(servers)
            for k in range(3)
        ]
        for thread in self._threads:
            thread.start()

    def more(self, count: int = 8) -> None:
        """Wait until so many more are acknowledged."""
        wanted = len(self.acknowledged) + count
        until(lambda: len(self.acknowledged) >= wanted)

    def refused(self, count: int = 12) -> None:
        """Wait until so many more are refused."""
        wanted = len(self.others) + count
        until(lambda: len(self.others) >= wanted)

    def stop(self) -> None:
        """End them; whatever was not stored was answered with the problem that says so."""
        self._stop.set()
        for thread in self._threads:
            thread.join(_PATIENCE)
        kinds = {(one.status_code, one.json()["type"]) for one in self.others}
        assert kinds <= {(503, "/problems/storage-altered")}, [one.text for one in self.others][:3]

    def _write(self, server: Server, name: str) -> None:
        number = 0
        with httpx.Client(base_url=str(server.client.base_url), timeout=_PATIENCE) as client:
            while not self._stop.is_set():
                number += 1
                self.begun[f"{name}-{number}"] = time.monotonic()
                try:
                    response = client.put(f"{SUBMAPS}/{name}-{number}", json={"xy": TREES})
                except httpx.TransportError:
                    return  # the service is no more; tests that expect it to live go on to ask it
                if response.status_code == 201:
                    self.acknowledged.append(f"{name}-{number}")
                else:
                    self.others.append(response)
                    time.sleep(0.01)


@contextmanager
def writing(*servers: Server) -> Iterator[Writers]:
    writers = Writers(list(servers))
    try:
        writers.more()
        yield writers
    finally:
        writers.stop()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def not_ready(server: Server) -> bool:
    response = server.client.get("/readyz")
    return response.status_code == 503 and response.json()["check"] == "database"


def shut(server: Server) -> None:
    """Nothing is answered from the database."""
    assert not_ready(server)
    for response in (
        server.client.get(SUBMAPS),
        server.client.get("/v1/collections"),
        server.client.get("/v1/jobs"),
        server.client.post("/v1/collections/plots/queries", json={"xy": TREES}),
        server.client.put("/v1/collections/new", json={}),
        server.client.delete("/v1/collections/plots"),
    ):
        assert (response.status_code, response.json()["type"]) == (503, "/problems/storage-altered"), response.text
        assert "stop the service" in response.json()["detail"].lower()
    assert server.client.get("/livez").status_code == 200


def stored(path: Path) -> set[str]:
    """Ids of the submaps in a database that agrees with itself."""
    database = Database(path)
    assert list(inspect(database)) == []
    database.dispose()
    with closing(sqlite3.connect(path)) as connection:
        return {name for (name,) in connection.execute("SELECT id FROM submaps")}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "data").mkdir()
    return tmp_path / "data" / "plots.db"


def start(serve: Callable[..., Server], path: Path, count: int = 1) -> list[Server]:
    servers = [serve(path) for _ in range(count)]
    servers[0].client.put("/v1/collections/plots", json={}).raise_for_status()
    return servers


@pytest.mark.parametrize("beside", [False, True])
def test_a_file_that_is_moved_and_put_back(serve: Callable[..., Server], path: Path, beside: bool) -> None:
    servers = start(serve, path, 2)
    away = path.parent.parent / "away"
    away.mkdir()
    with writing(*servers) as writers:
        for _ in range(2):
            moved = sorted(path.parent.glob("plots.db-*") if beside else []) + [path]
            for one in reversed(moved):
                one.rename(away / one.name)
            until(lambda: all(map(not_ready, servers)))
            writers.refused()
            before = len(writers.acknowledged)
            for server in servers:
                shut(server)
            assert len(writers.acknowledged) == before
            assert not path.exists()
            for one in moved:
                (away / one.name).rename(one)
            until(lambda: all(server.client.get("/readyz").status_code == 200 for server in servers))
            writers.more()
    for server in servers:
        server.kill()
    assert stored(path) >= set(writers.acknowledged)


def test_what_is_in_the_log_is_in_the_file_that_was_moved(serve: Callable[..., Server], path: Path) -> None:
    (server,) = start(serve, path)
    with writing(server) as writers:
        path.rename(path.with_name("moved.db"))
        writers.refused()
    server.kill()
    assert not path.exists()
    assert stored(path.with_name("moved.db")) >= set(writers.acknowledged)


@pytest.mark.parametrize("ending", ["-wal", "-shm"])
def test_a_log_that_is_deleted(serve: Callable[..., Server], path: Path, ending: str) -> None:
    (server,) = start(serve, path)
    with writing(server) as writers:
        path.with_name(f"{path.name}{ending}").unlink()
        writers.refused()
        shut(server)
    server.kill()
    assert stored(path) >= set(writers.acknowledged)


def test_a_file_that_is_deleted_is_not_made_again(serve: Callable[..., Server], path: Path) -> None:
    (server,) = start(serve, path)
    with writing(server) as writers:
        path.unlink()
        writers.refused()
        shut(server)
        assert not path.exists()


def test_another_file_in_its_place(serve: Callable[..., Server], path: Path) -> None:
    """It is not used before a restart, and is not changed meanwhile; the first one goes on where it was put back."""
    (server,) = start(serve, path)
    copy = path.with_name("copy.db")
    with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(copy)) as target:
        source.backup(target)
    content = copy.read_bytes()
    with writing(server) as writers:
        path.rename(path.with_name("moved.db"))
        shutil.copy(copy, path)
        writers.refused()
        shut(server)
        assert path.read_bytes() == content
        path.with_name("moved.db").replace(path)
        writers.more()
    server.kill()
    assert stored(path) >= set(writers.acknowledged)


@pytest.mark.parametrize("how", ["cp", "truncate", "truncate-wal"])
def test_a_file_that_is_written_to_in_place(serve: Callable[..., Server], path: Path, how: str) -> None:
    """What was acknowledged before is the operator's to restore; nothing is acknowledged after it."""
    servers = start(serve, path, 2)
    copy = path.with_name("copy.db")
    with writing(*servers) as writers:
        with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(copy)) as target:
            source.backup(target)
        writers.more()
        match how:
            case "cp":
                subprocess.run(["cp", str(copy), str(path)], check=True)
            case "truncate":
                os.truncate(path, 0)
            case _:
                os.truncate(path.with_name(f"{path.name}-wal"), 0)
        until(lambda: all(map(not_ready, servers)))
        shut_at = time.monotonic()
        writers.refused()
        for server in servers:
            shut(server)
        assert not [name for name in writers.acknowledged if writers.begun[name] > shut_at]


@pytest.mark.parametrize("kept", [0, 0.5])
def test_a_log_that_is_cut_off_and_grows_again(path: Path, kept: float) -> None:
    """A commit at that moment writes behind the end, and the log is as long as its index says, with a hole in it."""
    database = Database(path)
    migrations_runner.upgrade(database)
    log = path.with_name(f"{path.name}-wal")
    size = log.stat().st_size
    assert database.trouble() is None
    os.truncate(log, int(kept * size))
    os.truncate(log, size)
    assert "was cut off" in (database.trouble() or "")
    with pytest.raises(StorageAltered), database.write():
        pass
    database.dispose()


def other_database(folder: Path) -> Path:
    """A database with a submap of its own, in one file."""
    path = folder / "other.db"
    database = Database(path)
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    writes.put(database, "plots", "other", SubmapInput.model_validate({"xy": TREES}), Limits())
    database.dispose()
    assert not log_of(path).exists()
    return path


def log_of(path: Path) -> Path:
    return path.with_name(f"{path.name}-wal")


def set_aside(path: Path) -> list[Path]:
    return sorted(path.parent.glob(f"{path.name}-wal.set-aside-*"))


@pytest.mark.parametrize(
    ("how", "end"), [("mv, then cp", "kill"), ("mv over it", "stop"), ("cp over it", "stop"), ("cp over it", "kill")]
)
def test_the_file_that_is_put_in_place_is_used_as_it_is(
    serve: Callable[..., Server], path: Path, how: str, end: str
) -> None:
    """The log of the file that was there before is not applied to it, and what was acknowledged is not lost."""
    servers = start(serve, path, 2)
    other = other_database(path.parent)
    content, moved, before = other.read_bytes(), path.with_name("moved.db"), path.with_name("before.db")
    with writing(*servers) as writers:
        pass
    assert log_of(path).stat().st_size
    shutil.copy(path, before)
    match how:
        case "mv, then cp":
            path.rename(moved)
            subprocess.run(["cp", str(other), str(path)], check=True)
        case "mv over it":
            moved.hardlink_to(path)
            other.replace(path)
        case _:
            subprocess.run(["cp", str(other), str(path)], check=True)
    # Emptied or set aside as soon as nobody reads from it any more.
    until(lambda: not_ready(servers[0]) and not (log_of(path).exists() and log_of(path).stat().st_size))
    for server in servers:
        if end == "stop":
            server.stop()
        else:
            server.kill()
    assert path.read_bytes() == content
    assert not log_of(path).exists() or not log_of(path).stat().st_size
    assert stored(path) == {"other"}
    if how == "cp over it":
        (aside,) = set_aside(path)
        before.replace(moved)
        shutil.copy(aside, log_of(moved))
    assert stored(moved) >= set(writers.acknowledged)
    again = serve(path)
    assert [one["id"] for one in again.client.get(SUBMAPS).json()["submaps"]] == ["other"]


def test_a_log_that_was_cut_off_is_not_written_into_the_file(serve: Callable[..., Server], path: Path) -> None:
    """The writes that follow leave a hole in it, and nothing of it can be told from what is missing."""
    (server,) = start(serve, path)
    with writing(server) as writers:
        content = path.read_bytes()
        os.truncate(log_of(path), 0)
        writers.refused()
    server.stop()
    assert path.read_bytes() == content
    assert set_aside(path) and not log_of(path).exists()
    assert list(sqlite3.connect(path).execute("PRAGMA integrity_check")) == [("ok",)]


def test_a_file_that_was_only_touched(path: Path) -> None:
    """Nobody can tell from outside; the answer says where the log is, and with it back nothing is missing."""
    database = Database(path)
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    assert database.trouble() is None
    os.utime(path)
    said = database.trouble() or ""
    (aside,) = set_aside(path)
    assert aside.name in said and f"rename that to {log_of(path).name}" in said
    database.dispose()
    aside.rename(log_of(path))
    again = Database(path)
    assert crud.known_collections(again) == ["plots"]
    again.dispose()


def test_who_did_not_see_it_happen_does_not_write_the_log_either(path: Path) -> None:
    """One process looked at the file after its last checkpoint, the other did not, and cannot see that it changed."""
    seeing, idle = Database(path), Database(path)
    for database in (seeing, idle):
        migrations_runner.upgrade(database)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    crud.ensure(seeing, "plots", CollectionPut())
    content = path.read_bytes()
    path.write_bytes(content)
    os.utime(path, ns=(1, 1))
    assert "by something else" in (seeing.trouble() or "")
    assert "by something else" in (idle.trouble() or "")
    seeing.dispose()
    idle.dispose()
    assert path.read_bytes() == content
    assert len(set_aside(path)) == 1


def test_logs_that_are_set_aside_keep_each_other(path: Path) -> None:
    for number in range(1, 12):
        database = Database(path)
        migrations_runner.upgrade(database)
        crud.ensure(database, f"plots{number}", CollectionPut())
        assert database.trouble() is None
        os.utime(path)
        assert f"set-aside-{number} " in (database.trouble() or "")
        database.dispose()
        assert len(set_aside(path)) == number


def test_what_is_read_while_the_file_is_moved_does_not_keep_the_log_full(path: Path) -> None:
    """Where somebody reads an older state, the log cannot be emptied at once; it is when the database is closed."""
    database = Database(path)
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    reader = sqlite3.connect(path, isolation_level=None)
    reader.execute("BEGIN")
    reader.execute("SELECT count(*) FROM collections").fetchone()
    crud.ensure(database, "more", CollectionPut())
    moved = path.with_name("moved.db")
    path.rename(moved)
    assert database.trouble() is not None
    assert log_of(path).stat().st_size
    reader.close()
    database.dispose()
    assert not log_of(path).stat().st_size
    again = Database(moved)
    assert crud.known_collections(again) == ["plots", "more"]
    again.dispose()


def test_a_memory_of_the_log_that_is_cut_off(serve: Callable[..., Server], path: Path) -> None:
    """Whoever reads it at that moment is ended by the system; the log itself has everything."""
    (server,) = start(serve, path)
    with writing(server) as writers:
        os.truncate(path.with_name(f"{path.name}-shm"), 0)
        until(lambda: server.process.poll() is not None or bool(writers.others))
    server.kill()
    assert stored(path) >= set(writers.acknowledged)


def test_a_log_is_not_thrown_away_for_want_of_its_database(path: Path) -> None:
    """SQLite would delete it when it makes the file that is not there."""
    database = Database(path)
    migrations_runner.upgrade(database)
    copy = path.with_name("copy.db")
    shutil.copy(path, copy)
    shutil.copy(f"{path}-wal", f"{copy}-wal")
    database.dispose()
    copy.unlink()
    kept = path.with_name("copy.db-wal").read_bytes()
    assert kept
    with pytest.raises(StorageAltered, match="Put the database back beside it"):
        migrations_runner.upgrade(Database(copy))
    assert path.with_name("copy.db-wal").read_bytes() == kept and not copy.exists()


def test_what_sqlite_does_is_no_alarm(tmp_path: Path) -> None:
    """Checkpoints of every kind, by this process and by others, and files that grow and shrink."""
    path = tmp_path / "busy.db"
    database, reader = Database(path), Database(path, read_only=True)
    migrations_runner.upgrade(database)
    migrations_runner.upgrade(reader)
    script = (
        "import sqlite3,sys\n"
        "c = sqlite3.connect(sys.argv[1], timeout=60, isolation_level=None)\n"
        "for i in range(150):\n"
        "    c.execute('INSERT INTO scratch VALUES (randomblob(5000))')\n"
        "    c.execute('PRAGMA wal_checkpoint(' + ['PASSIVE','FULL','RESTART','TRUNCATE'][i % 4] + ')')\n"
        "c.execute('DELETE FROM scratch'); c.execute('VACUUM'); c.execute('PRAGMA wal_checkpoint(TRUNCATE)')\n"
    )
    with database.write_connection() as connection:
        connection.exec_driver_sql("CREATE TABLE scratch (content BLOB)")
    with subprocess.Popen([sys.executable, "-c", script, str(path)]) as other:
        while other.poll() is None:
            with database.write_connection() as connection:
                connection.exec_driver_sql("INSERT INTO scratch VALUES (randomblob(3000))")
            with reader.read_connection() as connection:
                connection.exec_driver_sql("SELECT count(*) FROM scratch").fetchone()
            assert database.trouble() is None
    assert other.returncode == 0
    assert reader.trouble() is None
    database.dispose()
    reader.dispose()
