"""Pictures and explanations are worked on for somebody: not beyond the limit, and not for a caller that is gone."""

import socket
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest

from server.errors import NotReady
from tests.server.factories import forest, points, put_submap
from tests.server.served import PATIENCE, Start, Threaded, starting, wait_until
from urquhart import Budget

T = TypeVar("T")
PLOTS = "/v1/collections/plots"
MATCH, EXPLANATION = f"{PLOTS}/queries/1/candidates/1/match", f"{PLOTS}/queries/1/explanation"
TESSELLATION = f"{PLOTS}/submaps/p/tessellation"
PICTURES = [
    (MATCH, "image/svg+xml"),
    (EXPLANATION, "image/svg+xml"),
    (TESSELLATION, "image/svg+xml"),
    (TESSELLATION, "application/json"),
    (TESSELLATION, "application/geo+json"),
]
PAGE = (f"{PLOTS}/submaps", "application/geo+json")


def prepare(server: Threaded) -> None:
    """A submap that is on Earth, and a stored query that found it."""
    server.client.patch(PLOTS, json={"crs": "EPSG:32633", "origin": [500_000.0, 5_000_000.0]}).raise_for_status()
    place = {"frame_id": "map", "x": 0.0, "y": 0.0, "yaw": 0.0}
    put_submap(server.client, "plots", "p", 1, map_pose=place).raise_for_status()
    asked = {"xy": points(forest(1)), "store": True}
    server.client.post(f"{PLOTS}/queries", json=asked, headers={"Idempotency-Key": "one"}).raise_for_status()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server with the limits that are given; it has all that `PICTURES` ask for."""
    with starting(tmp_path, prepare) as start:
        yield start


class Endless:
    """Loops of pictures that go on until their budget ends them."""

    def __init__(self) -> None:
        self.begun = threading.Event()

    def each(self, budget: Budget, items: Iterable[T]) -> Iterator[T]:
        """In the place of `Budget.each`."""
        self.begun.set()
        began = time.monotonic()
        while time.monotonic() - began < PATIENCE:
            budget.check()
            time.sleep(0.005)
        yield from items


@pytest.fixture
def endless(monkeypatch: pytest.MonkeyPatch) -> Endless:
    """Every loop goes on until its budget ends it."""
    loops = Endless()
    monkeypatch.setattr(Budget, "each", lambda budget, items: loops.each(budget, items))
    return loops


def asked_for(server: Threaded, path: str, media_type: str) -> socket.socket:
    """A connection on which a picture was asked for."""
    connection = server.connect()
    connection.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAccept: {media_type}\r\n\r\n".encode())
    return connection


def gone(server: Threaded) -> list[float]:
    """How many requests ended because the caller was gone, by route."""
    samples = (one for metric in server.service.metrics.registry.collect() for one in metric.samples)
    return [one.value for one in samples if one.name == "urquhart_requests_total" and one.labels["status"] == "499"]


@pytest.mark.parametrize(("path", "media_type"), [*PICTURES, PAGE])
def test_what_is_not_drawn_in_time_is_503(start: Start, path: str, media_type: str) -> None:
    start()  # the query is stored by a server that has the time for it
    answer = start(query_seconds=1e-9).client.get(path, headers={"Accept": media_type})
    assert answer.status_code == 503
    assert answer.json()["type"].endswith("deadline-exceeded")
    assert answer.json()["limit"] == "query_seconds"


@pytest.mark.parametrize(("path", "media_type"), PICTURES)
def test_the_picture_ends_with_its_caller(
    start: Start, endless: Endless, caplog: pytest.LogCaptureFixture, path: str, media_type: str
) -> None:
    server = start(query_seconds=PATIENCE)
    connection = asked_for(server, path, media_type)
    assert endless.begun.wait(PATIENCE)
    assert server.service.fair_queue.running == 1
    connection.close()
    wait_until(lambda: server.service.fair_queue.running == 0)
    wait_until(lambda: gone(server) == [1.0])
    assert not [one for one in caplog.records if one.exc_info]


def test_who_may_not_have_the_picture_any_more_is_told_why(
    start: Start, endless: Endless, caplog: pytest.LogCaptureFixture
) -> None:
    """As at the end of the service, and where a key is revoked."""
    server = start(query_seconds=PATIENCE)
    with asked_for(server, MATCH, "image/svg+xml") as connection:
        assert endless.begun.wait(PATIENCE)
        for request in list(server.app.state.shared.requests):
            request.refuse(NotReady("shutdown", "the service is stopping"))
        assert connection.recv(65536).startswith(b"HTTP/1.1 503 ")
    wait_until(lambda: server.service.fair_queue.running == 0)
    assert not [one for one in caplog.records if one.exc_info]
