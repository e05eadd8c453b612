"""Timing: medians of repeated calls, and pairs of calls in turn where a ratio is wanted."""

import time
from collections.abc import Callable
from statistics import median


def milliseconds(call: Callable[[], object], repeats: int) -> float:
    """Median time of one call, milliseconds, after one call that does not count."""
    call()
    return median(_once(call) for _ in range(repeats))


def side_by_side(first: Callable[[], object], second: Callable[[], object], repeats: int) -> tuple[float, float, float]:
    """Median times of two calls made in turn, milliseconds, and the median of the ratios first / second pair by pair.

    Taking turns lets both see the same machine, whatever else it is doing.
    """
    first()
    second()
    pairs = [(_once(first), _once(second)) for _ in range(repeats)]
    return median(a for a, _ in pairs), median(b for _, b in pairs), median(a / b for a, b in pairs)


def _once(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return (time.perf_counter() - start) * 1e3
