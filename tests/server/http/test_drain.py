"""How the service ends: it says so, takes nothing new, finishes what is at hand; a second signal does not wait."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from server.checks.database import discrepancies
from server.config.settings import STOP_SPARE, Settings
from server.store.sqlite.database import Database
from tests.server.factories import forest, points, put_submap
from tests.server.processes import Server
from tests.server.served import PATIENCE, Served, wait_until

ROOT = Path(__file__).parents[3]
Start = Callable[..., Served]
BODY = json.dumps({"xy": points(forest(1))}).encode()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts `urquhart serve` with the options given; it has the empty collection `plots`."""
    started: list[Served] = []

    def start(*options: str, **environment: str) -> Served:
        started.append(Served(tmp_path, *options, files=None, **environment))
        started[-1].client.put("/v1/collections/plots", json={}).raise_for_status()
        return started[-1]

    yield start
    for served in started:
        served.close()


def half_a_put(served: Served, name: str) -> socket.socket:
    """A PUT of which the last bytes are still to come."""
    connection = socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE)
    head = f"PUT /v1/collections/plots/submaps/{name} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    connection.sendall(f"{head}Content-Length: {len(BODY)}\r\n\r\n".encode() + BODY[:-10])
    return connection


def stored(served: Served) -> set[str]:
    """Ids of the submaps in the database, which is sound."""
    database = Database(served.database)
    try:
        assert list(discrepancies(database)) == []
        with database.read_connection() as connection:
            return {row[0] for row in connection.exec_driver_sql("SELECT id FROM submaps")}
    finally:
        database.dispose()


@pytest.mark.parametrize("workers", ["1", "2"])
def test_requests_at_hand_are_finished(start: Start, workers: str) -> None:
    served = start("--workers", workers, URQUHART_SHUTDOWN_DELAY_SECONDS="0.2")
    halves = [half_a_put(served, f"p{number}") for number in range(8)]
    time.sleep(0.3)  # until they are accepted
    served.signal()
    time.sleep(1.0)  # well after nobody is accepted any more
    assert served.process.poll() is None
    for half in halves:
        half.sendall(BODY[-10:])
    said = [half.recv(65536) for half in halves]
    assert [answer[:13] for answer in said] == [b"HTTP/1.1 201 "] * 8
    assert all(b"connection: close" in answer.lower() for answer in said)
    for half in halves:
        half.close()
    assert served.wait() == 0
    assert stored(served) == {f"p{number}" for number in range(8)}
    assert "Traceback" not in served.log.read_text()


def test_it_says_so_first_and_still_answers_then_takes_nobody(start: Start) -> None:
    served = start("--workers", "2", URQUHART_SHUTDOWN_DELAY_SECONDS="2")
    served.signal()
    answers: list[httpx.Response] = []

    def says_so() -> bool:
        answers.append(httpx.get(f"{served.url}/readyz"))
        return answers[-1].status_code == 503

    wait_until(says_so)
    told = answers[-1]  # of one process; the other may be told a moment later
    assert (told.json()["check"], told.headers["Connection"]) == ("shutdown", "close")
    answer = httpx.put(f"{served.url}/v1/collections/plots/submaps/p", content=BODY, headers=JSON)
    assert answer.status_code == 201
    assert httpx.get(f"{served.url}/livez").status_code == 200
    assert served.wait() == 0
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{served.url}/livez")
    assert stored(served) == {"p"}


JSON = {"Content-Type": "application/json"}


@pytest.mark.parametrize("workers", ["1", "2"])
def test_callers_that_never_pause_lose_nothing(start: Start, workers: str) -> None:
    """Every request that was accepted is answered; then no connection is to be had any more."""
    served = start("--workers", workers)
    acknowledged: list[str] = []
    lost: list[BaseException] = []

    def write(caller: int) -> None:
        with httpx.Client(base_url=served.url, timeout=PATIENCE) as client:
            for number in range(100_000):
                try:
                    put_submap(client, "plots", f"p{caller}-{number}", number % 7).raise_for_status()
                except httpx.ConnectError:
                    return
                except httpx.HTTPError as error:
                    lost.append(error)
                    return
                acknowledged.append(f"p{caller}-{number}")

    writers = [threading.Thread(target=write, args=(caller,)) for caller in range(4)]
    for writer in writers:
        writer.start()
    wait_until(lambda: len(acknowledged) > 40)
    served.signal()
    assert served.wait() == 0
    for writer in writers:
        writer.join(PATIENCE)
    # A connection that nobody had accepted yet when the listening socket closed is reset: nothing was done for it.
    assert all(isinstance(one, httpx.ReadError) and "reset" in str(one) for one in lost), lost
    assert len(lost) <= (len(writers) if workers == "2" else 1)
    assert stored(served) == set(acknowledged)


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_second_signal_does_not_wait(start: Start, workers: str) -> None:
    served = start("--workers", workers, URQUHART_DRAIN_SECONDS="600", URQUHART_LIMITS__BODY_SECONDS="600")
    children = served.workers()
    with half_a_put(served, "p"):
        time.sleep(0.3)
        served.signal()
        time.sleep(1.5)
        assert served.process.poll() is None
        served.signal(signal.SIGINT)
        assert served.wait() == 128 + signal.SIGINT
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in children))
    assert stored(served) == set()


def test_what_takes_too_long_is_given_up(start: Start) -> None:
    served = start(URQUHART_SHUTDOWN_DELAY_SECONDS="0", URQUHART_DRAIN_SECONDS="1", URQUHART_LIMITS__BODY_SECONDS="600")
    with half_a_put(served, "p"):
        time.sleep(0.3)
        served.signal()
        assert served.wait() == 0
    assert stored(served) == set()


@pytest.mark.parametrize("workers", ["1", "2"])
def test_it_ends_in_time_whatever_is_at_hand(start: Start, workers: str) -> None:
    """A batch that takes minutes, half an upload, an answer that nobody reads, a job: and the exit code is 0."""
    served = start(
        "--workers",
        workers,
        URQUHART_SHUTDOWN_DELAY_SECONDS="0",
        URQUHART_DRAIN_SECONDS="1",
        URQUHART_LIMITS__BODY_SECONDS="600",
        URQUHART_LIMITS__QUERY_SECONDS="3600",
        URQUHART_LIMITS__BATCH_SECONDS="3600",
    )
    for seed in range(20):
        put_submap(served.client, "plots", f"p{seed}", seed).raise_for_status()
    served.client.post("/v1/collections/plots/constraints", json={}).raise_for_status()
    unknown = {"xy": points(forest(99, count=500, radius=150.0))}
    batch = json.dumps({"queries": [unknown] * 200}).encode()
    half = b'{"id": "a", "xy": [[0, 0], [1, 2], [5, 3]]}\n{"id"'
    sent = [
        ("POST /v1/collections/plots/queries/batch", "application/json", len(batch), batch),
        ("POST /v1/collections/plots/imports", "application/x-ndjson", 10**6, half),
    ]
    connections = []
    for request, kind, length, body in sent:
        connections.append(socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE))
        head = f"{request} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\r\n"
        connections[-1].sendall(head.encode() + body)
    unread = socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE)
    unread.sendall(b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n" * 100)
    time.sleep(1.0)
    served.signal()
    assert served.wait() == 0
    assert "exits now" not in served.log.read_text()
    for connection in (*connections, unread):
        connection.close()
    assert stored(served) == {f"p{seed}" for seed in range(20)}


def test_what_is_said_of_the_end_agrees() -> None:
    """Whoever stops the service by the examples waits for longer than it takes."""
    settings = Settings()
    assert settings.stop_seconds <= 25.0
    grace = re.search(r"stop_grace_period: (\d+)s", (ROOT / "docker-compose.yml").read_text())
    assert grace is not None
    assert settings.stop_seconds < int(grace[1])
    said = (ROOT / "docs/operations.md").read_text()
    assert f"`shutdown_delay_seconds` ({settings.shutdown_delay_seconds:g})" in said
    assert f"`drain_seconds` ({settings.drain_seconds:g})" in said
    assert f"`shutdown_delay_seconds` + `drain_seconds` + {STOP_SPARE:g} ({settings.stop_seconds:g})" in said


def test_idle_connections_do_not_hold_it_up(start: Start) -> None:
    served = start(URQUHART_SHUTDOWN_DELAY_SECONDS="0", URQUHART_DRAIN_SECONDS="600")
    assert served.client.get("/livez").status_code == 200
    with socket.create_connection(("127.0.0.1", served.port)):
        time.sleep(0.2)
        served.signal(signal.SIGINT)
        assert served.wait() == 0


def test_processes_that_end_are_replaced_and_those_of_a_dead_parent_end(start: Start) -> None:
    served = start("--workers", "2")
    before = set(served.workers())
    assert len(before) == 2
    os.kill(min(before), signal.SIGKILL)
    wait_until(lambda: len(set(served.workers()) - before) == 1, served)
    wait_until(served.ready, served)
    children = served.workers()
    served.process.kill()
    served.process.wait()
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in children))
    assert list(served.temporary.glob("urquhart-metrics-*")) == []


def test_every_process_of_a_group_may_get_the_signal(start: Start) -> None:
    """As a service manager sends it: to all of them, and the parent sends it on."""
    served = start("--workers", "2", URQUHART_SHUTDOWN_DELAY_SECONDS="0.2")
    with half_a_put(served, "p") as half:
        time.sleep(0.3)
        for pid in (*served.workers(), served.process.pid):
            os.kill(pid, signal.SIGTERM)
        time.sleep(1.0)
        half.sendall(BODY[-10:])
        assert half.recv(65536).startswith(b"HTTP/1.1 201 ")
    assert served.wait() == 0


def test_what_is_loaded_is_spared_from_the_collector() -> None:
    script = (
        "import gc\n"
        "from server.http.serving.lifecycle import _freeze_loaded_objects\n"
        "_freeze_loaded_objects()\n"
        "print(gc.get_freeze_count())"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert int(said) > 10_000


def test_readiness_of_a_plain_server(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    """Under another supervisor, which knows nothing of ours, an end is still clean."""
    server = serve(tmp_path / "urquhart.db")
    assert server.client.get("/readyz").status_code == 200
    assert server.stop() in {0, -15}
