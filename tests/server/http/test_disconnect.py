"""Work has a deadline, and ends when nobody waits for it any more."""

import gzip
import json
import math
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.server.factories import forest, observed, points, put_submap
from tests.server.served import PATIENCE, Start, Threaded, starting, wait_until
from urquhart import Budget, Config, Recognition, Recognizer

ASK = "/v1/collections/plots/queries"
QUERY = {"xy": points(forest(1))}
BATCH = {"queries": [QUERY] * 200}


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server with the limits that are given; its collection `plots` has the submap `p`."""
    with starting(tmp_path, lambda server: put_submap(server.client, "plots", "p", 1).raise_for_status()) as start:
        yield start


def nothing_at_the_deadline() -> Recognition:
    """The answer of a search that found nothing in time."""
    nothing = Recognizer(Config()).locate(forest(1))
    assert nothing.verdict == "no_match"
    return replace(nothing, reason="deadline")


class Searches:
    """Searches that find nothing and go on until their budget ends them."""

    def __init__(self) -> None:
        self.begun = self.ended = 0

    def __call__(self, recognizer: Recognizer, xy: Any, *, budget: Budget | None = None, **options: Any) -> Recognition:
        assert budget is not None
        self.begun += 1
        began = time.monotonic()
        try:
            while not budget.is_spent():
                assert time.monotonic() - began < PATIENCE
                time.sleep(0.005)
        finally:
            self.ended += 1
        return nothing_at_the_deadline()


def has_deadline(budget: Budget | None = None, **options: Any) -> bool:
    """Whether a search is a caller's: the warm-up, for which nobody waits, has no deadline."""
    return budget is not None and budget.remaining < math.inf


@pytest.fixture
def endless(monkeypatch: pytest.MonkeyPatch) -> Searches:
    """Every search with a deadline goes on until that ends it."""
    searches = Searches()
    search = Recognizer.recognize
    monkeypatch.setattr(
        Recognizer,
        "recognize",
        lambda *given, **options: (searches if has_deadline(**options) else search)(*given, **options),
    )
    return searches


def send(server: Threaded, path: str, body: Any, *, packed: bool = False, more: bytes = b"") -> socket.socket:
    """A POST on a connection of its own, as a whole, and `more` after it."""
    content = json.dumps(body).encode()
    content = gzip.compress(content) if packed else content
    encoding = "Content-Encoding: gzip\r\n" if packed else ""
    connection = server.connect()
    connection.sendall(
        f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n{encoding}"
        f"Content-Length: {len(content)}\r\n\r\n".encode()
        + content
        + more
    )
    return connection


def reset(connection: socket.socket) -> None:
    """Leave without a word: the other side gets RST."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def finish(connection: socket.socket) -> None:
    """Say that nothing more is coming: the other side gets FIN."""
    connection.shutdown(socket.SHUT_WR)


def answered(server: Threaded, status: str) -> float:
    """Requests to a batch that ended with this status."""
    labels = {"route": "/v1/collections/{collection}/queries/batch", "method": "POST", "status": status}
    return server.service.metrics.registry.get_sample_value("urquhart_requests_total", labels) or 0.0


# ------------------------------------------------------------ callers that go


@pytest.mark.parametrize("leave", [reset, finish, socket.socket.close])
@pytest.mark.parametrize("packed", [False, True])
def test_the_work_on_a_batch_ends_with_its_caller(
    start: Start, endless: Searches, leave: Callable[[socket.socket], None], packed: bool
) -> None:
    server = start(query_seconds=PATIENCE, batch_seconds=PATIENCE)
    connection = send(server, f"{ASK}/batch", BATCH, packed=packed)
    wait_until(lambda: endless.begun == 1)
    leave(connection)
    wait_until(lambda: server.service.fair_queue.running == 0)
    connection.close()
    assert (endless.begun, endless.ended) == (1, 1)
    wait_until(lambda: answered(server, "499") == 1.0)


@pytest.mark.parametrize("leave", [reset, finish])
@pytest.mark.parametrize("size", [1, 300_000])
def test_a_caller_that_has_sent_the_next_request_already_is_seen_to_go(
    start: Start, endless: Searches, leave: Callable[[socket.socket], None], size: int
) -> None:
    """What is sent before the answer is not read, and neither is the end of the connection."""
    server = start(query_seconds=PATIENCE, batch_seconds=PATIENCE)
    connection = send(server, f"{ASK}/batch", BATCH)
    wait_until(lambda: endless.begun == 1)
    following = f"POST {ASK} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {size}\r\n\r\n".encode()
    connection.sendall(following)
    time.sleep(0.1)
    connection.sendall(b" " * size)
    time.sleep(0.1)
    leave(connection)
    wait_until(lambda: server.service.fair_queue.running == 0)
    connection.close()
    assert (endless.begun, endless.ended) == (1, 1)


def test_who_leaves_while_waiting_for_a_place_is_not_waited_for(start: Start, endless: Searches) -> None:
    server = start(concurrent_requests=1, queue_seconds=PATIENCE, query_seconds=PATIENCE)
    fair_queue = server.service.fair_queue
    first = send(server, ASK, QUERY)
    wait_until(lambda: endless.begun == 1)
    second = send(server, ASK, QUERY)
    wait_until(lambda: fair_queue.waiting == 1)
    reset(second)
    wait_until(lambda: fair_queue.waiting == 0)
    assert (fair_queue.running, endless.begun) == (1, 1)
    reset(first)
    wait_until(lambda: fair_queue.running == 0)
    assert endless.begun == 1
    assert server.client.get("/v1/collections/plots").status_code == 200


def test_a_real_batch_is_not_computed_for_nobody(start: Start) -> None:
    server = start(query_seconds=PATIENCE, batch_seconds=PATIENCE)
    for seed in range(2, 12):
        put_submap(server.client, "plots", f"p{seed}", seed).raise_for_status()
    unknown = {"xy": points(forest(99, count=400, radius=120.0))}
    connection = send(server, f"{ASK}/batch", {"queries": [unknown] * 200})
    wait_until(lambda: server.service.fair_queue.running == 1)
    reset(connection)
    wait_until(lambda: server.service.fair_queue.running == 0)
    asked = server.service.metrics.registry.get_sample_value("urquhart_query_verdicts_total", {"verdict": "no_match"})
    assert (asked or 0.0) < 100


def test_who_stays_is_answered(start: Start) -> None:
    """The end of a request is not taken for the end of its caller, on one connection after the other."""
    server = start()
    for _ in range(3):
        for body in ({"queries": [QUERY] * 3}, {"queries": [QUERY]}):
            answer = server.client.post(f"{ASK}/batch", json=body)
            assert [one["verdict"] for one in answer.json()["results"]] == ["matched"] * len(body["queries"])
    assert answered(server, "499") == 0.0


def test_requests_that_are_sent_together_are_all_answered(start: Start) -> None:
    server = start()
    content = json.dumps(QUERY).encode()
    head = f"POST {ASK} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    head += f"Content-Length: {len(content)}\r\n\r\n"
    with server.connect() as connection:
        threading.Thread(target=connection.sendall, args=((head.encode() + content) * 30,)).start()
        said = b""
        while said.count(b'"verdict":"matched"') < 30:
            piece = connection.recv(65536)
            assert piece, said[-2000:]
            said += piece


# ------------------------------------------------------------------ deadlines


def test_the_answer_at_the_deadline_is_no_match(start: Start, endless: Searches) -> None:
    server = start(query_seconds=PATIENCE)
    answer = server.client.post(ASK, json={**QUERY, "timeout_ms": 50})
    assert (answer.status_code, answer.json()["verdict"], answer.json()["reason"]) == (200, "no_match", "deadline")


def test_the_service_has_a_deadline_of_its_own(start: Start, endless: Searches) -> None:
    server = start(query_seconds=0.1)
    for body in (QUERY, {**QUERY, "timeout_ms": 3_600_000}):
        assert server.client.post(ASK, json=body).json()["reason"] == "deadline"
    assert server.client.get("/v1/limits").json()["limits"]["query_seconds"] == 0.1


def test_a_question_that_comes_with_a_submap_has_one(start: Start, endless: Searches) -> None:
    server = start(query_seconds=PATIENCE)
    body = {**QUERY, "query": {"timeout_ms": 50}}
    for answer in (
        server.client.put("/v1/collections/plots/submaps/q", json=body),
        server.client.post("/v1/collections/plots/submaps", json=body),
    ):
        assert (answer.status_code, answer.json()["query"]["reason"]) == (201, "deadline")


def test_each_query_of_a_batch_has_one_and_the_batch_another(start: Start, endless: Searches) -> None:
    server = start(query_seconds=PATIENCE, batch_seconds=PATIENCE)
    quick = [{**QUERY, "timeout_ms": 300}] * 3
    answers = server.client.post(f"{ASK}/batch", json={"queries": quick}).json()["results"]
    assert [one["reason"] for one in answers] == ["deadline"] * 3
    answers = server.client.post(f"{ASK}/batch", json={"queries": [QUERY] * 3, "timeout_ms": 500}).json()["results"]
    assert answers[0]["reason"] == "deadline"
    for late in answers[1:]:
        assert (late["problem"]["type"], late["problem"]["limit"]) == ("/problems/deadline-exceeded", "batch_seconds")
    assert endless.begun == 4


def test_who_has_been_here_is_told_as_far_as_it_was_found(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    server = start()
    put_submap(server.client, "plots", "q", 1, session="monday").raise_for_status()
    search, asked = Recognizer.recognize, list[Budget]()
    late = nothing_at_the_deadline()

    def only_once(recognizer: Recognizer, *given: Any, budget: Budget, **options: Any) -> Recognition:
        asked.append(budget)
        if len(asked) == 1:
            return search(recognizer, *given, **options)
        return late

    monkeypatch.setattr(Recognizer, "recognize", only_once)
    body = {"xy": observed(forest(1), 1)[0], "per_session": True}
    answer = server.client.post(ASK, json=body).json()
    assert (answer["verdict"], answer["reason"], len(answer["candidates"])) == ("matched", "deadline", 1)


@pytest.mark.parametrize("timeout", [0, -1, 1.5, "100", True, 10**10])
def test_timeouts_that_cannot_be(start: Start, timeout: Any) -> None:
    server = start()
    for path, body in ((ASK, QUERY), (f"{ASK}/batch", {"queries": [QUERY]})):
        refused = server.client.post(path, json={**body, "timeout_ms": timeout})
        assert (refused.status_code, refused.json()["errors"][0]["pointer"]) == (422, "/timeout_ms")
