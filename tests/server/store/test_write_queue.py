"""Short write transactions share a commit, and neither a failure nor a lost one of them is hidden."""

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import event

from server.errors import StorageBusy, StorageError, StorageFull
from server.store.sqlite import write_queue
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.store.storage import WriteTransaction

Work = Callable[[WriteTransaction], object]


class QueuedWriters:
    """Threads that write. The first one holds its transaction open until the others are in the queue."""

    def __init__(self, path: Path) -> None:
        self.database = Database(path, busy_timeout=30.0)
        migrations_runner.upgrade(self.database)
        self.commits = 0
        event.listen(self.database.engine, "commit", self._count)
        self.pool = ThreadPoolExecutor(8)

    def _count(self, _: object) -> None:
        self.commits += 1

    def together(self, *work: Work, shares: bool = True) -> list["Future[None]"]:
        """Do the work, each in a transaction of its own, in this order; `shares` is for the last one."""
        self.commits, go = 0, threading.Event()

        def first(tx: WriteTransaction) -> None:
            begun.set()
            go.wait(30.0)
            work[0](tx)

        begun, done = threading.Event(), []
        for number, one in enumerate((first, *work[1:])):
            done.append(self.pool.submit(self._write, one, shares=shares or number < len(work) - 1))
            begun.wait(30.0)
            while len(self.database._writers._waiting) < number:
                time.sleep(0.001)
        go.set()
        for future in done:
            future.exception(30.0)
        return done

    def _write(self, work: Work, *, shares: bool) -> None:
        with self.database.write(shares=shares) as tx:
            work(tx)

    def names(self) -> set[str]:
        with self.database.read() as tx:
            return set(tx.collections.ids())


@pytest.fixture
def writers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[QueuedWriters]:
    monkeypatch.setattr(write_queue, "_LONGEST", 60.0)  # a test may be slow
    found = QueuedWriters(tmp_path / "many.db")
    yield found
    found.pool.shutdown()
    found.database.dispose()


def create(name: str) -> Work:
    return lambda tx: tx.collections.create(name, title=None, config={}, fingerprint="f", crs=None, origin=None)


def broken(tx: WriteTransaction) -> None:
    create("broken")(tx)
    raise KeyError("mine")


def rolled_back(tx: WriteTransaction) -> None:
    """As SQLite does by itself after some errors of the disk."""
    tx._connection.connection.cursor().execute("ROLLBACK")
    error = sqlite3.OperationalError("database or disk is full")
    error.sqlite_errorcode = sqlite3.SQLITE_FULL
    raise error


def test_transactions_that_wait_for_each_other_have_one_commit(writers: QueuedWriters) -> None:
    for one in writers.together(create("a"), create("b"), create("c")):
        one.result()
    assert writers.commits == 1
    assert writers.names() == {"a", "b", "c"}


@pytest.mark.parametrize("place", [0, 1, 2])
def test_what_one_of_them_raises_undoes_nothing_of_the_others(writers: QueuedWriters, place: int) -> None:
    work = [create("a"), create("b")]
    work.insert(place, broken)
    done = writers.together(*work)
    with pytest.raises(KeyError, match="mine"):
        done.pop(place).result()
    assert [one.result() for one in done] == [None, None]
    assert writers.names() == {"a", "b"}


def test_none_is_told_that_it_is_stored_before_the_commit(writers: QueuedWriters) -> None:
    seen = []

    def last(tx: WriteTransaction) -> None:
        create("c")(tx)
        seen.append((writers.commits, writers.names()))

    done = writers.together(create("a"), create("b"), last)
    assert [one.result() for one in done] == [None] * 3
    assert seen == [(0, set())]


def test_a_failed_commit_is_told_to_each_of_them(writers: QueuedWriters) -> None:
    with failing_commits(writers.database):
        done = writers.together(create("a"), broken, create("c"))
    for one in (done[0], done[2]):
        with pytest.raises(StorageFull):
            one.result()
    with pytest.raises(KeyError, match="mine"):
        done[1].result()
    assert writers.names() == set()
    assert writers.together(create("a"))[0].result() is None


@contextmanager
def failing_commits(database: Database) -> Iterator[None]:
    def fail(_: object) -> None:
        error = sqlite3.OperationalError("database or disk is full")
        error.sqlite_errorcode = sqlite3.SQLITE_FULL
        raise error

    event.listen(database.engine, "commit", fail)
    try:
        yield
    finally:
        event.remove(database.engine, "commit", fail)


def test_what_sqlite_undid_by_itself_is_acknowledged_to_nobody(writers: QueuedWriters) -> None:
    done = writers.together(create("a"), rolled_back, create("c"))
    for one in done[:2]:
        with pytest.raises(StorageFull):
            one.result()
    assert done[2].result() is None
    assert writers.names() == {"c"}


def test_a_lost_transaction_is_no_success(writers: QueuedWriters) -> None:
    def lost(tx: WriteTransaction) -> None:
        tx._connection.connection.cursor().execute("ROLLBACK")

    with pytest.raises(StorageError):
        writers.together(lost)[0].result()


def test_a_long_transaction_has_a_commit_of_its_own(writers: QueuedWriters) -> None:
    for one in writers.together(create("a"), create("b"), create("long"), shares=False):
        one.result()
    assert writers.commits == 2
    assert writers.names() == {"a", "b", "long"}


def test_one_that_waits_too_long_leaves_the_queue(writers: QueuedWriters) -> None:
    writers.database._writers._patience = 0.02
    with writers.database.write(shares=True) as tx:
        create("a")(tx)
        late = writers.pool.submit(writers._write, create("late"), shares=True)
        with pytest.raises(StorageBusy):
            late.result()
    assert writers.names() == {"a"}
    assert writers.together(create("b"))[0].result() is None
