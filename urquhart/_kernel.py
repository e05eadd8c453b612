"""The one way kernels are compiled: cached on disk, without the GIL, with IEEE arithmetic.

No fast-math: two triangles must find the same length for the edge they share.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call; keep its type for the checker."""
    return cast(Callable[P, R], njit(cache=True, nogil=True, error_model="numpy")(function))
