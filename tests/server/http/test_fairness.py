"""Many requests of one caller do not shut out the others, and end with its key."""

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.config.settings import Limits
from server.errors import Overloaded
from server.http.admission.fair_queue import FairQueue
from server.security import api_keys
from server.security.principal import Scope
from tests.server.factories import put_submap
from tests.server.http.test_disconnect import ASK, BATCH, QUERY, Searches
from tests.server.served import PATIENCE, Start, Threaded, starting, wait_until
from urquhart import Features, Recognition, Recognizer

# --------------------------------------------------------------------- the fair_queue


class Visits:
    """Callers at a fair_queue, in the order in which they were let in."""

    def __init__(self, **limits: float) -> None:
        self.now = 0.0
        self.fair_queue = FairQueue(Limits.model_validate({"queue_seconds": 100, **limits}), clock=lambda: self.now)
        self.inside: list[str] = []
        self.refused: list[str] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def arrive(self, name: str, count: int = 1) -> None:
        """So many requests of one caller."""
        self._tasks += [asyncio.create_task(self._visit(name)) for _ in range(count)]
        await asyncio.sleep(0.01)

    async def leave(self, name: str, seconds: float) -> None:
        """One of them is done."""
        self.inside.remove(name)
        self.fair_queue.leave(name, seconds)
        await asyncio.sleep(0.01)

    def end(self) -> None:
        """Nobody waits any more."""
        for task in self._tasks:
            task.cancel()

    async def _visit(self, name: str) -> None:
        try:
            await self.fair_queue.enter(name, asyncio.get_running_loop().create_future())
        except Overloaded:
            self.refused.append(name)
            return
        self.inside.append(name)


def test_a_caller_that_is_alone_leaves_room_for_the_next_one() -> None:
    async def scenario() -> None:
        visits = Visits(concurrent_requests=8, queued_requests=100)
        await visits.arrive("many", 50)
        assert visits.inside == ["many"] * 6
        await visits.arrive("one")
        assert visits.inside[-1] == "one"
        visits.end()

    asyncio.run(scenario())


def test_while_others_ask_each_caller_has_its_share_only() -> None:
    async def scenario() -> None:
        visits = Visits(concurrent_requests=8, key_requests=2, queued_requests=100)
        await visits.arrive("one")
        await visits.leave("one", 0.01)
        await visits.arrive("many", 50)
        assert visits.inside == ["many"] * 2
        await visits.arrive("one", 3)
        assert visits.inside == ["many"] * 2 + ["one"] * 2
        # Nobody else for a while: there is no reason to let places be idle.
        for _ in range(2):
            await visits.leave("one", 0.01)
        await visits.leave("one", 0.01)
        visits.now += 11.0
        await visits.leave("many", 5.0)
        assert visits.inside == ["many"] * 6
        visits.end()

    asyncio.run(scenario())


def test_who_has_used_less_is_next() -> None:
    async def scenario() -> None:
        visits = Visits(concurrent_requests=1, queued_requests=100)
        await visits.arrive("heavy", 10)
        await visits.arrive("light", 10)
        order = []
        for _ in range(11):
            name = visits.inside[0]
            order.append(name)
            await visits.leave(name, 5.0 if name == "heavy" else 0.1)
        assert order == ["heavy"] + ["light"] * 10
        visits.end()

    asyncio.run(scenario())


def test_where_the_queue_is_full_the_one_with_most_requests_in_it_is_refused() -> None:
    async def scenario() -> None:
        visits = Visits(concurrent_requests=1, queued_requests=4)
        await visits.arrive("many", 10)
        assert visits.refused == ["many"] * 5
        await visits.arrive("one", 2)
        assert visits.refused == ["many"] * 7
        assert visits.fair_queue.waiting == 4
        visits.end()

    asyncio.run(scenario())


def test_callers_are_forgotten() -> None:
    async def scenario() -> None:
        visits = Visits(concurrent_requests=1)
        for number in range(100):
            await visits.fair_queue.enter(str(number), asyncio.get_running_loop().create_future())
            visits.fair_queue.leave(str(number), 1.0)
            visits.now += 1.0
        assert len(visits.fair_queue._callers) < 70

    asyncio.run(scenario())


# ------------------------------------------------------------------ the service


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server with the limits that are given, whose keys are asked for; `plots` has the submap `p`."""
    with starting(tmp_path, lambda server: put_submap(server.client, "plots", "p", 1).raise_for_status()) as start:
        yield start


def key_of(server: Threaded, name: str) -> tuple[str, dict[str, str]]:
    """A new key: its id, and the header that carries it."""
    made, info = api_keys.make(server.service.database, name, [Scope.READ], ["*"])
    return info.id, {"Authorization": f"Bearer {made}"}


def only_of(monkeypatch: pytest.MonkeyPatch, points: int) -> Searches:
    """Searches of queries with so many points go on until their budget ends them; the others are answered."""
    searches, search = Searches(), Recognizer.recognize

    def recognize(recognizer: Recognizer, observation: Features, **options: Any) -> Recognition:
        is_one = options.get("budget") is not None and len(observation.landmarks) == points
        return (searches if is_one else search)(recognizer, observation, **options)

    monkeypatch.setattr(Recognizer, "recognize", recognize)
    return searches


def background(work: Callable[[], httpx.Response], count: int) -> tuple[list[threading.Thread], list[int]]:
    """Do it in threads; the statuses of what is answered."""
    statuses: list[int] = []
    threads = [threading.Thread(target=lambda: statuses.append(work().status_code)) for _ in range(count)]
    for thread in threads:
        thread.start()
    return threads, statuses


def test_others_are_answered_beside_many_requests_of_one_key_which_end_when_it_is_revoked(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = start(concurrent_requests=8, queue_seconds=PATIENCE, query_seconds=PATIENCE, batch_seconds=PATIENCE)
    fair_queue = server.service.fair_queue
    greedy_id, greedy = key_of(server, "greedy")
    _, modest = key_of(server, "modest")
    time.sleep(1.1)  # until it is known that there are keys
    endless = only_of(monkeypatch, 10)
    body = {"queries": [{"xy": QUERY["xy"][:10]}] * 200}
    flood, statuses = background(
        lambda: httpx.post(f"{server.url}{ASK}/batch", json=body, headers=greedy, timeout=PATIENCE), 40
    )
    wait_until(lambda: fair_queue.running + fair_queue.waiting == 40)
    for _ in range(3):
        answer = httpx.post(f"{server.url}{ASK}", json=QUERY, headers=modest, timeout=PATIENCE)
        assert (answer.status_code, answer.json()["verdict"]) == (200, "matched")
    load = httpx.get(f"{server.url}/readyz").json()["load"]
    assert load["in_flight"] <= 6
    assert (load["in_flight"] + load["queued"], load["saturated"]) == (40, False)
    api_keys.revoke(server.service.database, greedy_id)
    for thread in flood:
        thread.join(PATIENCE)
    assert statuses == [401] * 40
    assert (fair_queue.running, fair_queue.waiting) == (0, 0)
    assert endless.begun == endless.ended <= 6


def test_all_places_taken_is_told(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    server = start(concurrent_requests=1, query_seconds=PATIENCE, batch_seconds=PATIENCE)
    only_of(monkeypatch, len(QUERY["xy"]))
    _, statuses = background(lambda: server.client.post(f"{ASK}/batch", json={**BATCH, "timeout_ms": 3000}), 1)
    wait_until(lambda: server.service.fair_queue.running == 1)
    told = httpx.get(f"{server.url}/readyz")
    assert (told.status_code, told.json()["load"]["saturated"]) == (200, True)
    wait_until(lambda: statuses == [200])
    assert httpx.get(f"{server.url}/readyz").json()["load"]["saturated"] is False


def test_a_body_that_is_not_asked_for_does_not_pass_the_gate(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    server = start(concurrent_requests=1, query_seconds=PATIENCE, queue_seconds=0.2)
    only_of(monkeypatch, len(QUERY["xy"]))
    threads, _ = background(lambda: server.client.post(ASK, json={**QUERY, "timeout_ms": 3000}), 1)
    wait_until(lambda: server.service.fair_queue.running == 1)
    sneaky = httpx.request("GET", f"{server.url}/v1/collections/plots/submaps", content=b"x", timeout=PATIENCE)
    assert sneaky.status_code == 503
    threads[0].join(PATIENCE)
