"""What a process spends before its first search: a program that each version runs in its own folder.

Without imports of this package, because an older commit does not have it. It prints seconds and resident megabytes of
each step as JSON. The steps are the compiler's import, the import of the method, and the kernels with the searches that
load them.
"""

import json
import re
import time
from pathlib import Path


def resident() -> float:
    """Resident megabytes of this process."""
    found = re.search(r"VmRSS:\s*(\d+)", Path("/proc/self/status").read_text(encoding="utf-8"))
    return int(found[1]) * 1024 / 1e6 if found is not None else 0.0


def main() -> None:
    """Take the steps one after the other. The kernels are loaded from the cache, or compiled if they are not in it."""
    costs: dict[str, dict[str, float]] = {}

    def took(step: str, since: float, before: float) -> tuple[float, float]:
        costs[step] = {"seconds": time.perf_counter() - since, "megabytes": resident() - before}
        return time.perf_counter(), resident()

    now = time.perf_counter(), resident()
    import numpy  # noqa: F401
    import scipy.spatial  # noqa: F401

    now = took("arrays", *now)
    import numba  # noqa: F401

    now = took("compiler", *now)
    import urquhart
    import urquhart.recognizer

    now = took("method", *now)
    urquhart.warm_up(urquhart.Config())
    took("kernels", *now)
    print(json.dumps(costs))


if __name__ == "__main__":
    main()
