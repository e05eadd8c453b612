"""Guards an open database file: decides what becomes of its log when the file is moved, replaced or overwritten."""

import logging
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from server import errors
from server.store.sqlite.file_watch import FileWatch, Trouble
from server.store.sqlite.sqlite_errors import storage_errors
from server.store.sqlite.stale_log import identity

Connect = Callable[[Literal["ro", "rw"]], sqlite3.Connection]
_log = logging.getLogger(__name__)


class FileGuard:
    """Keeps the log of a database from being applied to any content but the one that it was written for.

    Two connections stay open from `open` to `close`, so that nobody removes the log. The last connection to close a
    database writes the log into it, if it gets an exclusive lock. One for reading only does not get it, and while it is
    open nobody does: so there is one of each, and `close` says which is the last. Thread-safe.
    """

    def __init__(self, path: Path, *, read_only: bool) -> None:
        """Of the database at `path`, which need not be there yet."""
        self.path = path
        self._read_only = read_only
        self._watch = FileWatch(path)
        self._connections: list[sqlite3.Connection] = []
        self._trouble: Trouble | None = None
        self._saved = False
        self._mutex = threading.Lock()

    @property
    def watching(self) -> bool:
        """Whether the database is open."""
        return self._watch.bound

    def open(self, connect: Connect) -> None:
        """Watch what lies at the path from now on. Raises StorageError, and what `connect` raises."""
        with storage_errors(self.path):
            before = identity(self.path)
            try:
                modes: tuple[Literal["ro", "rw"], ...] = ("ro", "ro" if self._read_only else "rw")
                for mode in modes:
                    self._connections.append(connect(mode))
                    self._connections[-1].execute("SELECT count(*) FROM sqlite_master").fetchone()  # opens the log
                self._watch.bind()
                if identity(self.path) != before:
                    raise errors.StorageAltered(f"{self.path.name} was replaced while it was opened; start again.")
            except BaseException:
                self._end(fold=True)
                raise

    def trouble(self) -> str | None:
        """Why the database cannot be used although it was opened, and what to do; None where it can.

        It is logged when that begins and ends. The log is made harmless to whatever file comes to the name.
        """
        found = self._watch.trouble()
        with self._mutex:
            before, self._trouble = self._trouble, found
            if found is None:
                if before is not None:
                    _log.warning("the database can be used again")
                return None
            begins = before is None or before.kind != found.kind
            if found.kind == "moved":
                self._save()
            elif found.kind == "apart" and begins:
                found = self._set_aside(found)
            if begins:
                _log.error("the database cannot be used: %s", found.sentence)
            return found.sentence

    def used(self) -> None:
        """Something may have been committed since the file was looked at last."""
        self._saved = False

    def close(self) -> None:
        """Watch no more; no other connection may be open."""
        if not self._connections:
            return
        self.used()
        self.trouble()
        self._end(fold=self._trouble is None or self._trouble.kind != "apart")
        self._trouble = None

    def _end(self, *, fold: bool) -> None:
        for connection in self._connections if fold else reversed(self._connections):
            connection.close()
        self._connections.clear()
        self._watch.release()

    def _save(self) -> None:
        """Write the log into the file that is open, wherever that is, and empty it, once nobody reads from it."""
        if self._saved or self._read_only or not self._connections:
            return
        connection = self._connections[-1]
        try:
            connection.execute("PRAGMA busy_timeout = 0")  # requests wait for this
            busy, _, _ = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        except sqlite3.Error as error:
            _log.warning("what is in the log cannot be written to the database file: %s", error)
        else:
            self._saved = not busy

    def _set_aside(self, found: Trouble) -> Trouble:
        if self._read_only:
            return found
        try:
            self._watch.set_log_aside()
        except OSError as error:
            _log.error("move %s-wal away before the next start; it cannot be renamed: %s", self.path.name, error)
        return self._watch.trouble() or found
