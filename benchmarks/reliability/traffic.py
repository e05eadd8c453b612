"""Clients of a fleet: each asks again and again, and stores now and then; everything that it was told is kept."""

import asyncio
import random
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import httpx
import orjson

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.scale.asking import is_right
from benchmarks.scale.measurement import spread
from benchmarks.scale.tiled_forest import World
from urquhart.se2 import SE2

COLLECTION: Final = "load"
BASE: Final = f"/v1/collections/{COLLECTION}"
_JSON: Final = {"Content-Type": "application/json"}
_WRITES: Final = 0.1
"""Share of the requests that store something."""
_TIMEOUT: Final = 120.0
_LONGEST: Final = 2.0
"""Seconds for which a client that is asked to come back later waits at most."""


@dataclass(frozen=True, slots=True)
class TrafficQuery:
    """A query: its body, and where it was made (`map_T_query`)."""

    raw: bytes
    truth: SE2


@dataclass
class Told:
    """What clients were told.

    Attributes:
        milliseconds: of the answers that did what was asked, by kind of request.
        stored: ids by the seed of their forest, of writes that were acknowledged.
        refused: requests that were turned away, by status, each with Retry-After.
        errors: whatever else came, by what it was.
        matched: queries that found a pose, and of them those that found a wrong one.
        seconds: from the first request to the last answer.
    """

    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    stored: dict[str, tuple[int, ...]] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)
    errors: Counter[str] = field(default_factory=Counter)
    matched: int = 0
    wrong: int = 0
    seconds: float = 0.0

    def figures(self) -> Figures:
        """As they are published."""
        kinds = {kind: {"count": len(times), **spread(times)} for kind, times in sorted(self.milliseconds.items())}
        answered = sum(len(times) for times in self.milliseconds.values())
        return {
            "kinds": kinds,
            "answered": answered,
            "a_second": answered / self.seconds,
            "refused": dict(self.refused),
            "errors": dict(self.errors.most_common(10)),
            "matched": self.matched,
            "wrong": self.wrong,
            "seconds": self.seconds,
        }


def questions(world: World, count: int) -> list[TrafficQuery]:
    """So many queries from inside the world."""
    made = []
    for number in range(count):
        seen = world.query("inside-20", number)
        made.append(TrafficQuery(orjson.dumps({"xy": seen.xy.round(3).tolist()}), seen.pose))
    return made


async def drive(
    url: str, world: World, asked: Sequence[TrafficQuery], *, clients: int, seconds: float, seed: int
) -> Told:
    """So many clients at a time for so long."""
    told = Told()
    limits = httpx.Limits(max_connections=clients, max_keepalive_connections=clients)
    async with httpx.AsyncClient(base_url=url, limits=limits, timeout=_TIMEOUT) as client:
        began = time.perf_counter()
        crew = [_Client(client, world, asked, told, (seed, number)) for number in range(clients)]
        await asyncio.gather(*(one.work(began + seconds) for one in crew))
        told.seconds = time.perf_counter() - began
    return told


class _Client:
    def __init__(
        self, http: httpx.AsyncClient, world: World, asked: Sequence[TrafficQuery], told: Told, seed: tuple[int, int]
    ) -> None:
        self.http, self.world, self.asked, self.told, self.seed = http, world, asked, told, seed
        self.rng = random.Random(str(seed))
        self.number = 0

    async def work(self, until: float) -> None:
        while time.perf_counter() < until:
            if self.rng.random() >= _WRITES:
                await self._query()
            else:
                await self._store(post=self.rng.random() < 0.5)

    async def _query(self) -> None:
        question = self.rng.choice(self.asked)
        response = await self._send("query", "POST", f"{BASE}/queries", question.raw, {}, 200)
        if response is None:
            return
        answer = response.json()
        if answer["verdict"] == "matched":
            self.told.matched += 1
            self.told.wrong += not self._is_right(answer["candidates"][0], question)

    def _is_right(self, best: dict[str, Any], question: TrafficQuery) -> bool:
        if not best["submap_id"].startswith("s"):
            return False  # what the clients store is from nowhere in this world
        pose = best["transform"]
        submap = self.world.submap(int(best["submap_id"][1:])).pose
        return is_right(submap, SE2(pose["x"], pose["y"], pose["yaw"]), question.truth)

    async def _store(self, *, post: bool) -> None:
        self.number += 1
        seed = (*self.seed, self.number)
        name = "w" + "-".join(map(str, seed))
        raw = orjson.dumps(body(*seed))
        if post:
            key = {"Idempotency-Key": name}
            response = await self._send("POST submap", "POST", f"{BASE}/submaps", raw, key, 201)
        else:
            response = await self._send("PUT submap", "PUT", f"{BASE}/submaps/{name}", raw, {}, 201)
        if response is not None:
            self.told.stored[response.json()["id"]] = seed

    async def _send(
        self, kind: str, method: str, path: str, raw: bytes, headers: dict[str, str], good: int
    ) -> httpx.Response | None:
        """The answer where it is the one that is hoped for; anything else is counted."""
        began = time.perf_counter()
        try:
            response = await self.http.request(method, path, content=raw, headers=_JSON | headers)
        except httpx.TransportError as error:
            self.told.errors[f"{kind}: {type(error).__name__}"] += 1
            return None
        if response.status_code == good:
            self.told.milliseconds.setdefault(kind, []).append(1e3 * (time.perf_counter() - began))
            return response
        wait = response.headers.get("Retry-After", "")
        if response.status_code in (429, 503) and wait.isdigit():
            self.told.refused[str(response.status_code)] += 1
            await asyncio.sleep(min(float(wait), _LONGEST) * self.rng.uniform(0.5, 1.0))
        else:
            self.told.errors[f"{kind}: {response.status_code} {response.text[:120]}"] += 1
        return None
