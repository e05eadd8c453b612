"""Whatever is done to a sound database, at once and in any order, `db check` finds it sound."""

import random
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import orjson

from server.app import create_app
from server.checks.all_checks import inspect
from server.config.settings import Limits, Settings
from server.config.settings_groups import IndexSettings, JobSettings
from server.security import api_keys
from server.security.principal import Scope
from server.service_parts import Service
from server.store.sqlite.database import Database
from tests.server.factories import TestClient, forest, observed, points
from tests.server.processes import Server

NAMES = [f"p{i}" for i in range(10)]
TREES = [forest(seed, 25, 22.0) for seed in range(6)]
NDJSON = {"Content-Type": "application/x-ndjson"}
SMALL = IndexSettings(flush_submaps=2, memory_submaps=6, block_submaps=3, maintenance_seconds=0.02)


class Caller:
    """One of several who do anything at random; every answer is a success or a problem of the caller's own making."""

    def __init__(self, client: httpx.Client, seed: int) -> None:
        self.client, self.rng = client, random.Random(seed)
        self.jobs: list[str] = []
        self.done: list[str] = []
        self._steps: list[Callable[[], httpx.Response]] = [
            *[self.put] * 6, *[self.patch] * 2, *[self.delete] * 2, self.query, self.store_query, self.post,
            self.load, self.load, self.reindex, self.constraints, self.follow, self.forget, self.snapshot,
            self.drop_collection, self.patch_collection,
        ]  # fmt: skip

    def step(self) -> None:
        work = self.rng.choice(self._steps)
        response = work()
        self.done.append(f"{work.__name__} {response.status_code}")
        assert response.status_code < 500 and response.status_code != 401, (work.__name__, response.text)
        if response.status_code == 202 and "Location" in response.headers:
            self.jobs.append(response.headers["Location"])

    @property
    def base(self) -> str:
        return f"/v1/collections/{self.rng.choice(['plots', 'plots', 'stands'])}"

    def content(self) -> dict[str, Any]:
        rng, seed = self.rng, self.rng.randrange(len(TREES))
        body: dict[str, Any] = {"xy": points(TREES[seed])}
        if rng.random() < 0.5:
            body = {"landmarks": [{"x": x, "y": y, "dbh_cm": rng.choice([None, 30.0])} for x, y in body["xy"]]}
        if rng.random() < 0.5:
            body |= {"session": rng.choice(["mon", "tue"]), "stamp": f"2026-05-04T09:{rng.randrange(60):02}:00Z"}
        if rng.random() < 0.5:
            body["map_pose"] = {"x": rng.uniform(-99, 99), "y": rng.uniform(-99, 99), "yaw": rng.uniform(-3, 3)}
        if rng.random() < 0.2:
            body["properties"] = {"a": [rng.random(), 2**63, None]}
        return body

    def key(self) -> dict[str, str]:
        return {"Idempotency-Key": f"k{self.rng.randrange(5)}"} if self.rng.random() < 0.3 else {}

    def put(self) -> httpx.Response:
        return self.client.put(f"{self.base}/submaps/{self.rng.choice(NAMES)}", json=self.content())

    def post(self) -> httpx.Response:
        return self.client.post(f"{self.base}/submaps", json=self.content(), headers=self.key())

    def patch(self) -> httpx.Response:
        body = self.rng.choice(
            [
                {"session": "wed"},
                {"map_pose": None},
                {"map_pose": {"x": 1.0, "y": self.rng.random(), "yaw": 0.0}},
                {"properties": {"b": 1}},
                {"stamp": None},
            ]
        )
        return self.client.patch(f"{self.base}/submaps/{self.rng.choice(NAMES)}", json=body)

    def delete(self) -> httpx.Response:
        return self.client.delete(f"{self.base}/submaps/{self.rng.choice(NAMES)}")

    def query(self) -> httpx.Response:
        seen, _ = observed(TREES[self.rng.randrange(len(TREES))], self.rng.randrange(1000))
        return self.client.post(f"{self.base}/queries", json={"xy": seen})

    def store_query(self) -> httpx.Response:
        seen, _ = observed(TREES[self.rng.randrange(len(TREES))], self.rng.randrange(20))
        body = {"xy": seen, "store": True, "explain": self.rng.random() < 0.5}
        return self.client.post(f"{self.base}/queries", json=body, headers=self.key())

    def load(self) -> httpx.Response:
        lines = [
            orjson.dumps({"id": self.rng.choice(NAMES), **self.content()}) for _ in range(self.rng.randrange(1, 9))
        ]
        lines += [b"{"] * self.rng.randrange(3)
        self.rng.shuffle(lines)
        parameters = {
            "mode": self.rng.choice(["continue", "all"]),
            "on_conflict": self.rng.choice(["replace", "skip", "fail"]),
        }
        return self.client.post(
            f"{self.base}/imports", content=b"\n".join(lines), headers=NDJSON | self.key(), params=parameters
        )

    def reindex(self) -> httpx.Response:
        return self.client.post(f"{self.base}/reindex")

    def constraints(self) -> httpx.Response:
        return self.client.post(f"{self.base}/constraints", json={})

    def follow(self) -> httpx.Response:
        return self.client.get(
            self.rng.choice(self.jobs) + self.rng.choice(["", "/results", "?wait=0.1"]) if self.jobs else "/v1/jobs"
        )

    def forget(self) -> httpx.Response:
        return self.client.delete(self.rng.choice(self.jobs)) if self.jobs else self.client.get("/v1/jobs")

    def snapshot(self) -> httpx.Response:
        return self.client.post("/v1/snapshots")

    def drop_collection(self) -> httpx.Response:
        path = self.base
        if self.rng.random() < 0.6:
            self.client.delete(path)
        return self.client.put(path, json={})

    def patch_collection(self) -> httpx.Response:
        body = self.rng.choice(
            [{"title": "t"}, {"crs": "EPSG:32633", "origin": [400000.0, 5400000.0]}, {"crs": None, "origin": None}]
        )
        return self.client.patch(self.base, json=body)


def together(callers: list[Caller], steps: int) -> None:
    """All of them at once; what goes wrong for one is raised."""
    with ThreadPoolExecutor(len(callers)) as pool:
        for done in [pool.submit(_do, caller, steps) for caller in callers]:
            done.result(300.0)


def _do(caller: Caller, steps: int) -> None:
    for _ in range(steps):
        caller.step()


def finish(client: httpx.Client) -> None:
    """Wait until no job is unfinished."""
    deadline = time.monotonic() + 120.0
    while any(job["finished"] is None for job in client.get("/v1/jobs", params={"limit": 50}).json()["jobs"]):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_service_that_is_asked_for_anything(tmp_path: Path) -> None:
    settings = Settings(
        database=str(tmp_path / "any.db"),
        index=SMALL,
        jobs=JobSettings(processes=1, keep_jobs=5),
        limits=Limits(page_default=50, page_max=50, stored_queries=5),
    )
    app = create_app(settings)
    with TestClient(app) as client:
        service: Service = app.state.service
        secret, _ = api_keys.make(service.database, "all", list(Scope), ["*"])
        client.headers["Authorization"] = f"Bearer {secret}"
        for name in ("plots", "stands"):
            client.put(f"/v1/collections/{name}", json={}).raise_for_status()
        callers = [Caller(client, i) for i in range(3)]
        for _ in range(3):
            together(callers, 25)
            made = api_keys.make(service.database, "key", list(Scope), ["plots*"])[1]
            api_keys.revoke(service.database, made.id)
            # With jobs at work, segments being merged, and everything half done.
            assert [*inspect(service.database)] == [], callers[0].done
        finish(client)
        done = [one for caller in callers for one in caller.done]
        assert sum(one.endswith((" 200", " 201", " 202", " 204")) for one in done) > len(done) // 2, done
        service.jobs.runner.clean_up()
        assert [*inspect(service.database)] == []
    database = Database(settings.database_path)
    assert [*inspect(database)] == []
    database.dispose()


def test_a_service_that_is_killed_while_it_is_asked_for_anything(serve: Callable[..., Server], tmp_path: Path) -> None:
    path = tmp_path / "killed.db"
    small = {
        f"URQUHART_INDEX__{name.upper()}": str(value) for name, value in SMALL.model_dump(exclude_unset=True).items()
    }
    server = serve(path, **small)
    for turn in range(3):
        for name in ("plots", "stands"):
            server.client.put(f"/v1/collections/{name}", json={}).raise_for_status()
        callers = [Caller(server.client, 100 * turn + i) for i in range(3)]
        worked = threading.Thread(target=_until_gone, args=(callers,))
        worked.start()
        until_done(callers, 20 + 13 * turn)
        server.kill()
        worked.join(120.0)
        database = Database(path)
        assert [*inspect(database)] == [], callers[0].done
        database.dispose()
        server = serve(path, **small)
    finish(server.client)
    assert server.stop() in (0, -15)
    database = Database(path)
    assert [*inspect(database)] == []
    database.dispose()


def until_done(callers: list[Caller], steps: int) -> None:
    """Wait until they have done so many steps together."""
    deadline = time.monotonic() + 120.0
    while sum(len(caller.done) for caller in callers) < steps:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _until_gone(callers: list[Caller]) -> None:
    try:
        together(callers, 10_000)
    except httpx.TransportError:
        return
