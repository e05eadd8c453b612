"""The SQLite file: connections, transactions, and SQLite's errors in the words of the domain."""

import logging
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Literal, NoReturn

import orjson
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.pool import QueuePool

from server import errors
from server.store.sqlite import database_lock, expressions
from server.store.sqlite.file_guard import FileGuard
from server.store.sqlite.read_connections import ReadConnections
from server.store.sqlite.sqlite_errors import domain_error, storage_errors
from server.store.sqlite.write_queue import WriteQueue
from server.store.storage import ReadTransaction, WriteTransaction

_WRITE = "urquhart_write"
_PIECE = 256  # pages of a copy that are written at once, about a megabyte
_POOL_SIZE = 64  # above the threads that serve requests, so that no request waits for a connection
_OLDEST = (3, 37, 0)
"""The first version of SQLite with strict tables; older ones call a database that has them damaged."""
_log = logging.getLogger(__name__)


class Database:
    """One SQLite file in WAL mode.

    A `Storage`. `read()` gives a transaction with one read view that no writer disturbs; `write()` one that holds the
    write lock from its first statement. Errors of SQLite leave as `errors.StorageError`.

    From `use_wal` to `dispose` the file must stay what it is and where it is: else nothing is read and no write is
    acknowledged, see `file_guard`.
    """

    def __init__(
        self, path: Path | str, *, busy_timeout: float = 10.0, read_only: bool = False, create: bool = True
    ) -> None:
        """Prepare for the file at `path`, which is opened at first use; `busy_timeout` in seconds.

        `create`: `use_wal` makes the file where there is none. Nothing else does.
        """
        if sqlite3.sqlite_version_info < _OLDEST:
            raise errors.StorageUnavailable(
                f"This Python has SQLite {sqlite3.sqlite_version}, and strict tables need 3.37 or newer. Install the "
                "service with a newer Python or a newer SQLite library."
            )
        self.path = Path(path).absolute()
        self.read_only = read_only
        self.busy_timeout = busy_timeout
        # Queueing writers of this process here wakes them at once; SQLite's own waiting polls with growing sleeps.
        self._writers = WriteQueue(self._begin_to_write, busy_timeout)
        self._file_lock: int | None = None
        self._moving_in = threading.Lock()
        self._create = create and not read_only
        self._guard = FileGuard(self.path, read_only=read_only)
        self.engine = self._make_engine()
        self._write_engine = self.engine.execution_options(**{_WRITE: True})
        self._readers = ReadConnections(self.engine)

    def __reduce__(self) -> tuple[Callable[[Path], "Database"], tuple[Path]]:
        """Sent to another process, it is opened there, once however often it is sent."""
        return _opened, (self.path,)

    @contextmanager
    def read(self) -> Iterator[ReadTransaction]:
        """A read transaction: everything read in it is of one revision."""
        with self.read_connection() as connection:
            yield ReadTransaction(connection)

    @contextmanager
    def write(self, *, shares: bool = False) -> Iterator[WriteTransaction]:
        """A write transaction: committed at the end of the block, rolled back by any exception, then durable.

        `shares`: it is short, and may be committed together with others of this process.
        """
        with self.write_connection(shares=shares) as connection:
            yield WriteTransaction(connection)

    @contextmanager
    def write_connection(self, *, shares: bool = False) -> Iterator[Connection]:
        """A connection on a write transaction, for statements about the file and its schema."""
        with self._guarded(), self._writers.transaction(shares=shares) as connection:
            yield connection

    @contextmanager
    def read_connection(self) -> Iterator[Connection]:
        """A connection on a read transaction, for statements about the file and its schema."""
        with self._guarded(writing=False), self._readers.begin() as connection:
            yield connection

    def trouble(self) -> str | None:
        """Why the database cannot be used although it was opened, and what to do; None where it can.

        For files that were moved, deleted, replaced or written to by others. It is logged when that begins and ends.
        """
        return self._guard.trouble()

    def use_wal(self) -> None:
        """Put the file into WAL mode, for good, and watch it from now on. It is made where there is none.

        Not done on connecting: the file may be somebody else's. Raises StorageError.
        """
        with self._guarded():
            if not self.read_only:
                self._begin_wal()
            with self._moving_in:
                if not self._guard.watching:
                    self._guard.open(self._connect)

    def _begin_wal(self) -> None:
        deadline = time.monotonic() + self.busy_timeout
        with closing(self._connect(create=self._create and not self._guard.watching)) as connection:
            while connection.execute("PRAGMA journal_mode").fetchone()[0] != "wal":
                try:
                    connection.execute("PRAGMA journal_mode = WAL")
                except sqlite3.OperationalError as error:
                    # SQLite does not wait here for other connections as it does elsewhere.
                    if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                        raise
                    time.sleep(0.01)

    def hold_file(self) -> None:
        """Keep everybody from replacing the file until `dispose`. Raises StorageError."""
        with self._moving_in:
            if self._file_lock is None:
                with storage_errors(self.path):
                    self._file_lock = database_lock.share(self.path, self.busy_timeout, read_only=self.read_only)
                # What was opened before may be a file that is not of this name any more.
                self._close_idle()

    def copy_to(self, target: Path, *, between: Callable[[], None]) -> None:
        """Write a copy of the file as it is now, with all that is committed, while others read and write.

        The copy is one file without a log beside it, not yet synced. `between` is called after every megabyte; what it
        raises ends the copying. Raises StorageError.
        """
        with self._guarded(), closing(self._connect()) as source, closing(_new_file(target)) as copy:
            # In one read transaction, however long: else every write by others would make it begin again.
            source.execute("BEGIN")
            source.execute("SELECT count(*) FROM sqlite_master").fetchone()
            source.backup(copy, pages=_PIECE, progress=lambda *_: between())
            copy.execute("PRAGMA journal_mode = DELETE")

    def dispose(self) -> None:
        """Close all idle connections; the last one to close folds the write-ahead log into the file, if it is whole."""
        self._close_idle()
        with self._moving_in:
            self._guard.close()
            if self._file_lock is not None:
                database_lock.release(self._file_lock)
                self._file_lock = None

    def _close_idle(self) -> None:
        self._readers.close()
        self.engine.dispose()

    def _make_engine(self) -> Engine:
        expressions.register()
        engine = create_engine(
            "sqlite+pysqlite://",
            creator=self._connect,
            poolclass=QueuePool,
            pool_use_lifo=True,  # the one that was used last has the pages of the file in its cache
            pool_size=_POOL_SIZE,
            max_overflow=_POOL_SIZE,
            hide_parameters=True,  # an error's text goes to the log, what callers sent does not
            json_serializer=lambda value: orjson.dumps(value).decode(),
            json_deserializer=orjson.loads,
        )
        event.listen(engine, "begin", _begin)
        return engine

    def _connect(self, mode: Literal["ro", "rw"] = "rw", *, create: bool = False) -> sqlite3.Connection:
        if create:
            self._refuse_orphaned_log()
        access = "ro" if self.read_only else ("rwc" if create else mode)
        connection = sqlite3.connect(
            f"{self.path.as_uri()}?mode={access}",
            uri=True,
            timeout=self.busy_timeout,
            isolation_level=None,  # BEGIN is ours to say, see _begin
            check_same_thread=False,
        )
        try:
            # The file is open, and nothing of it was read: one that is not ours stays as it is.
            self._require()
            _configure(connection)
        except (sqlite3.Error, errors.StorageError):
            connection.close()
            raise
        return connection

    def _refuse_orphaned_log(self) -> None:
        """SQLite would remove the log of a database that is not there, with all that was committed to it."""
        real = self.path.resolve()
        log = real.with_name(f"{real.name}-wal")
        if not real.exists() and log.exists() and log.stat().st_size:
            raise errors.StorageAltered(
                f"{log.name} holds what was stored last in {real.name}, which is not there. Put the database back "
                "beside it; or move the log away to begin with an empty database."
            )

    def _require(self, cause: Exception | None = None) -> None:
        if (sentence := self.trouble()) is not None:
            raise errors.StorageAltered(sentence) from cause

    def _begin_to_write(self) -> Connection:
        self._require()  # the one who writes may have waited
        return self._write_engine.connect()

    @contextmanager
    def _guarded(self, *, writing: bool = True) -> Iterator[None]:
        """Look at the file before it is used and, if `writing`, after: what is acknowledged must be in it.

        A look takes 0.1 ms of the 2 ms that HTTP adds to a query, and what was read is not acknowledged. Raises
        StorageError.
        """
        self._require()
        try:
            yield
        except DBAPIError as error:
            if isinstance(error.orig, sqlite3.Error):
                self._raise_domain_error(error.orig, error)
            raise
        except sqlite3.Error as error:
            self._raise_domain_error(error, error)
        except PoolTimeout as error:
            raise errors.StorageBusy("All database connections are in use; try again shortly.") from error
        if writing:
            self._guard.used()
            self._require()

    def _raise_domain_error(self, error: sqlite3.Error, cause: Exception) -> NoReturn:
        self._require(cause)
        known = domain_error(error, self.path)
        if known is None:
            raise cause
        raise known from cause


@cache
def _opened(path: Path) -> Database:
    """The database of a worker process. It is closed when the process ends."""
    return Database(path)


def _configure(connection: sqlite3.Connection) -> None:
    connection.execute("PRAGMA foreign_keys = ON")
    # FULL, not NORMAL: in WAL mode NORMAL may lose acknowledged commits when the machine loses power.
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA temp_store = MEMORY")
    connection.execute("PRAGMA cache_size = -16384")
    # The first to read the file: what is no database fails here, before a pool owns the connection.
    connection.execute("PRAGMA schema_version").fetchone()


def _new_file(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, isolation_level=None)
    # Nobody needs it before it is complete, and then it is synced as a whole.
    connection.execute("PRAGMA journal_mode = OFF")
    connection.execute("PRAGMA synchronous = OFF")
    return connection


def _begin(connection: Connection) -> None:
    writing = connection.get_execution_options().get(_WRITE, False)
    # To the driver itself: said before every read, it would cost more on its way there than it does.
    connection.connection.cursor().execute("BEGIN IMMEDIATE" if writing else "BEGIN")
