"""The SQLite file: connections, transactions, and SQLite's errors in the words of the domain."""

import errno
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NoReturn

import orjson
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm import Session
from sqlalchemy.pool import QueuePool

from server import errors
from server.store import occupancy

_WRITE = "urquhart_write"
_PIECE = 256  # pages of a copy that are written at once, about a megabyte
_POOL_SIZE = 64  # above the threads that serve requests, so that no request waits for a connection


class Database:
    """One SQLite file in WAL mode.

    `read()` gives a session on one snapshot that no writer disturbs; `write()` a session that holds the write
    lock from its first statement, committed at the end of the block and rolled back by any exception. Repositories
    get such sessions handed in and never commit. Errors of SQLite leave as `errors.StorageError`.
    """

    def __init__(self, path: Path | str, *, busy_timeout: float = 10.0, read_only: bool = False) -> None:
        """Prepare for the file at `path` (it is opened, or made, at first use); `busy_timeout` in seconds."""
        self.path = Path(path).absolute()
        self.read_only = read_only
        self._busy_timeout = busy_timeout
        # Queueing writers of this process here wakes them at once; SQLite's own waiting polls with growing sleeps.
        self._writer = threading.Lock()
        self._occupancy: int | None = None
        self._moving_in = threading.Lock()
        self.engine = self._make_engine()
        self._write_engine = self.engine.execution_options(**{_WRITE: True})

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session on a read transaction: everything read in it is of one revision."""
        with self._translated(), Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session on a write transaction, committed at the end; durable once the block is left."""
        with (
            self._one_writer(),
            self._translated(),
            Session(self._write_engine, expire_on_commit=False) as session,
            session.begin(),
        ):
            yield session

    @contextmanager
    def write_connection(self) -> Iterator[Connection]:
        """A connection on a write transaction, for the schema's own statements."""
        with self._one_writer(), self._translated(), self._write_engine.begin() as connection:
            yield connection

    @contextmanager
    def read_connection(self) -> Iterator[Connection]:
        """A connection on a read transaction, for the schema's own statements."""
        with self._translated(), self.engine.connect() as connection:
            yield connection

    def use_wal(self) -> None:
        """Put the file into WAL mode, for good. Not done on connecting: the file may be somebody else's."""
        if self.read_only:
            return
        deadline = time.monotonic() + self._busy_timeout
        with self._translated(), closing(self._connect()) as connection:
            while connection.execute("PRAGMA journal_mode").fetchone()[0] != "wal":
                try:
                    connection.execute("PRAGMA journal_mode = WAL")
                except sqlite3.OperationalError as error:
                    # SQLite does not wait here for other connections as it does elsewhere.
                    if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                        raise
                    time.sleep(0.01)

    def occupy(self) -> None:
        """Keep everybody from replacing the file until `dispose`. Raises StorageError."""
        with self._moving_in:
            if self._occupancy is None:
                with storage_errors(self.path):
                    self._occupancy = occupancy.occupy(self.path, self._busy_timeout, read_only=self.read_only)
                # What was opened before may be a file that is not of this name any more.
                self.engine.dispose()

    def copy_to(self, target: Path, *, between: Callable[[], None]) -> None:
        """Write a copy of the file as it is now, with all that is committed, while others read and write.

        The copy is one file without a log beside it, not yet synced. `between` is called after every megabyte; what it
        raises ends the copying. Raises StorageError.
        """
        with self._translated(), closing(self._connect()) as source, closing(_new_file(target)) as copy:
            # In one read transaction, however long: else every write by others would make it begin again.
            source.execute("BEGIN")
            source.execute("SELECT count(*) FROM sqlite_master").fetchone()
            source.backup(copy, pages=_PIECE, progress=lambda *_: between())
            copy.execute("PRAGMA journal_mode = DELETE")

    def dispose(self) -> None:
        """Close all idle connections; the last one to close folds the write-ahead log into the file."""
        self.engine.dispose()
        with self._moving_in:
            if self._occupancy is not None:
                occupancy.leave(self._occupancy)
                self._occupancy = None

    def _make_engine(self) -> Engine:
        engine = create_engine(
            "sqlite+pysqlite://",
            creator=self._connect,
            poolclass=QueuePool,
            pool_size=_POOL_SIZE,
            max_overflow=_POOL_SIZE,
            hide_parameters=True,  # an error's text goes to the log, what callers sent does not
            json_serializer=lambda value: orjson.dumps(value).decode(),
            json_deserializer=orjson.loads,
        )
        event.listen(engine, "begin", _begin)
        return engine

    def _connect(self) -> sqlite3.Connection:
        mode = "ro" if self.read_only else "rwc"
        connection = sqlite3.connect(
            f"{self.path.as_uri()}?mode={mode}",
            uri=True,
            timeout=self._busy_timeout,
            isolation_level=None,  # BEGIN is ours to say, see _begin
            check_same_thread=False,
        )
        try:
            _configure(connection)
        except sqlite3.Error:
            connection.close()
            raise
        return connection

    @contextmanager
    def _one_writer(self) -> Iterator[None]:
        if not self._writer.acquire(timeout=self._busy_timeout):
            raise errors.StorageBusy(_BUSY)
        try:
            yield
        finally:
            self._writer.release()

    @contextmanager
    def _translated(self) -> Iterator[None]:
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

    def _raise_domain_error(self, error: sqlite3.Error, cause: Exception) -> NoReturn:
        code = getattr(error, "sqlite_errorcode", None)
        known = _ERRORS.get(code & 0xFF) if isinstance(code, int) else None
        if known is None:
            raise cause
        kind, sentence = known
        raise kind(f"{sentence} (database {self.path.name})") from cause


@contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """What the disk says about files beside the database, in the words of the domain. Raises StorageError."""
    try:
        yield
    except OSError as error:
        kind, sentence = _ERRORS[_DISK.get(error.errno or 0, sqlite3.SQLITE_IOERR)]
        raise kind(f"{sentence} ({path.name}: {error.strerror or error})") from error


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


_DISK = {
    errno.ENOSPC: sqlite3.SQLITE_FULL,
    errno.EDQUOT: sqlite3.SQLITE_FULL,
    errno.EROFS: sqlite3.SQLITE_READONLY,
    errno.EACCES: sqlite3.SQLITE_READONLY,
}
_BUSY = "Another process is writing for longer than the busy timeout; nothing was stored, try again shortly."
_ERRORS: dict[int, tuple[type[errors.StorageError], str]] = {
    sqlite3.SQLITE_FULL: (
        errors.StorageFull,
        "The disk is full: nothing of this request was stored, what was stored before is intact. "
        "Free some space and send it again.",
    ),
    sqlite3.SQLITE_READONLY: (
        errors.StorageReadOnly,
        "The database cannot be written: nothing was stored. Make the file and its folder writable for the service.",
    ),
    sqlite3.SQLITE_PERM: (errors.StorageUnavailable, "The database file may not be opened; check its permissions."),
    sqlite3.SQLITE_BUSY: (errors.StorageBusy, _BUSY),
    sqlite3.SQLITE_LOCKED: (errors.StorageBusy, _BUSY),
    sqlite3.SQLITE_IOERR: (errors.StorageUnavailable, "The disk reports an error; check it before writing more."),
    sqlite3.SQLITE_CORRUPT: (
        errors.StorageDamaged,
        "The database file is damaged. Stop the service, run `urquhart db check`, and restore a backup "
        "if it confirms this.",
    ),
    sqlite3.SQLITE_NOTADB: (
        errors.NotADatabase,
        "The file is not a SQLite database and is left as it is. Give another path.",
    ),
    sqlite3.SQLITE_CANTOPEN: (
        errors.StorageUnavailable,
        "The database cannot be opened: its folder must exist and the service must be allowed to write there.",
    ),
}
