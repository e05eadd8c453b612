"""A service with two keys, one for the attacker and one for the robot, and a look at what it holds."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import httpx

from benchmarks.reliability.exhaustion.attack_outcome import give_way
from benchmarks.server_process import BenchmarkServer, served
from server.security import api_keys
from server.security.principal import Scope
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner

ATTACKER: Final = "attacker"
HONEST: Final = "honest"
_LOOK: Final = 0.02
"""Seconds between two looks at the memory."""
_TIMEOUT: Final = 120.0
_START: Final = """\
import resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, ({0}, {0}))
from server.cli import main
main()
"""


@dataclass
class Watch:
    """What the service held: MB of its own memory at first and at most, open descriptors at most."""

    start: float
    peak: float
    descriptors: int = 0


class AttackedService:
    """A running service over a database in `folder`; each caller's collection has the caller's name."""

    def __init__(self, folder: Path, limits: Mapping[str, str]) -> None:
        self.folder, self._limits = folder, limits
        self.database = folder / "attacked.db"
        self._stack = ExitStack()
        self._clients: dict[str, httpx.Client] = {}
        self.keys: dict[str, str] = {}
        self._ids: dict[str, str] = {}

    def __enter__(self) -> "AttackedService":
        database = Database(self.database)
        try:
            migrations_runner.upgrade(database)
            for name in (ATTACKER, HONEST):
                secret, info = api_keys.make(database, name, list(Scope), [f"{name}*"], None)
                self.keys[name], self._ids[name] = secret, info.id
        finally:
            database.dispose()
        settings = dict(self._limits)
        descriptors = settings.pop("descriptors", None)
        program = ("-m", "server.cli") if descriptors is None else ("-c", _START.format(descriptors))
        self.server: BenchmarkServer = self._stack.enter_context(
            served(self.database, self.folder / "log", program, **settings)
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def client(self, name: str) -> httpx.Client:
        """A client with the key of that caller; one a caller, for as many threads as ask."""
        if name not in self._clients:
            limits = httpx.Limits(max_connections=None, max_keepalive_connections=20)
            headers = {"Authorization": f"Bearer {self.keys[name]}"}
            client = httpx.Client(base_url=self.server.url, headers=headers, timeout=_TIMEOUT, limits=limits)
            self._clients[name] = self._stack.enter_context(client)
        return self._clients[name]

    def revoke(self, name: str) -> None:
        """Take a caller's key away, as an operator does on the host."""
        database = Database(self.database)
        try:
            api_keys.revoke(database, self._ids[name])
        finally:
            database.dispose()

    @contextmanager
    def watched(self) -> Iterator[Watch]:
        """The most memory and descriptors that the service holds during the block."""
        watch, stop = Watch(self.server.megabytes(), self.server.megabytes()), threading.Event()

        def look() -> None:
            give_way()
            folder = Path(f"/proc/{self.server.process.pid}/fd")
            while not stop.wait(_LOOK):
                try:
                    watch.peak = max(watch.peak, self.server.megabytes())
                    watch.descriptors = max(watch.descriptors, sum(1 for _ in folder.iterdir()))
                except OSError:
                    return  # the service ended, which the attack's figures tell

        thread = threading.Thread(target=look, daemon=True)
        thread.start()
        try:
            yield watch
        finally:
            stop.set()
            thread.join()
