"""Attacks by requests that are small and ask for much."""

import gzip
import time
from typing import Any, Final

import httpx
import numpy as np
import orjson
from numpy.typing import NDArray

from benchmarks.reliability.exhaustion.attack_outcome import AttackOutcome, at_once
from benchmarks.reliability.exhaustion.attacked_service import ATTACKER, HONEST, AttackedService
from benchmarks.reliability.hostile.jobs import finished
from benchmarks.reliability.trees import body

BASE: Final = f"/v1/collections/{ATTACKER}"
MOST: Final = 20_000
"""Landmarks that a submap may have."""
_PACKED: Final = {"Content-Type": "application/json", "Content-Encoding": "gzip"}
_LINES: Final = {"Content-Type": "application/x-ndjson"}
_PATIENCE: Final = 600.0
_CROWD: Final = 40
_BATCH: Final = 200


def collection(attacked: AttackedService) -> None:
    """The attacker's collection."""
    attacked.client(ATTACKER).put(BASE, json={}).raise_for_status()


def store_large(attacked: AttackedService, *, quick: bool) -> None:
    """Ten submaps of one place with thousands of trees each: every one matches every other in all pairs."""
    collection(attacked)
    trees = np.random.default_rng(5).uniform(-150.0, 150.0, (500 if quick else 5_000, 2))
    for number in range(10):
        _put(attacked, f"large{number}", trees).raise_for_status()


def store_lattices(attacked: AttackedService, *, quick: bool) -> None:
    """Rows of trees, a little irregular, which take a search the longest."""
    collection(attacked)
    rng = np.random.default_rng(6)
    for number in range(20):
        _put(attacked, f"rows{number}", _lattice(400) + rng.normal(0.0, 0.15, (400, 2))).raise_for_status()


def store_jobs(attacked: AttackedService, *, quick: bool) -> None:
    """Submaps that keep a constraints job busy."""
    store_lattices(attacked, quick=quick)
    attacked.client(ATTACKER).post(f"{BASE}/constraints", json={}).raise_for_status()


def equal_points(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """One caller after the other."""
    raw, outcome = gzip.compress(orjson.dumps({"xy": [[1.0, 2.0]] * MOST}), 9, mtime=0), AttackOutcome()
    client, until = attacked.client(ATTACKER), time.monotonic() + least
    at_once(2, until, lambda _: outcome.send(lambda: client.put(f"{BASE}/submaps/e", content=raw, headers=_PACKED)))
    outcome.more["bytes"] = len(raw)
    return outcome


def poisoned_line(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """The other lines are stored."""
    lines = [orjson.dumps({"id": f"s{i}", **body(3, i)}) for i in range(99)]
    lines.insert(50, orjson.dumps({"id": "bad", "xy": [[1.0, 2.0]] * MOST}))
    return _import(attacked, lines, least)


def empty_lines(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """Each is refused, and the results say so."""
    return _import(attacked, [b"{}"] * (1_300 if quick else 13_000), least)


def shapes(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """Each stored first, then asked for."""
    outcome, seconds = AttackOutcome(), dict[str, float]()
    client = attacked.client(ATTACKER)
    for name, xy in _shapes(1_000 if quick else MOST):
        raw = _pack({"xy": xy.tolist()})
        for does, ask in (
            ("stored", lambda raw=raw, name=name: client.put(f"{BASE}/submaps/{name}", content=raw, headers=_PACKED)),
            ("asked", lambda raw=raw: client.post(f"{BASE}/queries", content=raw, headers=_PACKED)),
        ):
            began = time.perf_counter()
            outcome.send(ask)
            seconds[f"{name}, {does}"] = time.perf_counter() - began
    outcome.more["seconds"] = seconds
    return outcome


def large_answers(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """The largest answer counts, in bytes."""
    outcome, client, until = AttackOutcome(), attacked.client(ATTACKER), time.monotonic() + least
    one = {"submap_id": "large0", "limit": 20, "explain": True}
    raw, largest = orjson.dumps({"queries": [one] * _BATCH}), [0]

    def ask(_: int) -> None:
        answer = outcome.send(
            lambda: client.post(f"{BASE}/queries/batch", content=raw, headers={"Content-Type": "application/json"})
        )
        largest[0] = max(largest[0], len(answer.content) if answer is not None else 0)

    at_once(2, until, ask)
    outcome.more |= {"bytes": len(raw), "answer_bytes": largest[0]}
    return outcome


def crowd(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """All with one key; each again and again."""
    outcome, client = AttackOutcome(), attacked.client(ATTACKER)
    at_once(_CROWD, time.monotonic() + least, lambda number: _slow(client, outcome, number))
    return outcome


def revoked(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """How long the service still works for the key afterwards counts, in seconds."""
    outcome, client = AttackOutcome(), attacked.client(ATTACKER)
    started = time.monotonic()
    last, gone = [0.0], [float("inf")]

    def ask(number: int) -> None:
        if number == 0 and time.monotonic() > started + least / 2.0 and gone[0] == float("inf"):
            attacked.revoke(ATTACKER)
            gone[0] = time.monotonic()
        answer = _slow(client, outcome, number)
        if answer is not None and answer.status_code == 200:
            last[0] = max(last[0], time.monotonic())

    at_once(_CROWD, started + least, ask)
    outcome.more["answered_after_seconds"] = max(last[0] - gone[0], 0.0)
    return outcome


def jobs(attacked: AttackedService, least: float, *, quick: bool) -> AttackOutcome:
    """How long an import of the robot's takes, which is one submap, counts."""
    outcome, client = AttackOutcome(), attacked.client(ATTACKER)
    lines = b"".join(orjson.dumps({"id": f"s{i}", **body(4, i)}) + b"\n" for i in range(50 if quick else 500))
    posted = client.post(f"{BASE}/imports", content=lines, headers=_LINES).raise_for_status()
    finished(client, posted.headers["Location"], _PATIENCE)
    until = time.monotonic() + least / 3.0
    while time.monotonic() < until:
        outcome.send(lambda: client.post(f"{BASE}/constraints", json={}))
    robot = attacked.client(HONEST)
    began = time.perf_counter()
    mine = orjson.dumps({"id": "mine", **body(9)}) + b"\n"
    posted = robot.post(f"/v1/collections/{HONEST}/imports", content=mine, headers=_LINES).raise_for_status()
    finished(robot, posted.headers["Location"], _PATIENCE)
    outcome.more["import_of_the_robot_seconds"] = time.perf_counter() - began
    return outcome


def slow_query(number: int) -> dict[str, Any]:
    """A query that fits nowhere and many places nearly."""
    rng = np.random.default_rng((7, number))
    return {"xy": (_lattice(400) + rng.normal(0.0, 0.4, (400, 2))).round(3).tolist(), "limit": 20}


def _slow(client: httpx.Client, outcome: AttackOutcome, number: int) -> httpx.Response | None:
    answer = outcome.send(lambda: client.post(f"{BASE}/queries", json=slow_query(number)))
    if answer is not None and answer.status_code in (401, 429, 503):
        time.sleep(0.05)
    return answer


def _import(attacked: AttackedService, lines: list[bytes], least: float) -> AttackOutcome:
    outcome, client = AttackOutcome(), attacked.client(ATTACKER)
    raw, until = b"".join(line + b"\n" for line in lines), time.monotonic() + least
    while True:
        posted = outcome.send(lambda: client.post(f"{BASE}/imports", content=raw, headers=_LINES))
        if posted is not None and posted.status_code == 202:
            began = time.perf_counter()
            job = finished(client, posted.headers["Location"], _PATIENCE)
            results = client.get(job["links"]["results"])
            outcome.more |= {
                "state": job["state"],
                "counts": job["counts"],
                "job_seconds": time.perf_counter() - began,
                "result_bytes": len(results.content),
                "bytes": len(raw),
            }
        if time.monotonic() >= until:
            return outcome


def _put(attacked: AttackedService, name: str, xy: NDArray[np.float64]) -> httpx.Response:
    return attacked.client(ATTACKER).put(f"{BASE}/submaps/{name}", content=_pack({"xy": xy.tolist()}), headers=_PACKED)


def _pack(content: dict[str, Any]) -> bytes:
    return gzip.compress(orjson.dumps(content), 1, mtime=0)


def _lattice(count: int) -> NDArray[np.float64]:
    side = int(np.sqrt(count))
    return 3.0 * np.stack(np.meshgrid(np.arange(float(side)), np.arange(float(side))), axis=-1).reshape(-1, 2)


def _shapes(count: int) -> list[tuple[str, NDArray[np.float64]]]:
    turn, part = 2.0 * np.pi * np.arange(count) / count, np.arange(count) / count
    circle = 100.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    fan = np.vstack([circle[: count // 2] * [1.0, 0.01], [[0.0, -500.0]]])
    spiral = (5.0 + 200.0 * part)[:, None] * np.column_stack([np.cos(40.0 * turn), np.sin(40.0 * turn)])
    square = _lattice(count)
    return [
        ("circle", circle),
        ("fan", fan),
        ("spiral", spiral),
        ("square", square),
        ("hexagons", square @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])),
    ]
