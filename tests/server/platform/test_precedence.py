"""Long work pauses for short requests, never for long ones, and keeps half of its speed."""

import asyncio
import time

import pytest

from server.platform import precedence
from server.platform.precedence import Precedence
from urquhart import Budget


class Clock:
    """Time that passes only in pauses, or when a test says so."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = self.paused = 0.0
        monkeypatch.setattr(precedence, "time", self)

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.paused += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_a_job_pauses_for_a_short_request_and_not_without_one(clock: Clock) -> None:
    short, give_way = object(), (requests := Precedence()).pauses()
    clock.now = 1.0
    give_way()
    assert clock.paused == 0.0
    requests.enter(short)
    clock.now += 0.01
    give_way()
    assert 0.0 < clock.paused <= 0.011
    requests.leave(short)
    clock.now, clock.paused = clock.now + 0.01, 0.0
    give_way()
    assert clock.paused == 0.0


def test_long_requests_pause_and_nobody_pauses_for_them(clock: Clock) -> None:
    long, requests = object(), Precedence()
    requests.enter(long)
    give_way, job = requests.pauses(long), requests.pauses()
    clock.now = 0.04
    requests.enter(short := object())
    give_way()
    assert clock.paused == 0.0  # it is short itself
    clock.now = 0.08
    give_way()
    assert clock.paused > 0.0
    requests.leave(short)
    clock.now, clock.paused = 1.0, 0.0
    job()
    assert clock.paused == 0.0


def test_long_work_keeps_half_of_its_speed_however_many_ask(clock: Clock) -> None:
    requests = Precedence()
    give_way = requests.pauses()
    worked = 0.0
    for _ in range(100):
        requests.enter(object())
        clock.now += 0.005
        worked += 0.005
        give_way()
    assert clock.paused == pytest.approx(worked, rel=0.2)


def test_nothing_pauses_on_the_event_loop(clock: Clock) -> None:
    requests = Precedence()
    give_way = requests.pauses()
    requests.enter(object())
    clock.now = 0.01

    async def on_the_loop() -> None:
        give_way()

    asyncio.run(on_the_loop())
    assert clock.paused == 0.0
    give_way()
    assert clock.paused > 0.0


def test_a_budget_gives_way_at_every_check_also_in_its_parts() -> None:
    calls = list[float]()
    budget = Budget(give_way=lambda: calls.append(time.monotonic()))
    assert not budget.is_spent()
    budget.within(10.0).check()
    assert [*budget.portions(2, 1e9)]
    assert len(calls) == 4
