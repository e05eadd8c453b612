"""One thread for each request: thread pools of OpenMP (FAISS) and BLAS would only compete with other requests."""

import threading
from functools import cache

from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

_pinned = threading.local()


def pin_threads() -> None:
    """Limit the numerical libraries to one thread in the calling thread.

    OpenMP has a limit for each calling thread, so every thread that computes must call this. Repeated calls cost
    nothing.
    """
    if not getattr(_pinned, "done", False):
        _controller().limit(limits=1)
        _pinned.done = True


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
