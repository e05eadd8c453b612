"""A server in a process of its own, on a free port."""

import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import httpx

from tests.server.forked import Forked

_ROOT = Path(__file__).parents[2]
_LISTENING = re.compile(r"running on (http://127\.0\.0\.1:\d+)")
_PATIENCE = 120.0


def spawned(parent: int) -> set[int]:
    """Process ids of a process's Python children, whichever of its threads spawned or forked them."""
    found = set[int]()
    for task in Path(f"/proc/{parent}/task").iterdir():
        for child in (task / "children").read_text().split():
            try:
                command = Path(f"/proc/{child}/cmdline").read_bytes()
            except FileNotFoundError:  # it has ended since
                continue
            if b"spawn_main" in command or b"multiprocessing.forkserver" in command:
                found.add(int(child))
    return found


class Server:
    """A uvicorn process over a database; `client` talks to it once it is ready."""

    def __init__(self, database: Path, log: Path, **settings: str) -> None:
        self.log = log
        self.process = Forked(
            "uvicorn",
            ["--factory", "server.app:create_app_from_env", "--port", "0"],
            folder=_ROOT,
            environment=os.environ | {"URQUHART_DATABASE": str(database)} | settings,
            output=log,
            errors=log,
        )
        self.client = httpx.Client(base_url=self._address(), timeout=60.0)
        self._wait_until(lambda: self.client.get("/readyz").status_code == 200)

    def kill(self) -> None:
        """SIGKILL: no handler runs, nothing is closed."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> int:
        """SIGTERM, and the exit code."""
        self.process.terminate()
        return self.process.wait(_PATIENCE)

    def close(self) -> None:
        """End it, however."""
        self.client.close()
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def _address(self) -> str:
        found: list[str] = []

        def listening() -> bool:
            found.extend(_LISTENING.findall(self.log.read_text()))
            return bool(found)

        self._wait_until(listening)
        return found[0]

    def _wait_until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + _PATIENCE
        while not condition():
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.05)
