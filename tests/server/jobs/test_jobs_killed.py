"""Jobs outlive the processes that do them, however these end."""

import os
import random
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import orjson
import pytest

from tests.server.factories import forest, points
from tests.server.forked import Forked
from tests.server.processes import Server, spawned

ROOT = Path(__file__).parents[3]
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


KINDS = {
    "half a line",
    *(f"{when} {what}" for when in ("before", "after") for what in ("fsync", "unlink", "do_commit")),
}
"""What a job is killed at."""
CREATED = [(1, "created"), (2, "created"), (3, "refused"), (5, "replaced"), (6, "created"), (7, "unchanged")]


@pytest.mark.parametrize(("mode", "sound", "each"), [("continue", False, 2), ("all", True, 1), ("all", False, 1)])
def test_killed_at_points_of_every_kind(tmp_path: Path, mode: str, sound: bool, each: int) -> None:
    """Whatever was on the disk by then, the end is the same."""
    trees = [points(forest(seed, 30)) for seed in range(4)]
    ids = [("a", 0), ("b", 1), None, None, ("a", 2), ("c", 3), ("b", 1)]
    lines = [orjson.dumps({"id": one[0], "xy": trees[one[1]]}) if one else b"" for one in ids]
    lines[2] = b"" if sound else b"{"
    (tmp_path / "lines").write_bytes(b"".join(line + b"\n" for line in lines))
    output, errors = tmp_path / "told", tmp_path / "errors"
    arguments = [str(tmp_path / "runs"), mode, str(tmp_path / "lines"), str(each)]
    killed = Forked(
        "tests.server.jobs.kill_points", arguments, folder=ROOT, environment=os.environ, output=output, errors=errors
    )
    assert killed.wait(280.0) == 0, errors.read_text()
    told = [orjson.loads(line) for line in output.read_bytes().splitlines()]
    kinds = Counter(kind for kind, _ in told)
    assert kinds.keys() == KINDS
    assert max(kinds.values()) == each
    results = [one for one in CREATED if not sound or one[1] != "refused"]
    if mode == "all" and not sound:
        results = [(number, outcome if outcome == "refused" else "skipped") for number, outcome in results]
    expected = {
        "state": "failed" if mode == "all" and not sound else "successful",
        "done": 7,
        "counts": dict(sorted(Counter(outcome for _, outcome in results).items())),
        "results": [list(one) for one in results],
        "submaps": 0 if mode == "all" and not sound else 3,
        "files": ["job.results"],
    }
    assert [(kind, one) for kind, one in told if one != expected] == []


def test_a_worker_process_that_is_killed_costs_nothing(serve: Callable[..., Server], tmp_path: Path) -> None:
    """As a supervisor does that ends all processes of a service at once, or a machine short of memory."""
    server = serve(tmp_path / "workers.db", URQUHART_JOBS__PROCESSES="2")
    trees = [points(forest(seed, 100)) for seed in range(20)]
    content = b"".join(orjson.dumps({"id": f"p{i}", "xy": trees[i % 20]}) + b"\n" for i in range(4_000))
    url = post(server, content)
    killed = set[int]()
    while not (job := server.client.get(url).json())["finished"]:
        if not killed:
            killed = spawned(server.process.pid)
            for pid in killed:
                os.kill(pid, signal.SIGTERM)
        time.sleep(0.02)
    assert killed, "the work was over before a process was started for it"
    assert (job["state"], job["counts"]) == ("successful", {"created": 4_000})
    assert "will be continued later" in server.log.read_text()
    lines = [orjson.loads(line)["line"] for line in server.client.get(f"{url}/results").content.splitlines()]
    assert lines == list(range(1, 4_001))


def test_killed_again_and_again(serve: Callable[..., Server], tmp_path: Path, upload: bytes) -> None:
    path = tmp_path / "killed.db"
    server = serve(path)
    url = post(server, upload)
    unfinished = 0
    for pause, kills in zip(pauses(3, 0.8), range(5), strict=False):
        time.sleep(pause)
        # A job that never gets on is given up; on a busy machine no pause is long enough for it to.
        while kills == 2 and not server.client.get(url).json()["done"]:
            time.sleep(0.02)
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
