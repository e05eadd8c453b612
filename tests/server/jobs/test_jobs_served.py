"""Jobs over a socket, on a disk: uploads that break off, are refused while they are sent, or do not fit."""

import os
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import orjson
import pytest

from server.jobs.folder import JobFolder
from server.store.sqlite.database import Database
from tests.server.factories import forest, points
from tests.server.processes import Server

IMPORTS = "/v1/collections/plots/imports"
NDJSON = {"Content-Type": "application/x-ndjson"}


def lines(count: int, trees: int = 60, prefix: str = "p") -> bytes:
    forests = [points(forest(seed, trees)) for seed in range(20)]
    return b"".join(orjson.dumps({"id": f"{prefix}{i}", "xy": forests[i % 20]}) + b"\n" for i in range(count))


def started(serve: Callable[..., Server], path: Path, **settings: str) -> Server:
    server = serve(path, **settings)
    server.client.put("/v1/collections/plots", json={}).raise_for_status()
    return server


def finished(client: httpx.Client, url: str) -> dict[str, object]:
    for _ in range(20):
        job: dict[str, object] = client.get(url, params={"wait": "10"}).json()
        if job["finished"]:
            return job
    raise AssertionError(job)


def uploads(path: Path) -> list[str]:
    folder = Path(f"{path}.jobs")
    return sorted(file.name for file in folder.iterdir() if file.suffix in (".part", ".input"))


def test_half_an_upload_is_no_job(serve: Callable[..., Server], tmp_path: Path) -> None:
    path = tmp_path / "half.db"
    server = started(serve, path)
    url, content = server.client.base_url, lines(200)
    head = f"POST {IMPORTS} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-ndjson\r\n"
    with socket.create_connection((url.host, url.port or 0)) as half:
        half.sendall(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content[: len(content) // 2])
        while not (Path(f"{path}.jobs").is_dir() and uploads(path)):
            time.sleep(0.01)
    while uploads(path):
        time.sleep(0.01)
    assert server.client.get("/v1/jobs").json()["jobs"] == []
    assert server.client.get("/v1/collections/plots").json()["counts"]["submaps"] == 0
    assert "Traceback" not in server.log.read_text()


def test_what_is_refused_is_told_to_who_still_sends(serve: Callable[..., Server], tmp_path: Path) -> None:
    client = started(serve, tmp_path / "refused.db", URQUHART_LIMITS__IMPORT_BYTES="40000000").client

    def pieces(size: int) -> Iterator[bytes]:
        for _ in range(size >> 20):
            yield b" " * (1 << 20)

    for path, headers, status, size in (
        (IMPORTS.replace("plots", "nope"), NDJSON, 404, 30 << 20),
        (IMPORTS, {"Content-Type": "text/csv"}, 415, 30 << 20),
        (IMPORTS, NDJSON, 413, 60 << 20),
    ):
        for body in (b" " * size, pieces(size)):
            response = client.post(path, content=body, headers=headers)
            assert response.status_code == status, response.text
    assert client.get("/v1/jobs").json()["jobs"] == []


def caught_at_work(server: Server) -> str:
    """A reindex that has begun and is not finished; one that ended between two looks at it is followed by another."""
    while True:
        url: str = server.client.post("/v1/collections/plots/reindex").headers["Location"]
        while not (job := server.client.get(url).json())["done"]:
            time.sleep(0.005)
        if job["finished"] is None:
            return url


def test_a_stop_ends_a_reindex_and_a_start_goes_on(serve: Callable[..., Server], tmp_path: Path) -> None:
    path = tmp_path / "reindex.db"
    server = started(serve, path, URQUHART_INDEX__BLOCK_SUBMAPS="100")
    sent = server.client.post(IMPORTS, content=lines(3000), headers=NDJSON)
    assert finished(server.client, sent.headers["Location"])["counts"] == {"created": 3000}
    url = caught_at_work(server)
    assert server.stop() in (0, -15)
    server = serve(path, URQUHART_INDEX__BLOCK_SUBMAPS="100")
    job = finished(server.client, url)
    assert (job["state"], job["done"], job["counts"]) == ("successful", 3000, {"indexed": 3000})
    answer = server.client.post("/v1/collections/plots/queries", json={"xy": points(forest(3))}).json()
    # Each forest is there 150 times over, which is one place seen 150 times.
    best = answer["candidates"][0]
    assert (answer["verdict"], int(best["submap_id"][1:]) % 20) == ("matched", 3)
    assert max(abs(best["transform"][axis]) for axis in ("x", "y", "yaw")) < 1e-6


def test_who_waits_for_a_job_waits_for_no_thread(serve: Callable[..., Server], tmp_path: Path) -> None:
    """More wait than there are threads, and others are served meanwhile; all are told when it ends."""
    path = tmp_path / "wait.db"
    server = started(serve, path)
    folder = JobFolder(Database(path))
    told: list[bool] = []

    def follow() -> None:
        with httpx.Client(base_url=server.client.base_url, timeout=120.0) as client:
            told.append(client.get(url, params={"wait": "60"}).json()["finished"] is not None)

    with folder.turn(1) as ours:  # as another process would that is at a job of the collection
        assert ours
        url = server.client.post(IMPORTS, content=lines(20), headers=NDJSON).headers["Location"]
        threads = [threading.Thread(target=follow) for _ in range(60)]
        for thread in threads:
            thread.start()
        time.sleep(1.0)
        answers = [server.client.get("/v1/collections").status_code for _ in range(20)]
        assert server.client.get(url).json()["state"] == "accepted"
        assert told == []
    for thread in threads:
        thread.join()
    assert (answers, told) == ([200] * 20, [True] * 60)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 12 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=12m", "tmpfs", folder], check=False)
    if mounted.returncode:
        pytest.skip("a disk can only be made by root")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def test_a_full_disk(serve: Callable[..., Server], small_disk: Path) -> None:
    path = small_disk / "full.db"
    server = started(serve, path)
    client = server.client
    response = client.post(IMPORTS, content=lines(20_000), headers=NDJSON)
    assert (response.status_code, response.json()["type"]) == (507, "/problems/storage-full")
    assert uploads(path) == []
    assert client.get("/v1/jobs").json()["jobs"] == []
    # It fits as it is sent, and no more once it is stored, too.
    sent = client.post(IMPORTS, content=lines(3000), headers=NDJSON)
    job = finished(client, sent.headers["Location"])
    assert job["state"] == "failed", job
    problem = job["problem"]
    assert isinstance(problem, dict)
    assert problem["status"] == 507
    assert uploads(path) == []
    told = [orjson.loads(line) for line in client.get(f"{sent.headers['Location']}/results").content.splitlines()]
    stored = client.get("/v1/collections/plots").json()["counts"]["submaps"]
    assert 0 < len(told) < 3000
    assert (job["counts"], stored) == ({"created": len(told)}, len(told))
    rest = client.post(IMPORTS, content=lines(len(told) + 5), headers=NDJSON)
    assert finished(client, rest.headers["Location"])["counts"] == {"unchanged": len(told), "created": 5}
    assert os.path.ismount(small_disk)
