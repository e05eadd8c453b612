"""More requests than can be done, and requests that come slowly: the others are answered all the same."""

import asyncio
import json
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from server.config.settings import Limits
from server.errors import Overloaded, TooManyRequests
from server.http.admission.fair_queue import FairQueue
from server.queries import lookup
from server.schemas.queries import QueryAnswer
from server.security import api_keys
from server.security.principal import Scope
from server.security.rate_limit import RateLimiter
from tests.server.factories import forest, points
from tests.server.served import PATIENCE, Start, Threaded, read_all, starting, together, wait_until

ASK = "/v1/collections/plots/queries"
PUT_HEAD = (
    "PUT /v1/collections/plots/submaps/p HTTP/1.1\r\nHost: localhost\r\n"
    "Content-Type: application/json\r\nContent-Length: {}\r\n\r\n"
)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server with the limits that are given, which has the empty collection `plots`."""
    with starting(tmp_path) as start:
        yield start


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Queries are answered when this is set, and not before."""
    go, answer = threading.Event(), lookup.answer_as_json

    def slowly(*arguments: object, **options: object) -> tuple[bytes, int]:
        assert go.wait(PATIENCE)
        return answer(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(lookup, "answer_as_json", slowly)
    yield go
    go.set()


def ask(server: Threaded) -> httpx.Response:
    """A query on a connection of its own."""
    return httpx.post(f"{server.url}{ASK}", json={"xy": points(forest(1))}, timeout=PATIENCE)


def background(work: Callable[[], httpx.Response], count: int) -> tuple[list[threading.Thread], list[httpx.Response]]:
    """Do it in threads."""
    answers: list[httpx.Response] = []
    threads = [threading.Thread(target=lambda: answers.append(work())) for _ in range(count)]
    for thread in threads:
        thread.start()
    return threads, answers


# --------------------------------------------------------------- places


def test_what_is_too_much_is_refused_at_once(start: Start, held: threading.Event) -> None:
    server = start(concurrent_requests=2, queued_requests=1, queue_seconds=100)
    fair_queue = server.service.fair_queue
    threads, answers = background(lambda: ask(server), 3)
    wait_until(lambda: (fair_queue.running, fair_queue.waiting) == (2, 1))
    refused = ask(server)
    problem = refused.json()
    assert (refused.status_code, problem["type"]) == (503, "/problems/overloaded")
    assert int(refused.headers["Retry-After"]) >= 1
    assert server.client.get("/v1/collections").status_code == 503
    # Who watches is answered, and sees it.
    assert server.client.get("/livez").status_code == 200
    assert server.client.get("/readyz").status_code in {200, 503}
    lines = server.client.get("/metrics").text.splitlines()
    assert "urquhart_requests_in_flight 2.0" in lines
    assert "urquhart_requests_queued 1.0" in lines
    assert 'urquhart_requests_rejected_total{reason="overloaded"} 2.0' in lines
    held.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert [answer.status_code for answer in answers] == [200] * 3
    wait_until(lambda: (fair_queue.running, fair_queue.waiting) == (0, 0))


def test_one_that_waits_too_long_is_refused(start: Start, held: threading.Event) -> None:
    server = start(concurrent_requests=1, queue_seconds=0.1)
    threads, answers = background(lambda: ask(server), 1)
    wait_until(lambda: server.service.fair_queue.running == 1)
    refused = ask(server)
    assert (refused.status_code, refused.json()["type"]) == (503, "/problems/overloaded")
    assert server.service.fair_queue.waiting == 0
    held.set()
    threads[0].join(PATIENCE)
    assert [answer.status_code for answer in answers] == [200]
    assert ask(server).status_code == 200


def test_failures_give_their_places_back(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    server = start(concurrent_requests=1, queue_seconds=0.5)

    def fail(*arguments: object) -> QueryAnswer:
        raise RuntimeError("a defect")

    monkeypatch.setattr(lookup, "answer_as_json", fail)
    for _ in range(3):
        assert ask(server).status_code == 500
    assert server.client.post(ASK, content=b"{", headers={"Content-Type": "application/json"}).status_code == 400
    assert server.client.post("/v1/collections/none/queries", json={"xy": []}).status_code in {404, 422, 500}
    assert server.client.get("/nope").status_code == 404
    wait_until(lambda: server.service.fair_queue.running == 0)


def test_places_are_given_in_turn_and_none_is_lost() -> None:
    async def scenario() -> list[int]:
        fair_queue = FairQueue(Limits(concurrent_requests=1, queued_requests=3, queue_seconds=100))
        order: list[int] = []

        async def enter() -> None:
            await fair_queue.enter("a", asyncio.get_running_loop().create_future())

        async def visit(number: int) -> None:
            await enter()
            order.append(number)

        await enter()
        tasks = [asyncio.create_task(visit(number)) for number in range(3)]
        await asyncio.sleep(0)
        with pytest.raises(Overloaded):
            await enter()
        tasks[1].cancel()
        await asyncio.sleep(0)
        assert fair_queue.waiting == 2
        # Given up in the moment in which it is handed over: the next one has it.
        fair_queue.leave("a", 0.0)
        tasks[0].cancel()
        await asyncio.sleep(0.01)
        assert (fair_queue.running, fair_queue.waiting) == (1, 0)
        fair_queue.leave("a", 0.0)
        await asyncio.gather(*tasks, return_exceptions=True)
        assert fair_queue.running == 0
        return order

    assert asyncio.run(scenario()) == [2]


# ---------------------------------------------------------------- rates


def test_who_asks_too_often_is_told_when_to_come_back(start: Start) -> None:
    server = start(requests_per_second=0.01)  # one request, then one in 100 s; the collection was made with it
    refused = server.client.get("/v1/collections")
    assert (refused.status_code, refused.json()["type"]) == (429, "/problems/too-many-requests")
    assert refused.json()["limit"] == "requests_per_second"
    assert 0 < int(refused.headers["Retry-After"]) <= 100
    assert server.rejected("rate") == 1.0
    for path in ("/livez", "/", "/problems/too-many-requests"):
        assert server.client.get(path).status_code == 200


def test_each_key_has_a_rate_of_its_own_and_forgers_have_that_of_their_address(start: Start) -> None:
    server = start(requests_per_second=0.01)
    made = [api_keys.make(server.service.database, name, [Scope.READ], ["*"])[0] for name in ("a", "b")]
    time.sleep(1.1)  # until it is known that there are keys
    bearers = [{"Authorization": f"Bearer {key}"} for key in made]
    asked = [server.client.get("/v1/collections", headers=one).status_code for one in (*bearers, *bearers)]
    assert asked == [200, 200, 429, 429]
    forged = {"Authorization": f"Bearer {made[0][:-3]}xyz"}
    assert server.client.get("/v1/collections", headers=forged).status_code == 429  # spent when the collection was made


def test_the_rate_is_published(start: Start) -> None:
    assert start(requests_per_second=50).client.get("/v1/limits").json()["rates"] == {"requests_per_second": 50.0}
    assert start().client.get("/v1/limits").json()["rates"] == {}


def test_each_caller_has_a_bucket_that_fills() -> None:
    now = 0.0
    rates = RateLimiter(2.0, clock=lambda: now)
    for _ in range(2):
        rates.take("a")
    with pytest.raises(TooManyRequests) as refusal:
        rates.take("a")
    assert refusal.value.retry_after == pytest.approx(0.5)
    rates.take("b")
    now = 0.5
    rates.take("a")
    with pytest.raises(TooManyRequests):
        rates.take("a")
    now = 1000.0  # it holds no more than a second's worth
    for _ in range(2):
        rates.take("a")
    with pytest.raises(TooManyRequests):
        rates.take("a")
    off = RateLimiter(0.0)
    for _ in range(1000):
        off.take("a")


def test_callers_are_forgotten_before_they_fill_the_memory() -> None:
    rates = RateLimiter(1.0, clock=lambda: 0.0)
    for number in range(10_001):
        rates.take(str(number))
    rates.take("0")  # forgotten
    with pytest.raises(TooManyRequests):
        rates.take("10000")


# --------------------------------------------------------- slow callers


def test_half_a_body_is_408_and_nothing_is_stored(start: Start) -> None:
    server = start(body_seconds=0.2)
    whole = json.dumps({"xy": points(forest(1))}).encode()
    with server.connect() as slow:
        slow.sendall(PUT_HEAD.format(len(whole)).encode() + whole[:-10])
        said = read_all(slow)  # returns: the connection is closed
    assert said.startswith(b"HTTP/1.1 408 ")
    assert b"/problems/request-timeout" in said
    assert b"connection: close" in said.lower()
    assert server.rejected("slow_body") == 1.0
    assert server.client.get("/v1/collections/plots").json()["counts"]["submaps"] == 0


def test_a_long_body_may_take_longer(start: Start) -> None:
    """A few times the least rate, for longer than a body may take that does not move."""
    server = start(body_seconds=2.0, body_rate=250)
    whole = json.dumps({"xy": points(forest(1, count=100))}).encode()
    began = time.monotonic()
    with server.connect() as thin:
        thin.sendall(PUT_HEAD.format(len(whole)).encode())
        for place in range(0, len(whole), 100):
            thin.sendall(whole[place : place + 100])
            time.sleep(0.08)
        said = thin.recv(65536)
    assert time.monotonic() - began > 2.0
    assert said.startswith(b"HTTP/1.1 201 ")


def test_a_trickle_is_ended(start: Start) -> None:
    server = start(body_seconds=0.2, body_rate=1000)
    with server.connect() as slow:
        slow.sendall(PUT_HEAD.format(10_000).encode())
        ended = threading.Event()

        def trickle() -> None:
            while not ended.wait(0.02):
                try:
                    slow.send(b" ")
                except OSError:
                    return

        thread = threading.Thread(target=trickle)
        thread.start()
        said = read_all(slow)
        ended.set()
        thread.join()
    assert said.startswith(b"HTTP/1.1 408 ") or said == b""  # what was still being sent may have reset the connection
    wait_until(lambda: server.rejected("slow_body") == 1.0)


def test_slow_bodies_take_nobodys_turn(start: Start) -> None:
    server = start(concurrent_requests=1, queued_requests=0, body_seconds=100)
    slow = [server.connect() for _ in range(30)]
    for connection in slow:
        connection.sendall(PUT_HEAD.format(1000).encode() + b'{"xy": [')
    assert server.service.fair_queue.running == 0
    assert ask(server).status_code == 200
    for connection in slow:
        connection.close()


@pytest.mark.parametrize("half", [b"", b"GET /livez HT", b"GET /livez HTTP/1.1\r\nHost: localhost\r\nX: "])
def test_half_a_head_is_not_waited_for(start: Start, half: bytes) -> None:
    server = start(header_seconds=0.2)
    with server.connect() as slow:
        slow.sendall(half)
        said = read_all(slow)
    assert said.startswith(b"HTTP/1.1 408 ")
    assert b"header_seconds" in said
    assert server.rejected("slow_head") == 1.0


def is_answered(connection: socket.socket) -> None:
    """It can be asked, and answers."""
    connection.sendall(b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n")
    said = b""
    while not said.endswith(b"}"):  # head and body may come one after the other
        said += connection.recv(65536)
    assert said.startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize(
    "sent",
    [
        b"GARBAGE\r\n\r\n",
        b"GET /livez HTTP/1.1\r\n\r\n",  # without Host
        b"GET /livez HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 100_000,
        PUT_HEAD.format("5\r\nContent-Length: 6").encode() + b"{}",
        PUT_HEAD.replace("Content-Length: {}", "Transfer-Encoding: chunked").encode() + b"zz\r\n{}",
    ],
)
def test_what_is_not_http_is_told_so_as_a_problem(start: Start, sent: bytes) -> None:
    server = start()
    with server.connect() as stranger:
        stranger.sendall(sent)
        head, _, body = read_all(stranger).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 ")
    assert b"Content-Type: application/problem+json" in head
    assert b"Connection: close" in head
    told = json.loads(body)
    assert (told["type"], told["status"]) == ("/problems/http-error", 400)
    assert server.client.get("/livez").status_code == 200


def test_half_a_head_after_a_whole_request_is_not_waited_for(start: Start) -> None:
    server = start(header_seconds=3.0)
    with server.connect() as slow:
        for _ in range(3):
            is_answered(slow)
        slow.sendall(b"GET /livez HT")
        assert read_all(slow).startswith(b"HTTP/1.1 408 ")


def test_the_rest_of_a_body_that_was_refused_is_not_waited_for(start: Start) -> None:
    server = start(header_seconds=0.3)
    with server.connect() as slow:
        slow.sendall(b"PUT /nope HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n")
        assert slow.recv(65536).startswith(b"HTTP/1.1 404 ")
        began = time.monotonic()
        while time.monotonic() - began < PATIENCE:
            try:
                slow.send(b" ")
            except OSError:
                break
            time.sleep(0.02)
        else:
            pytest.fail("the connection stayed open")


def test_the_idle_connection_makes_room(start: Start) -> None:
    server = start(connections=4, header_seconds=100)
    server.client.close()
    idle = []
    for _ in range(10):
        idle.append(server.connect())
        assert httpx.get(f"{server.url}/livez").status_code == 200
    assert server.rejected("connections") >= 7
    for connection in idle:
        connection.close()


def test_the_one_that_is_idle_for_longest_makes_room(start: Start) -> None:
    """However long each may still be: one that has just come may have less time left than one that was answered."""
    server = start(connections=2, header_seconds=50, idle_seconds=100)
    server.client.close()
    wait_until(lambda: not server.connections)
    with server.connect() as longest, server.connect() as other:
        is_answered(longest)
        time.sleep(0.1)
        is_answered(other)
        assert httpx.get(f"{server.url}/livez").status_code == 200
        assert read_all(longest) == b""
        is_answered(other)


def test_a_connection_is_kept_for_a_while_after_an_answer(start: Start) -> None:
    server = start(idle_seconds=3.0, header_seconds=100)
    with server.connect() as kept:
        for _ in range(3):
            is_answered(kept)
            time.sleep(0.1)
        assert read_all(kept) == b""  # until it is closed


def test_where_all_connections_are_busy_a_new_one_is_refused(start: Start) -> None:
    server = start(connections=2, body_seconds=100)
    server.client.close()
    busy = [server.connect() for _ in range(2)]
    for connection in busy:
        connection.sendall(PUT_HEAD.format(1000).encode() + b"{")
    wait_until(lambda: server.busy == 2)
    with server.connect() as late:
        said = read_all(late)
    assert said.startswith(b"HTTP/1.1 503 ")
    assert b"/problems/overloaded" in said
    for connection in busy:
        connection.close()


def test_bodies_do_not_fill_the_memory(start: Start) -> None:
    server = start(buffered_bytes=4000, body_seconds=100)
    with server.connect() as first, server.connect() as second:
        first.sendall(PUT_HEAD.format(3001).encode() + b" " * 3000)
        second.sendall(PUT_HEAD.format(3001).encode() + b" " * 3000)
        (refused,), _, _ = select.select([first, second], [], [], PATIENCE)  # whichever is read later
        said = refused.recv(65536)
    assert said.startswith(b"HTTP/1.1 503 ")
    assert server.rejected("memory") == 1.0
    # What was held is given back when it is gone.
    wait_until(lambda: server.client.post(ASK, json={"xy": points(forest(1))}).status_code == 200)


def test_many_at_once_are_all_answered(start: Start) -> None:
    server = start(concurrent_requests=2, queued_requests=100, queue_seconds=PATIENCE)
    codes = together(40, lambda number: ask(server).status_code)
    assert codes == [200] * 40
    assert (server.service.fair_queue.running, server.service.fair_queue.waiting) == (0, 0)
