"""Part `meetings`: a submap alone in its collection finds itself, and robots that store at once find each other.

Submaps alone are of every kind of forest, turned and moved before they are looked up again. Two robots each store a
view of one place at the same moment, through two processes on one database, and ask with it for what others have
stored: whoever commits last must be told of the other.
"""

import math
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import forest
from benchmarks.server_process import BenchmarkServer, served
from urquhart import SE2, Config, Recognizer, describe
from urquhart.evaluation.simulation import Sensor, bridson, observe, paper_forest, plantation

_COLLECTION: Final = "/v1/collections/meetings"
_SIDE: Final = 100.0
"""Metres of the forests that submaps are seen in."""
_CLOSE: Final = 0.05
"""Metres by which the pose of an exact copy may be wrong."""
_NOISE: Final = 0.05
_SEEN: Final = 0.9
KINDS: Final[dict[str, tuple[Callable[[np.random.Generator], NDArray[np.float64]], float]]] = {
    "dense": (lambda rng: bridson(_SIDE, _SIDE, 2.5, rng), 26.0),
    "sparse": (lambda rng: paper_forest(rng, _SIDE), 40.0),
    "few": (lambda rng: paper_forest(rng, _SIDE), 14.0),
    "rows": (lambda rng: plantation(_SIDE, _SIDE, rng), 30.0),
}
"""Trees of a forest, and the range in metres within which they are seen."""


def run(*, quick: bool, seed: int) -> Figures:
    """Submaps alone, then pairs of robots."""
    began = time.perf_counter()
    alone = {kind: _alone(kind, 10 if quick else 250, seed) for kind in KINDS}
    seconds = time.perf_counter() - began
    return {"alone": alone, "alone_seconds": seconds, "together": _together(40 if quick else 1_000, seed)}


def _alone(kind: str, count: int, seed: int) -> Figures:
    """How many of `count` submaps of a kind were found in a collection of nothing else; which were not."""
    missed, apart = list[Figures](), 0.0
    (make, reach), config = KINDS[kind], Config()
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        xy = observe(make(rng), SE2(0.5 * _SIDE, 0.5 * _SIDE, 0.0), Sensor(reach), rng).xy
        moved = SE2(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-math.pi, math.pi))
        recognizer = Recognizer(config)
        recognizer.add([(0, describe(xy, config))])
        found = recognizer.locate(moved.apply(xy))
        if found.verdict != "matched":
            missed.append({"submap": number, "landmarks": len(xy), "reason": found.reason})
            continue
        apart = max(apart, (found.candidates[0].transform @ moved).distance(SE2.identity())[0])
    return {"submaps": count, "found": count - len(missed), "missed": missed, "most_metres": apart}


def _together(count: int, seed: int) -> Figures:
    """How many of `count` pairs of robots at one place were told of each other."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "meetings.db"
        with served(path, Path(folder) / "log0") as one, served(path, Path(folder) / "log1") as other:
            robots = [httpx.Client(base_url=server.url, timeout=120.0) for server in (one, other)]
            robots[0].put(_COLLECTION, json={}).raise_for_status()
            with ThreadPoolExecutor(len(robots)) as pool:
                untold = [place for place in range(count) if not _meet(pool, robots, place, seed)]
            for robot in robots:
                robot.close()
            return {"pairs": count, "untold": untold, "logged": _logged(one, other)}


def _meet(pool: ThreadPoolExecutor, robots: list[httpx.Client], place: int, seed: int) -> bool:
    """Whether the robot that committed last was told of the other."""
    trees = forest(seed, place)
    barrier = threading.Barrier(len(robots))

    def arrive(robot: int) -> dict[str, Any]:
        rng = np.random.default_rng([seed, place, robot])
        kept = trees[rng.random(len(trees)) < _SEEN]
        seen = SE2(rng.uniform(-5.0, 5.0), rng.uniform(-5.0, 5.0), rng.uniform(-math.pi, math.pi)).apply(kept)
        body = {
            "xy": (seen + rng.normal(0.0, _NOISE, seen.shape)).round(3).tolist(),
            "session": f"robot-{robot}",
            "query": {"exclude": {"session": f"robot-{robot}"}},
        }
        barrier.wait()
        answer = robots[robot].put(f"{_COLLECTION}/submaps/r{robot}-{place}", json=body)
        return dict(answer.raise_for_status().json())

    first, last = sorted(pool.map(arrive, range(len(robots))), key=lambda one: int(one["revision"]))
    candidates = last["query"]["candidates"] if last["query"]["verdict"] == "matched" else []
    return bool(candidates) and candidates[0]["submap_id"] == first["id"]


def _logged(*servers: BenchmarkServer) -> list[str]:
    return [line for server in servers for line in server.failures()][:20]
