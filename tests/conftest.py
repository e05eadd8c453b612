"""Lanes of tests, by where a test lies and what its module starts; and how many tests run at once.

`unit`: the method, without a process or a connection. `service`: the service and its client in this process. `system`:
processes that are started, signalled and killed. `statistical`: small versions of the benchmarks.
"""

import logging
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

LANES = {"urquhart": "unit", "server": "service", "client": "service", "benchmarks": "statistical"}
"""By folder; what lies in none of them is `unit`."""
PROCESSES = {
    *("Server", "Served", "Forked", "LoadedProcess", "killed_at_every_step", "job_helpers", "subprocess"),
    "multiprocessing",
}
"""Names for means to start a process: whatever module of tests holds one of them is in the lane `system`."""
CONNECTED = frozenset({"subprocess.Popen", "os.fork", "os.posix_spawn", "socket.bind", "socket.connect"})
"""Audit events that no test in the lane `unit` may cause."""

_ROOT = Path(__file__).parent
_seen: list[str] | None = None


def pytest_xdist_auto_num_workers() -> int:
    """Three times as many as cores: many tests wait for a process, a deadline or a disk most of their time."""
    return 3 * (os.cpu_count() or 1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put every test in its lane."""
    for item in items:
        lane = LANES.get(item.path.relative_to(_ROOT).parts[0], "unit")
        module = item.getparent(pytest.Module)
        if lane != "statistical" and module is not None and not PROCESSES.isdisjoint(vars(module.obj)):
            lane = "system"
        item.add_marker(lane)


@pytest.fixture(autouse=True)
def _unit_stands_alone(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test in the lane `unit` fails if it starts a process or opens a connection."""
    global _seen
    if request.node.get_closest_marker("unit") is None:
        yield
        return
    _seen = []
    try:
        yield
        assert not _seen, f"a unit test caused {_seen}"
    finally:
        _seen = None


@pytest.fixture(autouse=True)
def _loggers_as_before() -> Iterator[None]:
    """A test that configures the log sends no later test's lines to its own, closed stream."""
    known = [logging.getLogger(name) for name in (None, "uvicorn", "uvicorn.error", "uvicorn.asgi", "uvicorn.access")]
    before = [(one, [*one.handlers], one.level, one.propagate) for one in known]
    yield
    for one, handlers, level, propagate in before:
        one.handlers[:], one.propagate = handlers, propagate
        one.setLevel(level)


def _watch(event: str, _: tuple[object, ...]) -> None:
    if _seen is not None and event in CONNECTED:
        _seen.append(event)


sys.addaudithook(_watch)
