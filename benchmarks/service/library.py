"""The library alone, in the version of the folder that it is run in: queries are numbers on standard input.

A program without imports of this package, because an older commit does not have it.
"""

import json
import sys
import time

import numpy as np

from urquhart import Config, Recognizer, describe, warm_up


def main() -> None:
    """Build an index of the submaps in a file, then answer `first count` with the milliseconds of so many queries."""
    warm_up(Config())
    recognizer = Recognizer(Config())
    with np.load(sys.argv[1]) as stored:
        submaps = np.split(stored["submaps"], stored["submap_offsets"][1:-1])
        queries = np.split(stored["queries"], stored["query_offsets"][1:-1])
    recognizer.add((key, describe(xy, Config())) for key, xy in enumerate(submaps))
    # Before 0.2.0 `recognize` took landmarks.
    ask = getattr(recognizer, "locate" if hasattr(recognizer, "locate") else "recognize")
    print("[]", flush=True)
    for line in sys.stdin:
        first, count = map(int, line.split())
        spent = []
        for number in range(first, first + count):
            wall, cpu = time.perf_counter(), time.process_time()
            ask(queries[number % len(queries)], limit=5)
            spent.append({"wall": 1e3 * (time.perf_counter() - wall), "cpu": 1e3 * (time.process_time() - cpu)})
        print(json.dumps(spent), flush=True)


if __name__ == "__main__":
    main()
