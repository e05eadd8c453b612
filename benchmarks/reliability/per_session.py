"""Part `fleet`: who has been here, and when? Several robots drove through one forest; a query comes from another drive.

Each session has seen a part of the places, each with noise of its own. A session has been here when one of its submaps
has its centre within reach of where the query was made; one that only touches the place may be found, too, and its pose
is held to the same measure.
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np

from benchmarks.experiments import Figures
from benchmarks.reliability.prefilled import store
from benchmarks.reliability.traffic import BASE, COLLECTION
from benchmarks.scale.asking import is_right
from benchmarks.scale.measurement import spread
from benchmarks.scale.tiled_forest import World
from benchmarks.server_process import served
from server.schemas.submaps import NamedSubmap
from server.submaps import described_batches
from urquhart.se2 import SE2

_SESSIONS: Final = 5
_SHARE: Final = 0.6
"""Of all places, in each session."""
_REACH: Final = 25.0
"""Metres: half the way between two places, and half the range of the sensor."""
_KINDS: Final = {"inside-20": "20 cm, 90 % seen", "outside-20": "20 cm, 90 % seen, another forest"}


def run(*, quick: bool, seed: int) -> Figures:
    """Store the sessions, then ask from inside and from another forest, with `per_session` and without."""
    places, asked = (400, 40) if quick else (10_000, 400)
    world = World(places, seed)
    rng = np.random.default_rng([seed, 77])
    drives = [rng.random(places) < _SHARE for _ in range(_SESSIONS)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fleet.db"
        submaps, _ = store(path, COLLECTION, _lines(world, drives))
        with (
            served(path, Path(folder) / "log") as server,
            httpx.Client(base_url=server.url, timeout=120.0) as client,
        ):
            client.post(f"{BASE}/queries", json=_question(world, "inside-20", asked)).raise_for_status()
            kinds = {kind: _ask(client, world, drives, kind, asked) for kind in _KINDS}
            logged = server.failures()
    return {
        "sessions": _SESSIONS,
        "places": places,
        "submaps": submaps,
        "share": _SHARE,
        "reach": _REACH,
        "kinds": kinds,
        "logged": logged[:20],
    }


def _lines(world: World, drives: list[Any]) -> Iterator[bytes]:
    """What each session saw."""
    for drive, seen in enumerate(drives):
        for place in np.flatnonzero(seen).tolist():
            submap = {
                "id": f"{drive}-{place}",
                "xy": world.submap(place, drive).xy.tolist(),
                "session": f"drive-{drive}",
                "stamp": f"2026-05-{drive + 1:02}T09:00:00Z",
            }
            yield described_batches.line_of(NamedSubmap.model_validate(submap))


def _question(world: World, kind: str, number: int) -> dict[str, Any]:
    return {"xy": world.query(kind, number).xy.round(3).tolist()}


def _ask(client: httpx.Client, world: World, drives: list[Any], kind: str, asked: int) -> Figures:
    """What became of the questions: sessions that had been here and were named, and what was named wrongly."""
    single: list[float] = []
    every: list[float] = []
    been = named = touched = wrong = twice = 0
    for number in range(asked):
        body = _question(world, kind, number)
        truth = world.query(kind, number).pose
        single.append(_timed(client, body)[0])
        spent, answer = _timed(client, body | {"per_session": True, "limit": 2 * _SESSIONS})
        every.append(spent)
        here = _been_here(world, drives, truth) if kind.startswith("inside") else set()
        been += len(here)
        found = [one for one in answer["candidates"] if one["refused"] is None]
        if answer["verdict"] != "matched":
            found = []
        for one in found:
            pose = one["transform"]
            drive, place = map(int, one["submap_id"].split("-"))
            submap = world.submap(place, drive).pose
            right = is_right(submap, SE2(pose["x"], pose["y"], pose["yaw"]), truth) and kind.startswith("inside")
            wrong += not right
            named += right and one["session"] in here
            touched += right and one["session"] not in here
        twice += len({one["session"] for one in found}) != len(found)
    return {
        "name": _KINDS[kind],
        "asked": asked,
        "been": been,
        "named": named,
        "touched": touched,
        "wrong": wrong,
        "twice": twice,
        "single": spread(single),
        "every": spread(every),
    }


def _been_here(world: World, drives: list[Any], truth: SE2) -> set[str]:
    """Sessions with a submap whose centre is within reach."""
    place = world.nearest(truth.x, truth.y)
    if world.submap(place).pose.distance(truth)[0] > _REACH:
        return set()
    return {f"drive-{drive}" for drive, seen in enumerate(drives) if seen[place]}


def _timed(client: httpx.Client, body: dict[str, Any]) -> tuple[float, dict[str, Any]]:
    began = time.perf_counter()
    response = client.post(f"{BASE}/queries", json=body).raise_for_status()
    answer: dict[str, Any] = response.json()
    return 1e3 * (time.perf_counter() - began), answer
