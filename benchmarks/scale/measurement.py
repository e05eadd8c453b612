"""One measurement of one size: what it is told, and what all of them use."""

import json
import os
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

Figures = dict[str, Any]
_EVERY: Final = 10.0
"""Seconds between two lines of progress."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """A part, of a size.

    Attributes:
        part: its name; see `measurement_plan.PARTS`.
        submaps: how many there are.
        folder: where everything of this size lies.
        asked: how many queries; 0 where none are asked.
        seed: of all randomness.
        workers: processes where several work together.
        forest: what is stored; see `tiled_forest.FORESTS`.
    """

    part: str
    submaps: int
    folder: str
    asked: int
    seed: int
    workers: int
    forest: str = "paper"

    @property
    def room(self) -> Path:
        """The folder of this size."""
        return Path(self.folder)

    @property
    def submaps_name(self) -> str:
        """Under what the observations that are stored are written."""
        return "submaps" if self.forest == "paper" else f"{self.forest}-submaps"

    @property
    def database(self) -> Path:
        """The database of this size and forest."""
        return self.room / ("scale.sqlite" if self.forest == "paper" else f"{self.forest}.sqlite")

    def to_json(self) -> str:
        """The measurement as another process reads it."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Measurement":
        """What `to_json` wrote."""
        return Measurement(**json.loads(text))


class Steps:
    """Lines of progress: the first at once when it takes long, then one every few seconds."""

    def __init__(self, title: str, total: int) -> None:
        self._title, self._total, self._told = title, total, time.monotonic()

    def done(self, count: int) -> None:
        """So many are done."""
        if time.monotonic() - self._told >= _EVERY:
            self._told = time.monotonic()
            print(f"    {self._title}: {count:,} of {self._total:,}", flush=True)


def memory() -> Figures:
    """Megabytes that this process has in memory: all of it, its own, and of files that can be read again."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    found = {name: rest for name, _, rest in (line.partition(":") for line in lines)}
    return {
        short: int(found[name].split()[0]) * 1024 / 1e6
        for short, name in (("resident", "VmRSS"), ("own", "RssAnon"), ("files", "RssFile"), ("most", "VmHWM"))
    }


def seconds_alive() -> float:
    """Seconds since this process was started."""
    # Fields are counted from behind the name, which may hold anything; the start is the 22nd of all.
    fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    up = float(Path("/proc/uptime").read_text(encoding="utf-8").split()[0])
    return up - int(fields[19]) / os.sysconf("SC_CLK_TCK")


def spread(milliseconds: list[float]) -> Figures:
    """Median and tail of times."""
    p50, p95, p99 = np.percentile(milliseconds, (50, 95, 99)).tolist()
    return {"p50": p50, "p95": p95, "p99": p99}
