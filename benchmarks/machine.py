"""The machine that made the figures: every published one says it."""

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

LIBRARIES: Final = ("numpy", "scipy", "numba", "faiss-cpu")
"""Those that do the work of the method."""
ROOT: Final = Path(__file__).parents[1]
CODE: Final = ("urquhart", "server", "benchmarks")
"""Folders that figures depend on."""


def machine(*others: str) -> dict[str, Any]:
    """Processor, cores, Python and the versions of the libraries that do the work, `others` included."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in (*LIBRARIES, *others)},
    }


def commit() -> str | None:
    """The commit of this checkout, with `-dirty` where its code differs from it; None where there is no git."""
    try:
        head, changed = (
            subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
            for words in (("rev-parse", "--short=7", "HEAD"), ("status", "--porcelain", "-uno", "--", *CODE))
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return f"{head}-dirty" if changed else head


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
