"""Servers forked from a process that has loaded everything, because loading takes longer than most tests.

Each is a process of its own with its own environment, and is signalled and killed as any other; what it shares is that
modules and kernels are in memory already. The commands as a shell starts them are run in `tests/server/commands`.
"""

import contextlib
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from multiprocessing import forkserver
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_FORKS = multiprocessing.get_context("forkserver")


class Forked:
    """`urquhart ARGUMENTS`, or `uvicorn ARGUMENTS`, with the methods of `subprocess.Popen` that tests use."""

    def __init__(
        self,
        program: str,
        arguments: Sequence[str],
        *,
        folder: Path,
        environment: Mapping[str, str],
        output: Path,
        errors: Path,
        files: int | None = None,
    ) -> None:
        """Start it in `folder`, its standard output and standard error in two files, or in one.

        `files`: how many it may have open; None: as many as the tests.
        """
        for file in (output, errors):
            file.write_bytes(b"")
        _FORKS.set_forkserver_preload(["tests.server.preloaded"])
        with contextlib.chdir(_ROOT):  # where the preloaded module is found
            forkserver.ensure_running()
        work = (program, list(arguments), folder, dict(environment), output, errors, files)
        self._process = _FORKS.Process(target=_run, args=work)
        self._process.start()

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self._process.pid is not None
        return self._process.pid

    def poll(self) -> int | None:
        """The exit code, negative for a signal; None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, once it has ended. Raises subprocess.TimeoutExpired."""
        self._process.join(timeout)
        code = self._process.exitcode
        if code is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """SIGKILL: no handler runs, nothing is closed."""
        self.send_signal(signal.SIGKILL)


def _run(
    program: str,
    arguments: list[str],
    folder: Path,
    environment: dict[str, str],
    output: Path,
    errors: Path,
    files: int | None,
) -> None:
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # it may be another one in this environment
    os.chdir(folder)
    with Path(os.devnull).open("rb") as nothing, output.open("ab") as out, errors.open("ab") as err:
        for number, file in enumerate((nothing, out, err)):
            os.dup2(file.fileno(), number)
    if files is not None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))
    sys.argv = [program, *arguments]
    if program == "urquhart":
        from server.cli import main as urquhart

        urquhart()
    else:
        from uvicorn.main import main as uvicorn

        uvicorn()
