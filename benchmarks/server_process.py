"""A server in a process of its own, which a part may look at, send signals to, and end."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import httpx

_SERVING: Final = re.compile(r"serving on (http://\S+)")
_FAILED: Final = re.compile(r"request \S+: \S+ \S+ failed")
_ERROR: Final = re.compile(r"[\w.]+(Error|Exception)\b")
_PROGRAM: Final = ("-m", "server.cli")
PATIENCE: Final = 180.0
"""Seconds within which a server starts or stops."""


@dataclass(slots=True)
class BenchmarkServer:
    """A running server.

    Attributes:
        process: its process.
        url: where it listens.
        log: what it says goes there.
        ready_seconds: from its start until it said that it is ready.
    """

    process: "subprocess.Popen[bytes]"
    url: str
    log: Path
    ready_seconds: float

    def megabytes(self) -> float:
        """Memory that is its own, in MB: what files can give back is left out."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8").splitlines()
        kilobytes = next(line.split()[1] for line in lines if line.startswith("RssAnon"))
        return int(kilobytes) * 1024 / 1e6

    def kill(self) -> None:
        """End it without notice (SIGKILL): nothing is closed."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> tuple[int, float]:
        """Ask it to end (SIGTERM); its exit code, and the seconds that it took."""
        began = time.perf_counter()
        self.process.terminate()
        code = self.process.wait(PATIENCE)
        return code, time.perf_counter() - began

    def failures(self) -> list[str]:
        """Lines of its log that tell of a failure: an exception that nothing handled."""
        lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        told = [line[:300] for line in lines if line.startswith("Traceback") or _FAILED.fullmatch(line)]
        return told + [line[:300] for line in lines if told and _ERROR.match(line)]


class OtherCode(NamedTuple):
    """A folder with the code of another version, and what Python runs of it as the command line."""

    folder: Path
    program: Sequence[str] = _PROGRAM


def start(database: Path, log: Path, program: Sequence[str] | OtherCode = _PROGRAM, **settings: str) -> BenchmarkServer:
    """Start a server over `database` and wait until it is ready; `settings` are URQUHART_... by their full names.

    `program`: what Python runs as the command line, of this checkout or of another version.

    Raises:
        RuntimeError: it ended, or was not ready in time.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith("URQUHART_")}
    folder = None
    if isinstance(program, OtherCode):
        folder, program = program
        environment["PYTHONPATH"] = str(folder)
    command = [sys.executable, *program, "serve", "--port", "0", "--database", str(database)]
    began = time.perf_counter()
    with log.open("wb") as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment | settings | {"PYTHONUNBUFFERED": "1"},
            start_new_session=True,
        )
    try:
        while not (said := _SERVING.findall(log.read_text(encoding="utf-8", errors="replace"))):
            _go_on(process, log, began)
        with httpx.Client(base_url=said[0], timeout=PATIENCE) as client:
            while not _is_ready(client):
                _go_on(process, log, began)
    except BaseException:
        process.kill()
        process.wait()
        raise
    return BenchmarkServer(process, said[0], log, time.perf_counter() - began)


@contextmanager
def served(
    database: Path, log: Path, program: Sequence[str] | OtherCode = _PROGRAM, **settings: str
) -> Iterator[BenchmarkServer]:
    """A server for the block, ended after it, however that ends."""
    server = start(database, log, program, **settings)
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.process.terminate()
            try:
                server.process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                server.kill()


def _is_ready(client: httpx.Client) -> bool:
    try:
        return client.get("/readyz").status_code == 200
    except httpx.TransportError:
        return False  # it listens, and does not answer yet


def _go_on(process: "subprocess.Popen[bytes]", log: Path, began: float) -> None:
    if process.poll() is not None:
        raise RuntimeError(f"the server ended with {process.returncode}: {log.read_text(errors='replace')[-500:]}")
    if time.perf_counter() - began > PATIENCE:
        raise RuntimeError("the server was not ready in time")
    time.sleep(0.05)
