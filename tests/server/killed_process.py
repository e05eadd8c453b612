"""Processes that are killed at a point which they reach: what the tests of a kill at every point share."""

import os
import signal
import sys
from collections.abc import Callable
from typing import Any


def in_a_process(work: Callable[[], None]) -> int:
    """Do it in a copy of this process; its exit code, negative for a signal."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            sys.stdout.flush()
            code = 0
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, -signal.SIGKILL), code
    return code


class KillPoints:
    """The points that this process reaches. It is killed at the one of that number; with 0, at none."""

    def __init__(self, point: int, note: Callable[[str], object]) -> None:
        """`note`: takes the kind of each point that is reached."""
        self._left, self._note = point, note

    def reached(self, kind: str) -> None:
        """The process is at a point of this kind."""
        self._left -= 1
        self._note(kind)
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function with a point before it and one after it."""

        def called(*arguments: Any, **named: Any) -> Any:
            self.reached(f"before {function.__name__}")
            result = function(*arguments, **named)
            self.reached(f"after {function.__name__}")
            return result

        return called
