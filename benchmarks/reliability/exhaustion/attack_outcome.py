"""What an attack gets: answers by status, and how long the longest took."""

import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import httpx

from benchmarks.experiments import Figures


@dataclass
class AttackOutcome:
    """What the attacker was answered.

    Attributes:
        statuses: requests by what they got.
        longest: seconds of the longest request.
        more: what else is worth telling, by name.
    """

    statuses: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    more: Figures = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def requests(self) -> int:
        """How many were sent."""
        return self.statuses.total()

    def send(self, ask: Callable[[], httpx.Response], *, counts: bool = True) -> httpx.Response | None:
        """Send one request and enter what it got; `counts` whether its time does. None where no answer came."""
        began = time.perf_counter()
        response: httpx.Response | None = None
        try:
            response = ask()
            status = str(response.status_code)
        except httpx.TransportError as error:
            status = type(error).__name__
        spent = time.perf_counter() - began
        with self._lock:
            self.statuses[status] += 1
            if counts:
                self.longest = max(self.longest, spent)
        return response


def give_way() -> None:
    """Give the calling thread, and those that it starts, the lowest priority."""
    if sys.platform == "linux":  # elsewhere the priority is that of the process, which has the robot in it, too
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)


def at_once(callers: int, until: float, ask: Callable[[int], object]) -> None:
    """So many callers who each ask again and again until that moment (`time.monotonic`), and at least once."""

    def work(number: int) -> None:
        ask(number)
        while time.monotonic() < until:
            ask(number)

    threads = [threading.Thread(target=work, args=(number,), daemon=True) for number in range(callers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
