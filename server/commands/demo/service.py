"""The demo's service, in a process of its own that ends with the demo, unless it is kept."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from server.commands.support.failure import CommandError
from server.commands.support.signals import handled
from urquhart_client import Client, ConnectionFailed, ProblemError

START_SECONDS: Final = 180.0
STOP_SECONDS: Final = 15.0


@contextmanager
def running_service(database: Path, log: Path, *, keep: bool) -> Iterator[tuple[str, int]]:
    """Serve `database` on a free loopback port. Yields the URL and the process id once the service is ready.

    The process is stopped at the end of the block, however it ends; with `keep`, only if it ends by an exception.

    Raises:
        Failure: the service did not start; `log` has what it said.
    """
    port = _free_port()
    command = [sys.executable, "-m", "server.cli", "serve", "--port", str(port), "--database", str(database)]
    # Without the caller's settings, which could change the demo.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("URQUHART_")}
    with log.open("wb") as output, handled(_leave, signal.SIGTERM, signal.SIGHUP):
        # A session of its own: Ctrl-C reaches only this process, which then stops the service in order.
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,
        )
        leave = False
        try:
            url = f"http://127.0.0.1:{port}"
            _wait_until_ready(url, process, log)
            yield url, process.pid
            leave = keep
        finally:
            if not leave:
                _stop(process)


def _wait_until_ready(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    with Client(url, timeout=5.0) as client:
        while time.monotonic() < deadline:
            if process.poll() is not None:
                said = log.read_text(errors="replace").strip().splitlines()
                reason = said[-1] if said else f"exit code {process.returncode}"
                raise CommandError(f"the service did not start: {reason} (full log: {log})")
            try:
                client.ready()
            except (ConnectionFailed, ProblemError):
                time.sleep(0.1)
            else:
                return
    raise CommandError(f"the service was not ready within {START_SECONDS:.0f} s (its log: {log})")


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _leave(number: int) -> None:
    """Unwind the stack as Ctrl-C does, so that nothing that was started here is left."""
    raise SystemExit(128 + number)
