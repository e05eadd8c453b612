"""Callers that wait for jobs, and callers that do not read their answers: few of them, and at nobody else's cost."""

import json
import socket
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.jobs import queue
from server.store.sqlite.database import Database
from tests.server.factories import forest, points, put_submap
from tests.server.http.test_disconnect import finish, reset
from tests.server.served import PATIENCE, Start, Threaded, read_all, starting, wait_until


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server with the limits that are given, which has the empty collection `plots` and does no jobs."""
    with starting(tmp_path, lambda server: server.service.jobs.runner.stop()) as start:
        yield start


def job(server: Threaded) -> str:
    """A job that nobody does."""
    answer = server.client.post("/v1/collections/plots/constraints", json={})
    answer.raise_for_status()
    name: str = answer.json()["id"]
    return name


def wait_for(server: Threaded, name: str) -> socket.socket:
    """Somebody waits for a job."""
    connection = server.connect()
    connection.sendall(f"GET /v1/jobs/{name}?wait=60 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
    return connection


# ------------------------------------------------------------------------- waits


def test_one_look_is_enough_for_all_who_wait(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    server = start(concurrent_requests=2, job_waits=50, key_job_waits=50)
    looks, look = list[int](), queue.unfinished

    def counted(database: Database, job_ids: Collection[str]) -> set[str]:
        looks.append(len(job_ids))
        return look(database, job_ids)

    monkeypatch.setattr(queue, "unfinished", counted)
    name, other = job(server), job(server)
    waiting = [wait_for(server, name) for _ in range(30)] + [wait_for(server, other)]
    wait_until(lambda: server.service.waits.count == 31)
    began = time.monotonic()
    wait_until(lambda: len(looks) >= 5)
    assert time.monotonic() - began > 0.5  # five looks at 0.2 s, however many wait
    assert set(looks[-3:]) == {2}
    assert server.service.fair_queue.running == 0
    assert "urquhart_job_waits 31.0" in server.client.get("/metrics").text.splitlines()
    server.client.delete(f"/v1/jobs/{name}").raise_for_status()
    server.service.jobs.runner.run_once()  # which notes the end of the dismissed job
    server.service.jobs.runner.start()
    for connection in waiting[:30]:
        assert b'"state":"dismissed"' in read_all(connection)
    for connection in waiting:
        connection.close()


@pytest.mark.parametrize("leave", [reset, finish])
def test_a_wait_ends_with_its_caller(start: Start, leave: Callable[[socket.socket], None]) -> None:
    server = start()
    connection = wait_for(server, job(server))
    wait_until(lambda: server.service.waits.count == 1)
    leave(connection)
    wait_until(lambda: server.service.waits.count == 0)
    connection.close()


def test_one_too_many_is_answered_at_once(start: Start) -> None:
    server = start(job_waits=2, key_job_waits=1)
    name = job(server)
    first = wait_for(server, name)
    wait_until(lambda: server.service.waits.count == 1)
    answer = server.client.get(f"/v1/jobs/{name}", params={"wait": 60})
    assert (answer.status_code, answer.json()["state"], answer.headers["Retry-After"]) == (200, "accepted", "1")
    first.close()


# ---------------------------------------------------------------- unread answers


def large(server: Threaded) -> dict[str, Any]:
    """A query whose answer is large: many submaps, each with all its pairs."""
    for number in range(20):
        put_submap(server.client, "plots", f"p{number}", 1, properties={"x": "y" * 15_000}).raise_for_status()
    return {"xy": points(forest(1))}


def unread(server: Threaded, count: int) -> list[socket.socket]:
    """So many callers that ask for a page of about 300 kB ten times, and read nothing."""
    connections = []
    for _ in range(count):
        connection = socket.socket()
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", server.port))
        request = b"GET /v1/collections/plots/submaps?limit=20 HTTP/1.1\r\nHost: localhost\r\n\r\n"
        connection.sendall(request * 40)
        connections.append(connection)
    return connections


def test_who_does_not_read_is_cut_off(start: Start) -> None:
    server = start(body_seconds=1.0)
    large(server)
    connections = unread(server, 5)
    wait_until(lambda: server.rejected("slow_reader") == 5.0)
    wait_until(lambda: server.busy == 0)
    for connection in connections:
        connection.close()
    assert len(server.client.get("/v1/collections/plots/submaps").json()["submaps"]) == 20


def test_unread_answers_do_not_fill_the_memory(start: Start) -> None:
    server = start(body_seconds=PATIENCE, unsent_bytes=1_000_000)
    large(server)
    connections = unread(server, 10)
    wait_until(lambda: server.rejected("unsent") >= 6.0)
    assert len(server.client.get("/v1/collections/plots/submaps").json()["submaps"]) == 20
    for connection in connections:
        connection.close()
    wait_until(lambda: server.busy == 0)


def test_who_reads_gets_all_of_it(start: Start) -> None:
    server = start(body_seconds=1.0, unsent_bytes=100_000)
    large(server)
    page = httpx.get(f"{server.url}/v1/collections/plots/submaps", timeout=PATIENCE)
    assert len(page.content) > 300_000
    assert len(json.loads(page.content)["submaps"]) == 20


def test_a_page_ends_where_its_bytes_are_used_up(start: Start) -> None:
    server = start(page_bytes=50_000)
    large(server)
    seen, cursor, pages = list[str](), "", 0
    while True:
        page = server.client.get("/v1/collections/plots/submaps", params={"cursor": cursor} if cursor else {})
        assert len(page.content) < 60_000
        seen += [one["id"] for one in page.json()["submaps"]]
        cursor, pages = page.json().get("next", ""), pages + 1
        if not cursor:
            break
    assert (seen, pages) == ([f"p{number}" for number in range(20)], 7)
