"""Budgets: a deadline, and work that nobody waits for."""

import math
import threading

import pytest

from urquhart.budget import Abandoned, Budget


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
