"""The machine that made the figures: every published one says it."""

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

LIBRARIES: Final = ("numpy", "scipy", "numba", "faiss-cpu")
"""Those that do the work of the method."""


def machine(*others: str) -> dict[str, Any]:
    """Processor, cores, Python and the versions of the libraries that do the work, `others` included."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in (*LIBRARIES, *others)},
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
