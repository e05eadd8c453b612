"""A server that is ended again and again while it works: asked to (SIGTERM), or not (SIGKILL)."""

import random
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.hostile.jobs import JobInterrupted, has_jobs
from benchmarks.reliability.trees import body
from benchmarks.server_process import BenchmarkServer, served

_BASE: Final = "/v1/collections/plots"
_WRITERS: Final = 4
_SMALL: Final = {"URQUHART_INDEX__FLUSH_SUBMAPS": "20", "URQUHART_INDEX__MAINTENANCE_SECONDS": "0.2"}
_STOP: Final = 30.0
"""Seconds within which a server that is asked to end must have ended."""


@dataclass
class _Journal:
    """What writers sent, and what of it was acknowledged: forests by id; POSTs by their key."""

    seed: int
    stored: dict[str, int] = field(default_factory=dict)
    posted: dict[str, str | None] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)


def run(*, quick: bool, seed: int) -> Figures:
    """Rounds of writes, and of jobs, each cut short; then everything that was promised must be there."""
    rounds = 4 if quick else 24
    rng, journal, problems = random.Random(seed), _Journal(seed), list[str]()
    stops: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        path, log = Path(folder) / "kills.db", Path(folder) / "log"
        jobs = JobInterrupted(seed, lines=400 if quick else 3_000)
        for number in range(rounds):
            with served(path, log, **_SMALL) as server, httpx.Client(base_url=server.url, timeout=60.0) as client:
                client.put(_BASE, json={}).raise_for_status()
                with_jobs = has_jobs(client)
                if with_jobs:
                    problems += [f"round {number}: {what}" for what in jobs.look(client)]
                    jobs.start(client, number)
                problems += [f"round {number}: {what}" for what in _missing(client, journal, rng)]
                writers = [
                    threading.Thread(target=_write, args=(server.url, journal, number * _WRITERS + writer))
                    for writer in range(_WRITERS)
                ]
                for writer in writers:
                    writer.start()
                time.sleep(rng.uniform(0.2, 1.5))
                if with_jobs:
                    jobs.note(client)
                _end(server, number, stops, problems)
                for writer in writers:
                    writer.join()
            problems += [f"round {number}: {what}" for what in server.failures()]
        with served(path, log, **_SMALL) as server, httpx.Client(base_url=server.url, timeout=60.0) as client:
            if with_jobs:
                problems += jobs.look(client)
            problems += _missing(client, journal, rng, all_of_them=True)
            problems += _twice(client, journal)
    return {
        "rounds": rounds,
        "acknowledged": len(journal.stored),
        "cut_short": sum(name is None for name in journal.posted.values()),
        "stop_seconds": max(stops, default=0.0),
        "jobs": jobs.figures() if with_jobs else None,
        "problems": problems[:30],
    }


def _end(server: BenchmarkServer, number: int, stops: list[float], problems: list[str]) -> None:
    """Every other round as an operator does it, every other as a power cut does."""
    if number % 2:
        server.kill()
        return
    code, seconds = server.stop()
    stops.append(seconds)
    if code not in (0, -15):
        problems.append(f"round {number}: asked to end, it ended with {code}")
    if seconds > _STOP:
        problems.append(f"round {number}: asked to end, it took {seconds:.0f} s")


def _write(url: str, journal: _Journal, writer: int) -> None:
    """Store until the server is gone; note what was acknowledged once it was."""
    with httpx.Client(base_url=url, timeout=60.0) as client:
        for number in range(100_000):
            place = 100_000 * writer + number
            key = f"k{place}"
            try:
                if number % 2:
                    response = client.put(f"{_BASE}/submaps/s{place}", json=body(journal.seed, place))
                else:
                    with journal.lock:
                        journal.posted[key] = None
                    response = client.post(
                        f"{_BASE}/submaps", json=body(journal.seed, place), headers={"Idempotency-Key": key}
                    )
            except httpx.TransportError:
                return
            if response.status_code != 201:
                continue  # it is stopping, and says so
            with journal.lock:
                journal.stored[response.json()["id"]] = place
                if key in journal.posted:
                    journal.posted[key] = response.json()["id"]


def _missing(client: httpx.Client, journal: _Journal, rng: random.Random, *, all_of_them: bool = False) -> list[str]:
    """Acknowledged writes that are not there; and of some, or all, those that a query does not find."""
    wrong = []
    seen, cursor = set(), ""
    while True:
        page = client.get(f"{_BASE}/submaps?limit=1000" + (f"&cursor={cursor}" if cursor else "")).json()
        seen |= {one["id"] for one in page["submaps"]}
        if (cursor := page.get("next", "")) == "":
            break
    wrong += [f"{name} was acknowledged and is gone" for name in journal.stored.keys() - seen]
    names = sorted(journal.stored)
    for name in names if all_of_them else rng.sample(names, min(20, len(names))):
        answer = client.post(f"{_BASE}/queries", json=body(journal.seed, journal.stored[name])).json()
        best = answer["candidates"][0]["submap_id"] if answer.get("candidates") else None
        if (answer.get("verdict"), best) != ("matched", name):
            wrong.append(f"{name} was acknowledged and is not found: {answer.get('verdict')}, {best}")
    return wrong


def _twice(client: httpx.Client, journal: _Journal) -> list[str]:
    """POSTs that are sent again with their key: done before or done now, and never twice."""
    wrong = []
    before = client.get(_BASE).json()["counts"]["submaps"]
    new = 0
    for key, name in list(journal.posted.items())[-200:]:
        place = int(key[1:])
        response = client.post(f"{_BASE}/submaps", json=body(journal.seed, place), headers={"Idempotency-Key": key})
        replayed = "Idempotency-Replayed" in response.headers
        new += not replayed
        if response.status_code != 201 or (name is not None and (not replayed or response.json()["id"] != name)):
            wrong.append(f"{key}: sent again it is {response.status_code}, {'as before' if replayed else 'done again'}")
    if client.get(_BASE).json()["counts"]["submaps"] != before + new:
        wrong.append("a POST that was sent again was done twice")
    return wrong
