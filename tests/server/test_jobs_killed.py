"""Jobs outlive the processes that do them, however these end."""

import random
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import orjson
import pytest

from tests.server.processes import Server
from tests.server.world import forest, points

LINES = 3000
BAD = frozenset({7, 1000, 2999})


@pytest.fixture(scope="module")
def upload() -> bytes:
    """Lines of small submaps, some of which cannot be stored."""
    trees = [points(forest(seed, 30)) for seed in range(40)]
    return b"".join(
        b"{\n" if i in BAD else orjson.dumps({"id": f"p{i}", "xy": trees[i % 40]}) + b"\n" for i in range(LINES)
    )


def post(server: Server, upload: bytes) -> str:
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    response = server.client.post(
        "/v1/collections/plots/imports", content=upload, headers={"Content-Type": "application/x-ndjson"}
    )
    assert response.status_code == 202, response.text
    return response.headers["Location"]


def check(server: Server, url: str) -> None:
    """The job ends well, and each line has one result."""
    for _ in range(30):
        job = server.client.get(url, params={"wait": "10"}).json()
        if job["finished"]:
            break
    assert job["state"] == "successful", job
    assert (job["done"], job["total"]) == (LINES, LINES)
    lines = [orjson.loads(line) for line in server.client.get(f"{url}/results").content.splitlines()]
    assert [line["line"] for line in lines] == list(range(1, LINES + 1))
    assert [line["outcome"] for line in lines] == ["refused" if i in BAD else "created" for i in range(LINES)]
    assert job["counts"] == {"created": LINES - len(BAD), "refused": len(BAD)}
    assert server.client.get("/v1/collections/plots").json()["counts"]["submaps"] == LINES - len(BAD)


def pauses(seed: int, most: float) -> Iterator[float]:
    rng = random.Random(seed)
    while True:
        yield rng.uniform(0.0, most)


def test_killed_again_and_again(serve: Callable[..., Server], tmp_path: Path, upload: bytes) -> None:
    path = tmp_path / "killed.db"
    server = serve(path)
    url = post(server, upload)
    unfinished = 0
    for pause, _ in zip(pauses(3, 0.8), range(5), strict=False):
        time.sleep(pause)
        server.kill()
        server = serve(path)
        unfinished += server.client.get(url).json()["finished"] is None
    assert unfinished
    check(server, url)


def test_asked_to_stop_it_goes_on_later(serve: Callable[..., Server], tmp_path: Path, upload: bytes) -> None:
    path = tmp_path / "stopped.db"
    server = serve(path)
    url = post(server, upload)
    time.sleep(0.3)
    assert server.stop() in (0, -signal.SIGTERM)
    server = serve(path)
    check(server, url)


def test_another_process_takes_over(serve: Callable[..., Server], tmp_path: Path, upload: bytes) -> None:
    path = tmp_path / "shared.db"
    servers = [serve(path), serve(path)]
    url = post(servers[0], upload)
    while not servers[1].client.get(url).json()["done"]:
        time.sleep(0.01)
    servers[0].kill()  # perhaps it is the one at work, perhaps not
    check(servers[1], url)
