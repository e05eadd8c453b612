"""What else the machine did meanwhile: times are only worth something where that is next to nothing."""

import os
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.scale.measurement import Figures


@contextmanager
def watched(figures: Figures) -> Iterator[None]:
    """Put into `figures` how long the block took (`spent_seconds`), and how many cores on average were busy meanwhile
    with something that neither this process nor any that it started and waited for did (`others`).
    """
    started, busy, own = time.perf_counter(), _busy_seconds(), _own_seconds()
    yield
    spent = time.perf_counter() - started
    figures["spent_seconds"] = spent
    figures["others"] = max(0.0, (_busy_seconds() - busy) - (_own_seconds() - own)) / spent


def _busy_seconds() -> float:
    """Of all cores since the machine was started, time that its host took away from it included."""
    line = Path("/proc/stat").read_text(encoding="utf-8").partition("\n")[0]
    user, nice, system, _idle, _waiting, irq, soft, stolen = (int(field) for field in line.split()[1:9])
    return (user + nice + system + irq + soft + stolen) / os.sysconf("SC_CLK_TCK")


def _own_seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)
