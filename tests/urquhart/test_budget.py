"""Budgets: a deadline, and work that nobody waits for."""

import math
import threading

import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import Config, Recognizer, describe
from urquhart.budget import Abandoned, Budget, DeadlinePassed
from urquhart.options import Method


def test_without_a_deadline_it_is_never_spent() -> None:
    budget = Budget()
    assert not budget.is_spent()
    assert budget.remaining == math.inf


def test_it_is_spent_at_its_deadline() -> None:
    budget = Budget(0.0)
    assert budget.is_spent()
    assert budget.remaining == 0.0


def test_another_thread_can_abandon_it() -> None:
    budget = Budget()
    thread = threading.Thread(target=budget.abandon)
    thread.start()
    thread.join()
    with pytest.raises(Abandoned):
        budget.is_spent()


def test_a_part_ends_with_the_whole_and_not_after_its_own_time() -> None:
    assert Budget(0.0).within(100.0).is_spent()
    whole = Budget(100.0)
    assert whole.within(0.0).is_spent()
    assert not whole.within(50.0).is_spent()
    assert whole.within(1000.0).remaining <= 100.0


@pytest.mark.parametrize("which", ["whole", "part"])
def test_part_and_whole_are_abandoned_together(which: str) -> None:
    whole = Budget()
    part = whole.within(100.0)
    (whole if which == "whole" else part).abandon()
    for budget in (whole, part, whole.within(0.0)):
        with pytest.raises(Abandoned):
            budget.is_spent()


def test_it_tells_how_long_ago_it_began() -> None:
    whole = Budget()
    assert 0.0 <= whole.within(1.0).elapsed <= whole.elapsed


def test_work_in_small_items_asks_now_and_then() -> None:
    budget = Budget()
    items = budget.each(range(5_000))
    assert list(zip(items, range(1_500), strict=False))[-1] == (1_499, 1_499)
    budget.abandon()
    with pytest.raises(Abandoned):
        list(items)
    with pytest.raises(DeadlinePassed):
        list(Budget(0.0).each(range(1)))


@pytest.mark.parametrize("method", ["robust", "paper"])
def test_what_cannot_be_described_in_time_is_answered_at_the_deadline(method: Method) -> None:
    xy = forests.uniform(np.random.default_rng(0))
    with pytest.raises(DeadlinePassed):
        describe(xy, Config(), budget=Budget(0.0))
    recognizer = Recognizer(Config())
    recognizer.add([(1, describe(xy, Config()))])
    late = recognizer.locate(xy, method=method, budget=Budget(0.0))
    assert (late.verdict, late.reason, late.candidates) == ("no_match", "deadline", ())
    assert (late.search.stopped_by, [stage.name for stage in late.stages]) == ("deadline", ["describe"])
