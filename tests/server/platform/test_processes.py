"""Real processes on one database: what one acknowledges the other finds; SIGKILL loses nothing acknowledged."""

import re
import socket
import threading
from collections.abc import Callable
from pathlib import Path

import httpx

from server.checks.database import discrepancies
from server.store.sqlite.database import Database
from tests.server.factories import forest, observed, points, put_submap
from tests.server.processes import Server

_RUNS = re.compile(r'^urquhart_maintenance_runs_total\{task="flush"\} (.+)$', re.MULTILINE)
_FAILURES = re.compile(r"^urquhart_(?:maintenance_failures|segments_damaged)_total(?:\{.*\})? (.+)$", re.MULTILINE)


def test_two_servers_on_one_database(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    path = tmp_path / "urquhart.db"
    one, two = serve(path).client, serve(path).client
    one.put("/v1/collections/plots", json={}).raise_for_status()
    for i, (writer, reader) in enumerate([(one, two), (two, one)] * 3):
        put_submap(writer, "plots", f"p{i}", i).raise_for_status()
        seen, _ = observed(forest(i), 100 + i)
        answer = reader.post("/v1/collections/plots/queries", json={"xy": seen}).json()
        assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", f"p{i}")
    one.delete("/v1/collections/plots/submaps/p0").raise_for_status()
    answer = two.post("/v1/collections/plots/queries", json={"xy": points(forest(0))}).json()
    assert answer["verdict"] == "no_match"


def test_two_servers_share_their_segments(serve: Callable[..., Server], tmp_path: Path) -> None:
    """Both write, merge and take over, all the time, and neither is disturbed by the other."""
    path = tmp_path / "urquhart.db"
    few = {"URQUHART_INDEX__FLUSH_SUBMAPS": "3", "URQUHART_INDEX__MAINTENANCE_SECONDS": "0.02"}
    one, two = serve(path, **few).client, serve(path, **few).client
    one.put("/v1/collections/plots", json={}).raise_for_status()

    def flushes() -> float:
        return sum(float(value) for client in (one, two) for value in _RUNS.findall(client.get("/metrics").text))

    for i in range(300):
        if i >= 30 and flushes() >= 3:
            break
        writer, reader = (one, two) if i % 2 else (two, one)
        put_submap(writer, "plots", f"p{i}", i).raise_for_status()
        for known in {i, i // 2}:
            answer = reader.post("/v1/collections/plots/queries", json={"xy": points(forest(known))}).json()
            assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", f"p{known}")
    assert flushes() >= 3
    assert list((tmp_path / "urquhart.db.index").glob("*.segment"))
    failed = [value for client in (one, two) for value in _FAILURES.findall(client.get("/metrics").text)]
    assert set(failed) <= {"0.0"}


def test_kill_during_puts_loses_nothing_acknowledged(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    path = tmp_path / "urquhart.db"
    server = serve(path)
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    acknowledged: list[int] = []
    enough = threading.Event()

    def put_until_killed(first: int) -> None:
        with httpx.Client(base_url=server.client.base_url) as client:
            for seed in range(first, 10_000, 2):
                try:
                    put_submap(client, "plots", f"p{seed}", seed).raise_for_status()
                except httpx.HTTPError:
                    return
                acknowledged.append(seed)
                if len(acknowledged) >= 30:
                    enough.set()

    writers = [threading.Thread(target=put_until_killed, args=(first,)) for first in range(2)]
    for writer in writers:
        writer.start()
    assert enough.wait(120)
    server.kill()
    for writer in writers:
        writer.join()

    database = Database(path)
    assert list(discrepancies(database)) == []
    database.dispose()
    client = serve(path).client
    for seed in acknowledged:
        seen, _ = observed(forest(seed), seed)
        answer = client.post("/v1/collections/plots/queries", json={"xy": seen}).json()
        assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", f"p{seed}")
    assert client.get("/v1/collections/plots").json()["counts"]["submaps"] >= len(acknowledged)


def test_a_stop_is_clean(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    path = tmp_path / "urquhart.db"
    server = serve(path)
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    put_submap(server.client, "plots", "p", 1).raise_for_status()
    assert server.stop() in {0, -15}
    assert not path.with_name("urquhart.db-wal").exists()


def test_a_caller_that_goes_away(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    server = serve(tmp_path / "urquhart.db")
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    url = server.client.base_url
    head = "PUT /v1/collections/plots/submaps/p HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    with socket.create_connection((url.host, url.port or 0)) as half:
        half.sendall(f'{head}Content-Length: 1000\r\n\r\n{{"xy": [[1, 2], '.encode())
    while 'status="499"' not in server.client.get("/metrics").text:
        pass
    assert server.client.get("/v1/collections/plots").json()["counts"]["submaps"] == 0
    assert "Traceback" not in server.log.read_text()


def test_large_bodies_over_a_socket(serve: Callable[[Path], Server], tmp_path: Path) -> None:
    client = serve(tmp_path / "urquhart.db").client
    client.put("/v1/collections/plots", json={}).raise_for_status()
    body = b" " * (20 * 1024 * 1024)
    headers = {"Content-Type": "application/json"}
    for content in (body, iter([body[: 1024 * 1024]] * 20)):
        response = client.put("/v1/collections/plots/submaps/p", content=content, headers=headers)
        assert (response.status_code, response.json()["limit"]) == (413, "body_bytes")
    assert client.get("/livez").status_code == 200
