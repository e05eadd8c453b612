"""Connections that read, kept open and outside of the pool between two read transactions.

Every query is a read transaction. To take its connection out of SQLAlchemy's pool and to give it back costs as much
again as to begin and to end it.
"""

import threading
from types import TracebackType
from typing import Final

from sqlalchemy import Connection, Engine, RootTransaction

_KEPT: Final = 16
"""Connections that are kept; the pool has the others."""


class ReadConnections:
    """The idle ones of a database. The one that was used last has the pages of the file in its cache, and is the next.

    Thread-safe.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._idle: list[Connection] = []
        self._mutex = threading.Lock()
        self._opened = 0
        """Raised when all are closed: one that was in use then is not kept."""

    def begin(self) -> "ReadingConnection":
        """A read transaction on one of them, to be entered. Raises what SQLite says."""
        with self._mutex:
            opened, connection = self._opened, self._idle.pop() if self._idle else None
        return ReadingConnection(self, opened, connection or self._engine.connect())

    def keep(self, opened: int, connection: Connection) -> None:
        """Take back one whose transaction has ended."""
        with self._mutex:
            if opened == self._opened and len(self._idle) < _KEPT:
                self._idle.append(connection)
                return
        connection.close()

    def close(self) -> None:
        """Close those that are idle; those in use are closed when they are given back."""
        with self._mutex:
            self._opened += 1
            idle, self._idle = self._idle, []
        for connection in idle:
            connection.close()


class ReadingConnection:
    """A connection on a read transaction, for a block."""

    __slots__ = ("_connection", "_home", "_opened", "_transaction")

    def __init__(self, home: ReadConnections, opened: int, connection: Connection) -> None:
        self._home, self._opened, self._connection = home, opened, connection
        self._transaction: RootTransaction | None = None

    def __enter__(self) -> Connection:
        try:
            self._transaction = self._connection.begin()  # a statement for the driver itself would not
        except BaseException:
            self._connection.close()
            raise
        return self._connection

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None or self._transaction is None:
            self._connection.close()
            return
        try:
            self._transaction.rollback()
        except BaseException:
            self._connection.close()
            raise
        self._home.keep(self._opened, self._connection)
