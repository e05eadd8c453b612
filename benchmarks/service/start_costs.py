"""Starting, and being there: seconds to start, memory without a request, and what an installation takes on the disk."""

import json
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.server_process import OtherCode, served
from benchmarks.service.as_installed import PACKAGES
from benchmarks.service.versions import Version

_TRIES: Final = 3
_NAME: Final = re.compile(r"[A-Za-z0-9._-]+")
_CACHE: Final = "NUMBA_CACHE_DIR"
_KERNELS: Final = Path(__file__).with_name("kernel_costs.py")
_AS_INSTALLED: Final = (str(Path(__file__).with_name("as_installed.py")),)
_OURS: Final = ("server", "urquhart", "migrations", "urquhart_client")


def measure(version: Version, *, first: bool) -> Figures:
    """Seconds and megabytes of a version with the packages that an installation has, the least of three tries.

    `first`: also with an empty cache of kernels.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _start(version, folder)  # makes the database, and compiles what this checkout has not compiled yet
        starts, memory = zip(*(_start(version, folder) for _ in range(_TRIES)), strict=True)
        listing = ("keys", "list", "--database", str(_database(folder)))
        found: Figures = {
            "start_seconds": min(starts),
            "idle": min(megabytes for megabytes, _ in memory),
            "idle_own": min(own for _, own in memory),
            "version_seconds": min(_seconds_of(version, "--version") for _ in range(_TRIES)),
            "keys_seconds": min(_seconds_of(version, *listing) for _ in range(_TRIES)),
        }
    sizes = installed_sizes(version.folder / "pyproject.toml")
    found["installed_mb"] = sum(sizes.values())
    found["packages"] = dict(sorted(sizes.items(), key=lambda entry: -entry[1]))
    if first:
        with tempfile.TemporaryDirectory() as name, tempfile.TemporaryDirectory() as cache:
            found["first_start_seconds"] = _start(version, Path(name), **{_CACHE: cache})[0]
    return found


def measure_kernels(version: Version) -> Figures:
    """Seconds and megabytes of a process until it can search: the quickest of three tries after one that compiles."""
    command = [sys.executable, str(_KERNELS)]
    tries: list[Figures] = []
    for _ in range(1 + _TRIES):
        said = subprocess.run(command, cwd=version.folder, env=version.environment, check=True, capture_output=True)
        tries.append(json.loads(said.stdout))
    return min(tries[1:], key=lambda found: sum(step["seconds"] for step in found.values()))


def _seconds_of(version: Version, *arguments: str) -> float:
    """Seconds of a command of a version."""
    began = time.perf_counter()
    command = [sys.executable, *_AS_INSTALLED, *arguments]
    environment = version.environment | _modules(version)
    subprocess.run(command, cwd=version.folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def _database(folder: Path) -> Path:
    return folder / "empty.db"


def _start(version: Version, folder: Path, **settings: str) -> tuple[float, tuple[float, float]]:
    """Seconds until a service on an empty database is ready, and its megabytes then: resident, and its own of them."""
    code = OtherCode(version.folder, _AS_INSTALLED)
    with served(_database(folder), folder / "log", code, **_modules(version), **settings) as server:
        status = Path(f"/proc/{server.process.pid}/status").read_text(encoding="utf-8")
        resident = re.search(r"VmRSS:\s*(\d+)", status)
        if resident is None:
            raise RuntimeError("the kernel does not tell the memory of the service")
        return server.ready_seconds, (int(resident[1]) * 1024 / 1e6, server.megabytes())


def installed_sizes(project: Path) -> dict[str, float]:
    """Megabytes of each package that the project of a pyproject.toml needs, with those that they need, extras apart."""
    sizes = {}
    for name, package in _installed(project).items():
        paths = [Path(str(path.locate())) for path in package.files or []]
        sizes[name] = sum(path.stat().st_size for path in paths if path.is_file()) / 1e6
    return sizes


def _modules(version: Version) -> dict[str, str]:
    """For `as_installed`: the names of the modules of these packages, and ours."""
    names = {*_OURS}
    for package in _installed(version.folder / "pyproject.toml").values():
        names |= {path.parts[0].partition(".")[0] for path in package.files or []}
    return {PACKAGES: " ".join(sorted(names))}


def _installed(project: Path) -> dict[str, Distribution]:
    """The packages by name."""
    with project.open("rb") as file:
        wanted = [*tomllib.load(file)["project"]["dependencies"]]
    seen = dict[str, Distribution]()
    while wanted:
        requirement = wanted.pop()
        match = _NAME.match(requirement)
        if match is None or "extra ==" in requirement or match[0].lower() in seen:
            continue
        try:
            seen[match[0].lower()] = distribution(match[0])
        except PackageNotFoundError:
            continue  # for another Python or system
        wanted += seen[match[0].lower()].requires or []
    return seen
