"""Long work pauses for short requests, never for long ones, and keeps half of its speed. Few work at a time."""

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context

import pytest

from server.platform import precedence
from server.platform.precedence import Pace, Precedence, give_way_by, turn
from urquhart import Budget


class Clock:
    """Time that passes only in pauses, or when a test says so."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = self.paused = 0.0
        monkeypatch.setattr(precedence, "time", self)
        monkeypatch.setattr(Precedence, "_wait", lambda _, seconds: self.wait(seconds))

    def monotonic(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.paused += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_a_job_pauses_for_a_short_request_and_not_without_one(clock: Clock) -> None:
    short, give_way = object(), (requests := Precedence()).pace()
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
    give_way, job = requests.pace(long), requests.pace()
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
    give_way = requests.pace()
    worked = 0.0
    for _ in range(100):
        requests.enter(object())
        clock.now += 0.005
        worked += 0.005
        give_way()
    assert clock.paused == pytest.approx(worked, rel=0.2)


def test_nothing_pauses_on_the_event_loop(clock: Clock) -> None:
    requests = Precedence()
    give_way = requests.pace()
    requests.enter(object())
    clock.now = 0.01

    async def on_the_loop() -> None:
        give_way()

    asyncio.run(on_the_loop())
    assert clock.paused == 0.0
    give_way()
    assert clock.paused > 0.0


def test_a_pause_ends_when_the_last_short_request_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(precedence, "_SHORT", 3600.0)
    monkeypatch.setattr(precedence, "_LONGEST", 3600.0)
    requests, short = Precedence(), object()
    give_way = requests.pace()
    monkeypatch.setattr(give_way, "_since", time.monotonic() - 3600.0)
    requests.enter(short)
    with ThreadPoolExecutor(1) as threads:
        paused = threads.submit(give_way)
        time.sleep(0.05)
        assert not paused.done()
        requests.leave(short)
        paused.result(60.0)


class Crowd:
    """Requests that work at the same time, each in a thread and a context of its own."""

    def __init__(self, requests: Precedence, count: int) -> None:
        self.working = self.most = 0
        self._lock = threading.Lock()
        self._paces = [requests.pace(request) for request in (object() for _ in range(count))]

    def work(self) -> None:
        with ThreadPoolExecutor(len(self._paces)) as threads:
            list(threads.map(lambda pace: copy_context().run(self._one, pace), self._paces))

    def _one(self, pace: Pace) -> None:
        give_way_by(pace)
        with turn(), turn():  # the second is the same one
            with self._lock:
                self.working += 1
                self.most = max(self.most, self.working)
            time.sleep(0.002)
            with self._lock:
                self.working -= 1


def test_no_more_work_at_a_time_than_there_are_turns() -> None:
    crowd = Crowd(Precedence(turns=2), 8)
    crowd.work()
    assert 1 <= crowd.most <= 2
    assert crowd.working == 0


def test_work_begins_with_the_turn_and_long_work_returns_it(clock: Clock) -> None:
    requests = Precedence(turns=1)
    long, waiting = object(), object()
    requests.enter(long)
    pace = requests.pace(long)
    clock.now = 1.0
    assert pace.begin()
    pace()
    assert clock.paused == 0.0  # it has waited for a second, and not worked
    clock.now = 1.04
    requests.enter(waiting)
    clock.now = 1.06
    pace()
    assert clock.paused > 0.0  # long by now: others have turns, and go first
    assert requests.pace(waiting).begin()
    pace.end()  # it has none to return
    with ThreadPoolExecutor(1) as threads:
        third = threads.submit(requests.pace(object()).begin)
        time.sleep(0.02)
        assert not third.done()
        requests.return_turn()
        assert third.result(60.0)


def test_a_job_takes_no_turn() -> None:
    requests = Precedence(turns=1)
    assert not requests.pace().begin()
    assert requests.pace(object()).begin()


def test_a_budget_gives_way_at_every_check_also_in_its_parts() -> None:
    calls = list[float]()
    budget = Budget(give_way=lambda: calls.append(time.monotonic()))
    assert not budget.is_spent()
    budget.within(10.0).check()
    assert [*budget.portions(2, 1e9)]
    assert len(calls) == 4
