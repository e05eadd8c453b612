"""What worker processes do in the tests, and how they are waited for; light to load, so that they start at once."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from server.errors import TooLarge
from server.platform.process_pool import IsolationPolicy, PoolTask, ProcessPool


class Unsendable(Exception):
    """Cannot be built from its own arguments."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(one + two)


def load() -> None:
    """Nothing to load."""


def fail_to_load() -> None:
    """A process that cannot begin."""
    raise SystemExit(7)


def square(number: int) -> tuple[int, int]:
    """The square, and the process it was made in; 0 takes longer than the others."""
    if number == 0:
        time.sleep(0.3)
    return number * number, os.getpid()


def large(number: int) -> bytes:
    """More than fits into a pipe."""
    return bytes([number]) * 3_000_000


def length(blob: bytes) -> bytes:
    """A large one for a large one."""
    return blob * 2


def refuse(number: int) -> int:
    """Refuses 3, and 5 in a way that cannot be sent."""
    if number == 3:
        raise TooLarge("landmarks", 3, number, "Take fewer.")
    if number == 5:
        raise Unsendable("five ", "is odd")
    return number


def unsendable(number: int) -> Callable[[], int]:
    """A result that cannot be sent."""
    return lambda: number


def hang(path: str) -> None:
    """Say which process this is, and work for ever."""
    Path(path).write_text(str(os.getpid()))
    time.sleep(600)


SQUARES: PoolTask[int, int, tuple[int, int]] = PoolTask(square, int, square)
REFUSALS: PoolTask[int, int, int] = PoolTask(refuse, int, refuse)
UNSENDABLE: PoolTask[int, int, Callable[[], int]] = PoolTask(unsendable, int, unsendable)
LARGE: PoolTask[int, bytes, bytes] = PoolTask(lambda number: length(large(number)), large, length)


def until(condition: Callable[[], bool]) -> None:
    """Wait for something, a minute at most."""
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def start(workers: ProcessPool) -> None:
    """Wait until each of the processes works."""
    until(lambda: {pid for _, pid in workers.map(SQUARES, [1, 1, 1, 1])} >= set(workers.pids) != set())


def gone(pid: int) -> bool:
    """Whether a process is no more."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    status = Path(f"/proc/{pid}/stat")
    # One that has ended, and nobody has asked how.
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z"


def hostile(numbers: list[int]) -> list[int]:
    """What they are; 13 ends the process, 17 takes for ever, 19 needs more memory than there is."""
    if 13 in numbers:
        os.kill(os.getpid(), signal.SIGKILL)
    if 17 in numbers:
        time.sleep(600)
    if 19 in numbers:
        bytearray(1 << 46)
    return numbers


HOSTILE: PoolTask[list[int], list[int], list[int]] = PoolTask(
    hostile,
    list,
    hostile,
    IsolationPolicy(
        is_light=lambda numbers: not {13, 17, 19} & set(numbers),
        singles=lambda numbers: [[number] for number in numbers],
        refuse=lambda numbers, why: [-number for number in numbers],
        seconds=1.0,
    ),
)
