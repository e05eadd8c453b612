"""A hundred thousand collections: made, listed, started with, asked."""

import os
import tempfile
import time
from pathlib import Path
from typing import Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.server_process import BenchmarkServer, served
from server.collections import crud
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner

_FILLED: Final = 100
"""Every so many collections, one has a submap."""

_IDLE: Final = 10.0
"""Seconds for which nothing is asked,"""
_BUSY: Final = 0.25
"""and cores that the service may keep busy meanwhile."""


def run(*, quick: bool, seed: int) -> Figures:
    """Seconds to make them, to start, to list them all, and to make and ask one more."""
    count = 1_000 if quick else 100_000
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "crowd.db"
        began = time.perf_counter()
        _make(path, count)
        made = time.perf_counter() - began
        with (
            served(path, Path(folder) / "log") as server,
            httpx.Client(base_url=server.url, timeout=120.0) as client,
        ):
            started = server.megabytes()
            for number in range(0, count, count // _FILLED):
                client.put(f"/v1/collections/c{number}/submaps/p", json=body(seed, number)).raise_for_status()
            began = time.perf_counter()
            listed, slowest = _list(client)
            listing = time.perf_counter() - began
            if listed != count:
                problems.append(f"{listed} of {count} collections are listed")
            times, asked = [], range(0, count, count // _FILLED)
            for number in asked:
                began = time.perf_counter()
                answer = client.post(f"/v1/collections/c{number}/queries", json=body(seed, number)).json()
                times.append(time.perf_counter() - began)
                if answer["verdict"] != "matched":
                    problems.append(f"c{number}: {answer['verdict']}")
            began = time.perf_counter()
            client.put("/v1/collections/one-more", json={}).raise_for_status()
            one_more = time.perf_counter() - began
            spent = _cpu_seconds(server)
            time.sleep(_IDLE)
            idle = (_cpu_seconds(server) - spent) / _IDLE
            if idle > _BUSY:
                problems.append(f"with nothing to do the service keeps {idle:.2f} cores busy")
            metrics = len(client.get("/metrics").content)
            grown, ready = server.megabytes(), server.ready_seconds
            problems += server.failures()
        with served(path, Path(folder) / "log") as server:
            again = server.ready_seconds
    return {
        "collections": count,
        "made_seconds": made,
        "ready_seconds": ready,
        "ready_again_seconds": again,
        "megabytes_at_start": started,
        "megabytes_after": grown,
        "list_seconds": listing,
        "slowest_page_seconds": slowest,
        "first_query_milliseconds": 1e3 * sorted(times)[len(times) // 2],
        "one_more_milliseconds": 1e3 * one_more,
        "idle_cores": idle,
        "metrics_bytes": metrics,
        "problems": problems[:20],
    }


def _make(path: Path, count: int) -> None:
    database = Database(path)
    try:
        migrations_runner.upgrade(database)
        for number in range(count):
            crud.ensure(database, f"c{number}", CollectionPut())
    finally:
        database.dispose()


def _list(client: httpx.Client) -> tuple[int, float]:
    """How many collections all pages list, and the seconds of the slowest page."""
    listed, slowest, url = 0, 0.0, "/v1/collections?limit=1000"
    while url:
        began = time.perf_counter()
        page = client.get(url).json()
        slowest = max(slowest, time.perf_counter() - began)
        listed += len(page["collections"])
        url = f"/v1/collections?limit=1000&cursor={page['next']}" if "next" in page else ""
    return listed, slowest


def _cpu_seconds(server: BenchmarkServer) -> float:
    """Processor time that the server has used."""
    fields = Path(f"/proc/{server.process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
