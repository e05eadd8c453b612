"""The code of this checkout, or of a commit: its service and its library, each in a process of its own.

A commit is unpacked once and kept, with its compiled kernels. It runs in this environment, so what is compared is our
code and not the libraries' versions.
"""

import io
import json
import os
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from benchmarks.machine import ROOT
from benchmarks.server_process import BenchmarkServer, OtherCode, served

BASELINE: Final = "95bf473"
"""The commit that figures are published relative to: the last one before the service's rooms were rebuilt."""
_LIBRARY: Final = Path(__file__).with_name("library.py")


@dataclass(frozen=True, slots=True)
class Version:
    """A version of the code: its name for people, and the folder that it lies in."""

    name: str
    folder: Path

    @staticmethod
    def current() -> "Version":
        """The code of this checkout."""
        return Version("now", ROOT)

    @staticmethod
    def of_commit(commit: str, kept: Path) -> "Version":
        """The code of a commit, unpacked below `kept` unless it is there. Raises CalledProcessError without git."""
        folder = kept / commit
        if not (folder / "server").exists():
            folder.mkdir(parents=True, exist_ok=True)
            packed = subprocess.run(
                ["git", "archive", commit, "urquhart", "server", "migrations", "pyproject.toml"],
                cwd=ROOT,
                check=True,
                capture_output=True,
            )
            with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
                archive.extractall(folder, filter="data")
        return Version(commit, folder.absolute())

    @property
    def environment(self) -> dict[str, str]:
        """The environment of its processes: without settings of the service, and its code before all other."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("URQUHART_")}
        return kept | {"PYTHONPATH": str(self.folder)}

    @contextmanager
    def service(self, folder: Path, *program: str, **settings: str) -> Iterator[BenchmarkServer]:
        """Its service on a database in `folder`, ready, for the block. `program`: what Python runs instead of it."""
        database, log = folder / f"{self.name}.db", folder / f"{self.name}.log"
        code = OtherCode(self.folder, program) if program else OtherCode(self.folder)
        with served(database, log, code, **settings) as server:
            yield server

    @contextmanager
    def library(self, submaps: Path) -> Iterator["Library"]:
        """Its library over the submaps of a file, for the block."""
        process = subprocess.Popen(
            [sys.executable, str(_LIBRARY), str(submaps)],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        with process:
            if process.stdin is None or process.stdout is None:
                raise AssertionError("both are pipes")
            try:
                library = Library(process.stdin, process.stdout)
                library.wait()
                yield library
            finally:
                process.kill()


class Library:
    """A process that searches with the library alone. `wait` returns when it is ready."""

    def __init__(self, commands: IO[str], said: IO[str]) -> None:
        self._commands, self._said = commands, said

    def wait(self) -> None:
        """Wait until it has built its index. Raises RuntimeError if it ended instead."""
        self._read()

    def ask(self, first: int, count: int) -> list[dict[str, float]]:
        """Ask its queries `first` to `first + count - 1`: milliseconds `wall` and `cpu` of each."""
        self._commands.write(f"{first} {count}\n")
        self._commands.flush()
        found: list[dict[str, float]] = self._read()
        return found

    def _read(self) -> list[dict[str, float]]:
        line = self._said.readline()
        if not line:
            raise RuntimeError("the library's process ended")
        found: list[dict[str, float]] = json.loads(line)
        return found


def cpu_seconds(pid: int) -> float:
    """Processor time of all threads of a process since its start, to the nanosecond."""
    # The clock of another process, as clock_getcpuclockid has it.
    return time.clock_gettime(((~pid) << 3) | 2)
