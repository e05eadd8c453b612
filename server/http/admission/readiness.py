"""What must be done before the service is ready, and how far it is."""

import threading
from collections.abc import Callable, Mapping

from server.errors import NotReady

CHECKS = ("migrations", "kernels", "index")
SHUTDOWN = "shutdown"
DATABASE = "database"


class ReadinessChecks:
    """Named checks that are passed, or open with a sentence. Thread-safe."""

    def __init__(self, database: Callable[[], str | None] = lambda: None) -> None:
        """All checks are open. `database` returns why the database cannot be used, or None if it can."""
        self._database = database
        self._open = dict.fromkeys(CHECKS, "waiting")
        self._guard = threading.Lock()

    def report(self, check: str, state: str) -> None:
        """Set the sentence of an open check."""
        with self._guard:
            self._open[check] = state

    def passed(self, check: str) -> None:
        """Mark the check as passed."""
        with self._guard:
            self._open.pop(check, None)

    @property
    def stopping(self) -> bool:
        """Whether the service is stopping."""
        with self._guard:
            return SHUTDOWN in self._open

    def is_open(self, check: str) -> bool:
        """Whether the check is not passed yet."""
        with self._guard:
            return check in self._open

    @property
    def ready(self) -> bool:
        """Whether all checks are passed."""
        return all(state == "ok" for state in self.states().values())

    def states(self) -> Mapping[str, str]:
        """All checks in the order in which they are passed, each with "ok" or what is open. "shutdown" is first if
        present.
        """
        with self._guard:
            extra = {name: state for name, state in self._open.items() if name not in CHECKS}
            states = extra | {name: self._open.get(name, "ok") for name in CHECKS}
        return states | {DATABASE: self._database() or "ok"}

    def require(self) -> None:
        """Raise NotReady, naming the first open check."""
        for name, state in self.states().items():
            if state != "ok":
                raise NotReady(name, state)
