"""The figures of the service are of what they say: every answer is the library's, every submap is stored."""

import numpy as np

from benchmarks.everyday import Forest, build
from benchmarks.http_overhead import bulk_rate, http_cost


def test_over_http_the_answers_are_the_librarys() -> None:
    rng = np.random.default_rng(0)
    forest = Forest.grow(250.0, rng)
    recognizer, _, _ = build(forest)
    cost = http_cost(recognizer, forest, rng, sigma=0.1, detection=0.95, asked=5)
    assert (cost.agreed, cost.asked) == (5, 5)
    assert cost.answer_bytes > 1000


def test_bulk_stores_all_of_them() -> None:
    rate = bulk_rate(Forest.grow(250.0, np.random.default_rng(1)), 1100, processes=1)
    assert (rate.submaps, rate.processes) == (1100, 1)
    assert rate.overall > 0 and rate.sustained > 0
