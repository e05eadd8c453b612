"""The one way kernels are compiled: cached on disk, without the GIL, with IEEE arithmetic.

No fast-math: two triangles must find the same length for the edge they share.
"""

from collections.abc import Callable
from typing import Final, ParamSpec, TypeVar, cast

from numba import njit
from numba.core.dispatcher import Dispatcher

P = ParamSpec("P")
R = TypeVar("R")
_KERNELS: Final[list[Dispatcher]] = []


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; keep its type for the checker."""
    dispatcher = njit(cache=True, nogil=True, error_model="numpy")(function)
    _KERNELS.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


def count_kernels() -> tuple[int, int]:
    """Number of kernels that this process has compiled or loaded from the cache, and number of all kernels."""
    return sum(bool(dispatcher.signatures) for dispatcher in _KERNELS), len(_KERNELS)
