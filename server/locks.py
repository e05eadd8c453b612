"""A readers-writer lock whose writer may go on as a reader."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager


class ReadersWriterLock:
    """Many readers or one writer. A waiting writer goes before readers that come later, so that it is never starved."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._readers = 0
        self._writing = False
        self._waiting_writers = 0

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Hold the lock with other readers."""
        with self._condition:
            self._condition.wait_for(lambda: not self._writing and self._waiting_writers == 0)
            self._readers += 1
        try:
            yield
        finally:
            self._release_reader()

    @contextmanager
    def writing_then_reading(self) -> Iterator["Downgrade"]:
        """Hold the lock alone, and from `downgrade()` on with other readers, with no writer in between."""
        with self._condition:
            self._waiting_writers += 1
            try:
                self._condition.wait_for(lambda: not self._writing and self._readers == 0)
            finally:
                self._waiting_writers -= 1
                self._condition.notify_all()
            self._writing = True
        held = Downgrade(self)
        try:
            yield held
        finally:
            if held.done:
                self._release_reader()
            else:
                self._release_writer()

    def _downgrade(self) -> None:
        with self._condition:
            self._writing = False
            self._readers += 1
            self._condition.notify_all()

    def _release_reader(self) -> None:
        with self._condition:
            self._readers -= 1
            if self._readers == 0:
                self._condition.notify_all()

    def _release_writer(self) -> None:
        with self._condition:
            self._writing = False
            self._condition.notify_all()


class Downgrade:
    """Given to the holder of the write lock."""

    def __init__(self, lock: ReadersWriterLock) -> None:
        self._lock = lock
        self.done = False

    def downgrade(self) -> None:
        """Let other readers in; the lock stays held for reading."""
        if not self.done:
            self._lock._downgrade()
            self.done = True
