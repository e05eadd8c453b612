"""The console in a real browser: `browser.test.mjs` drives Chromium over a service without keys, and one with keys."""

import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from server.app import create_app
from server.config.settings import Settings
from server.security import api_keys
from server.security.console_sessions import ConsoleSessions
from server.security.principal import Scope
from tests.server.factories import forest, observed, points
from tests.server.served import Threaded, wait_until

ROOT = Path(__file__).parents[3]
CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
HOSTILE = "<img src=x onerror=alert(1)>"

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not here (apt-get install chromium)"),
    pytest.mark.skipif(
        shutil.which("node") is None or not (ROOT / "node_modules" / "playwright-core").exists(),
        reason="node, or what `npm ci` installs, is not here",
    ),
]


def ask(client: httpx.Client, collection: str, **body: Any) -> dict[str, Any]:
    path = f"/v1/collections/{collection}/queries"
    answer: dict[str, Any] = client.post(path, json={"store": True, "explain": True, **body}).raise_for_status().json()
    return answer


def fill(client: httpx.Client) -> dict[str, Any]:
    """Three answers, one of each verdict, in collections whose texts try to be more than text."""
    client.put("/v1/collections/plots", json={"title": HOSTILE}).raise_for_status()
    for seed in (1, 2):
        trees = forest(seed)
        body = {
            "xy": points(trees),
            "ids": [f"{HOSTILE}{at}" for at in range(len(trees))],
            "session": HOSTILE,
            "map_pose": {"frame_id": "map", "x": 90.0 * seed, "y": 0.0, "yaw": 0.0},
        }
        client.put(f"/v1/collections/plots/submaps/p{seed}", json=body).raise_for_status()
    seen, _ = observed(forest(1), 5)
    matched = ask(client, "plots", xy=seen[:45], ids=[f"{HOSTILE}q{at}" for at in range(45)])
    no_match = ask(client, "plots", xy=points(forest(9)))
    client.put("/v1/collections/drive", json={}).raise_for_status()
    for at in (1, 2, 3):
        body = {
            "xy": points(forest(at)),
            "stamp": f"2026-05-04T09:0{at}:00Z",
            "map_pose": {"frame_id": "map", "x": 90.0 * at, "y": 0.0, "yaw": 0.0},
        }
        client.put(f"/v1/collections/drive/submaps/d{at}", json=body).raise_for_status()
    covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]
    edges = [
        {"from": f"d{at}", "to": f"d{at + 1}", "x": 90.0, "y": 0.0, "yaw": 0.0, "covariance": covariance}
        for at in (1, 2)
    ]
    client.post("/v1/collections/drive/odometry", json={"edges": edges}).raise_for_status()
    client.patch("/v1/collections/drive/submaps/d3", json={"xy": points(forest(4))}).raise_for_status()
    rows = np.random.default_rng(3).normal(0.0, 0.03, (144, 2)) + [
        (3.0 * x, 3.0 * y) for x in range(12) for y in range(12)
    ]
    client.put("/v1/collections/rows", json={}).raise_for_status()
    client.put("/v1/collections/rows/submaps/r1", json={"xy": points(rows)}).raise_for_status()
    inner = np.array([at for at in range(144) if 3 <= at // 12 < 9 and 3 <= at % 12 < 9])
    ambiguous = ask(client, "rows", xy=points(rows[inner]))
    lines = '{"id":"a1","xy":[[0,0],[3,0],[0,4]]}\n{"id":"a2","xy":[[0,0]]}\n'
    job = client.post("/v1/collections/rows/imports", content=lines, headers={"Content-Type": "application/x-ndjson"})
    client.get(job.raise_for_status().headers["Location"], params={"wait": 25}).raise_for_status()
    return {"matched": matched, "no_match": no_match, "ambiguous": ambiguous}


@pytest.fixture
def services(tmp_path: Path) -> Iterator[dict[str, Any]]:
    """What the tests in the browser are told: two services, what they hold, keys."""
    (tmp_path / "open").mkdir()
    (tmp_path / "closed").mkdir()
    folders = [tmp_path / "open" / "a.db", tmp_path / "closed" / "a.db"]
    servers = [Threaded(create_app(Settings(database=str(database)))) for database in folders]
    try:
        for server in servers:
            wait_until(lambda server=server: server.service.readiness.ready)  # type: ignore[misc]
        answers = fill(servers[0].client)
        servers[1].client.put("/v1/collections/secret", json={}).raise_for_status()
        servers[1].client.put("/v1/collections/plots", json={}).raise_for_status()
        database = servers[1].service.database
        admin, row = api_keys.make(database, "operator", list(Scope), ["*"])
        reader, _ = api_keys.make(database, "reader", [Scope.READ], ["plots*"])
        servers[1].app.state.authenticator._asks_for_keys = None
        ended, _ = ConsoleSessions(folders[1]).issue(row.id, row.digest, hours=-0.1)
        yield {
            "chromium": CHROMIUM,
            "open": servers[0].url,
            "closed": servers[1].url,
            "answers": answers,
            "seen": observed(forest(1), 6)[0],
            "p2": points(forest(2) + (180.0, 0.0)),
            "admin": admin,
            "reader": reader,
            "ended": ended,
            "hostile": HOSTILE,
        }
    finally:
        for server in servers:
            server.close()


def test_the_console_in_a_browser(services: dict[str, Any], tmp_path: Path) -> None:
    told = tmp_path / "told.json"
    told.write_text(json.dumps(services))
    # The path of a socket has at most 107 bytes, which those of pytest's folders leave no room for.
    with tempfile.TemporaryDirectory(prefix="ui-", dir="/tmp") as short:
        ran = subprocess.run(
            ["node", "--test", "--test-reporter=tap", str(Path(__file__).parent / "browser.test.mjs")],
            cwd=ROOT,
            env=os.environ | {"CONSOLE_TOLD": str(told), "TMPDIR": short},
            capture_output=True,
            text=True,
            check=False,
        )
    assert ran.returncode == 0, ran.stdout[-6000:] + ran.stderr[-2000:]
    assert "# skipped 0" in ran.stdout
    assert int(re.findall(r"^# pass (\d+)$", ran.stdout, flags=re.MULTILINE)[0]) >= 14
