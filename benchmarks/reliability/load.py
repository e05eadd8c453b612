"""Part `load`: a fleet at work, more of it than the service can serve, and then as before.

The clients run in this process, the service in another, on the same machine: they share its cores. What every client
was told to be stored is read back at the end, and found by a query.
"""

import asyncio
import tempfile
import time
from pathlib import Path
from typing import Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.prefilled import lines_of, store
from benchmarks.reliability.traffic import BASE, COLLECTION, Told, TrafficQuery, drive, questions
from benchmarks.reliability.trees import body, forest
from benchmarks.scale.measurement import spread
from benchmarks.scale.tiled_forest import World
from benchmarks.server_process import BenchmarkServer, served

_CLIENTS: Final = 32
_CROWD: Final = 400
_PROBES: Final = 40
"""Queries one after the other that say what is normal, and whether it is so again."""
_AGAIN: Final = 1.5
"""Times as long as before the overload a query may take and be normal."""
_LONGEST: Final = 60.0
"""Seconds within which it must be."""


def run(*, quick: bool, seed: int) -> Figures:
    """Fill a database, then the three phases, then the count of what is stored."""
    submaps, seconds, crowded = (500, 20.0, 8.0) if quick else (10_000, 300.0, 30.0)
    world = World(submaps, seed)
    asked = questions(world, 100 if quick else 500)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "load.db"
        store(path, COLLECTION, lines_of(world))
        with served(path, Path(folder) / "log") as server:
            before = _probe(server, asked)
            start = server.megabytes()
            normal = asyncio.run(drive(server.url, world, asked, clients=_CLIENTS, seconds=seconds, seed=seed))
            middle = server.megabytes()
            crowd = asyncio.run(drive(server.url, world, asked, clients=_CROWD, seconds=crowded, seed=seed + 1))
            recovered = _recovery(server, asked, before)
            lost = _lost(server, normal, crowd)
            memory = {"start": start, "after_normal": middle, "end": server.megabytes()}
            logged = server.failures()
    return {
        "submaps": submaps,
        "clients": _CLIENTS,
        "crowd": _CROWD,
        "alone": spread(before),
        "normal": normal.figures(),
        "overload": crowd.figures(),
        "recovery_seconds": recovered,
        "stored": len(normal.stored) + len(crowd.stored),
        "lost": lost,
        "memory": memory,
        "logged": logged[:20],
    }


def _probe(server: BenchmarkServer, asked: list[TrafficQuery]) -> list[float]:
    """Milliseconds of queries one after the other, with nobody else there."""
    with httpx.Client(base_url=server.url, timeout=120.0) as client:
        return [_ask(client, asked[number % len(asked)]) for number in range(2 * _PROBES)][_PROBES:]


def _recovery(server: BenchmarkServer, asked: list[TrafficQuery], before: list[float]) -> float | None:
    """Seconds after the crowd has gone until queries take no longer than before; None when they do not."""
    normal = sorted(before)[len(before) // 2]
    began = time.perf_counter()
    with httpx.Client(base_url=server.url, timeout=120.0) as client:
        while time.perf_counter() - began < _LONGEST:
            times = sorted(_ask(client, asked[number]) for number in range(9))
            if times[4] <= _AGAIN * normal:
                return time.perf_counter() - began
    return None


def _ask(client: httpx.Client, question: TrafficQuery) -> float:
    began = time.perf_counter()
    response = client.post(f"{BASE}/queries", content=question.raw, headers={"Content-Type": "application/json"})
    spent = 1e3 * (time.perf_counter() - began)
    # One that is turned away at once has not recovered.
    return spent if response.status_code == 200 else 1e3 * _LONGEST


def _lost(server: BenchmarkServer, *all_told: Told) -> list[str]:
    """Writes that were acknowledged, and are not there as they were sent or are not found."""
    lost = []
    with httpx.Client(base_url=server.url, timeout=120.0) as client:
        for told in all_told:
            for name, seed in told.stored.items():
                response = client.get(f"{BASE}/submaps/{name}")
                trees = response.json().get("landmarks", []) if response.status_code == 200 else []
                if [[tree["x"], tree["y"]] for tree in trees] != forest(*seed).round(3).tolist():
                    lost.append(f"{name}: {response.status_code}, other trees")
                    continue
                answer = client.post(f"{BASE}/queries", json=body(*seed)).json()
                best = answer["candidates"][0]["submap_id"] if answer.get("candidates") else None
                if (answer.get("verdict"), best) != ("matched", name):
                    lost.append(f"{name}: {answer.get('verdict')}, {best}")
    return lost
