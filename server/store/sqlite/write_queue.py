"""The write transactions of a process: one after the other, short ones committed together.

A commit ends with an fsync of about 4 ms, during which no other transaction of the file can write. So a transaction
that may share its commit hands its connection to the next one in the queue, which goes on behind a savepoint, and the
last one commits for all. Each returns only when that commit is on the disk. What one of them raises undoes its own
statements only; if the commit itself fails, all of them fail and nothing is stored. A transaction that is alone does
what it did without a queue. `python -m benchmarks.service --only puts` measures 8 clients that store.
"""

import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from sqlalchemy import Connection, RootTransaction
from sqlalchemy.exc import DBAPIError

from server import errors
from server.store.sqlite.sqlite_errors import BUSY

_MOST: Final = 32
"""Transactions in one commit."""
_LONGEST: Final = 0.02
"""Seconds after which no other transaction joins, so that nobody waits long for a commit."""


@dataclass(slots=True, eq=False)
class _Waiting:
    """A thread in the queue, and whether its transaction may share a commit."""

    shares: bool
    turn: threading.Event = field(default_factory=threading.Event)


class _Group:
    """Transactions with one commit, on one connection: each uses it alone, in turn."""

    def __init__(self, connection: Connection) -> None:
        """Begin. Raises what SQLite says."""
        self.connection = connection
        self._all: RootTransaction = connection.begin()
        self._driver: sqlite3.Connection = connection.connection.driver_connection  # type: ignore[assignment]
        self._began = time.monotonic()
        self._members = 0
        self._error: BaseException | None = None
        self._over = threading.Event()

    @property
    def is_open(self) -> bool:
        """Whether another transaction may join."""
        is_sound = self._error is None and self._driver.in_transaction
        return is_sound and self._members < _MOST and time.monotonic() - self._began < _LONGEST

    @contextmanager
    def member(self) -> Iterator[None]:
        """The statements of one transaction, undone by any exception. Raises what the block raises."""
        self._members += 1
        if self._members == 1:
            # Alone so far: there is nothing to keep if it fails.
            try:
                yield
            except BaseException as error:
                self._error = error
                raise
            return
        self._driver.execute("SAVEPOINT member")
        try:
            yield
        except BaseException as error:
            self._undo(error)
            raise
        self._driver.execute("RELEASE member")

    def _undo(self, cause: BaseException) -> None:
        """Undo the statements of the last member. After some errors, SQLite has undone those of all."""
        if not self._driver.in_transaction:
            self._error = cause
            return
        try:
            self._driver.execute("ROLLBACK TO member")
            self._driver.execute("RELEASE member")
        except sqlite3.Error as error:
            self._error = error

    def end(self) -> None:
        """Commit, or undo everything if that is not possible any more, and tell all members."""
        try:
            if self._error is None and not self._driver.in_transaction:
                self._error = errors.StorageBusy(BUSY)  # a commit of nothing would succeed
            if self._error is None:
                self._all.commit()
            else:
                self._all.rollback()
        except BaseException as error:  # noqa: BLE001  each member raises it
            self._error = self._error or error
            self.connection.invalidate()  # closed, not given to another one: what it did may still be open
        finally:
            try:
                self.connection.close()
            finally:
                self._over.set()

    def wait(self) -> None:
        """Wait until the commit is on the disk. Raises what kept it from that."""
        self._over.wait()
        if self._error is not None:
            raise _another(self._error)


class WriteQueue:
    """The one writer of a process at a time, first come, first served. Thread-safe."""

    def __init__(self, connect: Callable[[], Connection], patience: float) -> None:
        """`connect`: a connection for a write transaction; `patience`: most seconds in the queue."""
        self._connect, self._patience = connect, patience
        self._mutex = threading.Lock()
        self._waiting: deque[_Waiting] = deque()
        self._busy = False
        self._open: _Group | None = None
        """Handed over with the turn."""

    @contextmanager
    def transaction(self, *, shares: bool) -> Iterator[Connection]:
        """A write transaction: durable at the end of the block, undone by any exception.

        `shares`: it is short, and may be committed together with others. Raises StorageBusy and what SQLite says.
        """
        self._take_turn(shares)
        group, self._open = self._open, None
        try:
            group = group or _Group(self._connect())
        except BaseException:
            self._pass_turn()
            raise
        try:
            with group.member():
                yield group.connection
        except BaseException:
            self._leave(group, shares)
            group._over.wait()
            raise
        self._leave(group, shares)
        group.wait()

    def _take_turn(self, shares: bool) -> None:
        with self._mutex:
            if not self._busy:
                self._busy = True
                return
            one = _Waiting(shares)
            self._waiting.append(one)
        try:
            got = one.turn.wait(self._patience)
        except BaseException:
            if not self._withdraw(one):
                self._abandon()
            raise
        if not got and self._withdraw(one):
            raise errors.StorageBusy(BUSY)

    def _withdraw(self, one: _Waiting) -> bool:
        """Leave the queue; False if the turn came first."""
        with self._mutex:
            if one.turn.is_set():
                return False
            self._waiting.remove(one)
            return True

    def _abandon(self) -> None:
        """Give back a turn that nothing is done with."""
        group, self._open = self._open, None
        if group is not None:
            group.end()
        self._pass_turn()

    def _leave(self, group: _Group, shares: bool) -> None:
        """Hand the group over to the next transaction, or commit it and pass the turn on."""
        with self._mutex:
            if shares and self._waiting and self._waiting[0].shares and group.is_open:
                self._open = group
                self._waiting.popleft().turn.set()
                return
        try:
            group.end()
        finally:
            self._pass_turn()

    def _pass_turn(self) -> None:
        with self._mutex:
            if self._waiting:
                self._waiting.popleft().turn.set()
            else:
                self._busy = False


def _another(error: BaseException) -> BaseException:
    """An exception that says the same, for another thread."""
    cause = error.orig if isinstance(error, DBAPIError) else error
    if isinstance(cause, sqlite3.Error):
        copy = type(cause)(*cause.args)
        for name in ("sqlite_errorcode", "sqlite_errorname"):
            if hasattr(cause, name):
                setattr(copy, name, getattr(cause, name))
        return copy
    if isinstance(cause, errors.StorageError):
        return cause
    # The thread that committed was interrupted, or the program is at fault: its own exception says so.
    return errors.StorageBusy(BUSY)
