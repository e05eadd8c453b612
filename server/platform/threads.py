"""One request, one core: thread pools of OpenMP (FAISS) and BLAS of one request only fight with those of others."""

import threading
from functools import cache

from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

_pinned = threading.local()


def pin_threads() -> None:
    """Hold the calling thread's numerical libraries to one thread.

    OpenMP keeps its number per calling thread, so every thread that computes has to say so; later calls cost nothing.
    """
    if not getattr(_pinned, "done", False):
        _controller().limit(limits=1)
        _pinned.done = True


@cache
def _controller() -> ThreadpoolController:
    import faiss  # noqa: F401  loaded first, so that the controller finds its OpenMP

    return ThreadpoolController()
