"""What threads may take: one core each, and less than requests if their work can wait.

Thread pools of OpenMP (FAISS) and BLAS would only compete with other requests.
"""

import os
import threading
from functools import cache
from typing import Final

from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

_pinned = threading.local()

_BACKGROUND: Final = 10
"""Niceness of threads whose work can wait: where cores are short, they get a tenth of what a request gets."""


def pin_threads() -> None:
    """Limit the numerical libraries to one thread in the calling thread.

    OpenMP has a limit for each calling thread, so every thread that computes must call this. Repeated calls cost
    nothing.
    """
    if not getattr(_pinned, "done", False):
        _controller().limit(limits=1)
        _pinned.done = True


def run_in_background() -> None:
    """Let requests go before the work of the calling thread, and of the threads and processes that it starts.

    The rest of the process keeps its priority, because Linux has one for each thread.
    """
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _BACKGROUND)


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
