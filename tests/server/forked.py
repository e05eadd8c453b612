"""Servers and workers forked from a process that has loaded everything, because loading takes longer than most tests.

Each is a process of its own with its own environment, and is signalled and killed as any other; what it shares is that
modules and kernels are in memory already. The commands as a shell starts them, and the processes that these spawn, are
run in `tests/server/commands`; workers as a service spawns them in `tests/server/platform/test_workers.py`.
"""

import contextlib
import multiprocessing
import os
import resource
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from multiprocessing import forkserver
from multiprocessing.context import ForkProcess, ForkServerProcess
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_FORKS = multiprocessing.get_context("forkserver")


class LoadedProcess(ForkServerProcess):
    """A process that is forked from one that has loaded everything."""

    def start(self) -> None:
        """Fork it."""
        _load()
        super().start()


class ForkedWorkers:
    """In the place of the context `spawn`: workers of a service in the test's own process."""

    Pipe = staticmethod(multiprocessing.Pipe)
    Process = LoadedProcess


class CopiedProcess(ForkProcess):
    """In the place of a spawned process of a supervisor, whose environment and open files it keeps."""

    def run(self) -> None:
        """Begin without the supervisor's handlers."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        super().run()


class _CopiedProcesses:
    Process = CopiedProcess


class Forked:
    """`urquhart`, `uvicorn` or a module, with arguments and the methods of `subprocess.Popen` that tests use."""

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
        _load()
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


def _load() -> None:
    _FORKS.set_forkserver_preload(["tests.server.preloaded"])
    with contextlib.chdir(_ROOT):  # where the preloaded module is found
        forkserver._forkserver.ensure_running()


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
    # The fork server is the one that this process was forked from.
    forkserver._forkserver.ensure_running = lambda: None  # type: ignore[method-assign]
    # A shell's background jobs hand on that SIGINT is ignored; what a terminal starts does not ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
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
        from server.commands.support import supervisor

        supervisor._SPAWN = _CopiedProcesses  # type: ignore[assignment,misc]
        urquhart()
    elif program == "uvicorn":
        from uvicorn.main import main as uvicorn

        uvicorn()
    else:
        runpy.run_module(program, run_name="__main__", alter_sys=True)
