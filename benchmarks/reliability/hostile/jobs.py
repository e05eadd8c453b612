"""Imports, and other jobs, that are under way when the server ends: each goes on, and leaves what it should."""

import json
import time
from dataclasses import dataclass, field
from typing import Any, Final

import httpx
import orjson

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body

_BASE: Final = "/v1/collections/imported"
_PATIENCE: Final = 120.0
"""Seconds within which a job that was interrupted must have ended, or come further."""
_DONE: Final = ("successful", "failed", "dismissed")


def has_jobs(client: httpx.Client) -> bool:
    """Whether the server has the routes of jobs."""
    return "/v1/jobs" in client.get("/openapi.json").json()["paths"]


def ndjson(seed: int, number: int, lines: int) -> bytes:
    """An import of so many lines, every fiftieth of which is no submap."""
    made = [
        b'{"id": "wrong"}' if line % 50 == 49 else orjson.dumps({"id": f"i{number}-{line}", **body(seed, number, line)})
        for line in range(lines)
    ]
    return b"\n".join(made) + b"\n"


def finished(client: httpx.Client, path: str, patience: float = _PATIENCE) -> dict[str, Any]:
    """The job document once it has ended, or as it is when nothing has come of it for longer than patience lasts."""
    until, far = time.monotonic() + patience, -1
    while True:
        job: dict[str, Any] = client.get(f"{path}?wait=10").json()
        if job.get("done", far) > far:
            until, far = time.monotonic() + patience, job["done"]
        if job.get("state") in _DONE or time.monotonic() > until:
            return job


@dataclass
class JobInterrupted:
    """Jobs that were under way when the server ended.

    Args:
        seed: of their forests.
        lines: of each import.
    """

    seed: int
    lines: int
    under_way: list[tuple[str, str, int]] = field(default_factory=list)
    ended: dict[str, int] = field(default_factory=dict)
    interrupted: int = 0

    def start(self, client: httpx.Client, number: int) -> None:
        """An import, and beside it now a reindex, now a search for constraints."""
        client.put(_BASE, json={}).raise_for_status()
        raw = ndjson(self.seed, number, self.lines)
        headers = {"Content-Type": "application/x-ndjson"}
        accepted = client.post(f"{_BASE}/imports", content=raw, headers=headers)
        accepted.raise_for_status()
        self.under_way.append(("import", accepted.headers["Location"], number))
        for kind, turn, members in (("reindex", 2, None), ("constraints", 0, {"exclude": {"same_session": False}})):
            if number % 3 == turn and number:
                other = client.post(f"/v1/collections/plots/{kind}", json=members)
                other.raise_for_status()
                self.under_way.append((kind, other.headers["Location"], number))

    def note(self, client: httpx.Client) -> None:
        """Count those that have not ended, right before the server is."""
        self.interrupted += sum(client.get(path).json().get("state") not in _DONE for _, path, _ in self.under_way)

    def look(self, client: httpx.Client) -> list[str]:
        """What is wrong with those that were started before, once each has ended."""
        wrong, self.under_way, before = list[str](), [], self.under_way
        for kind, path, number in before:
            job = finished(client, path)
            self.ended[f"{kind} {job.get('state')}"] = self.ended.get(f"{kind} {job.get('state')}", 0) + 1
            if job.get("state") != "successful":
                wrong.append(f"{kind} {path} is {job.get('state')}: {job.get('problem')}")
            elif kind == "constraints" and client.get(f"{path}/results").status_code != 200:
                wrong.append(f"{path} has no results")
            elif kind == "import":
                wrong += [f"{path}: {what}" for what in self._imported(client, path, number)]
        return wrong

    def _imported(self, client: httpx.Client, path: str, number: int) -> list[str]:
        wrong = []
        results = [json.loads(line) for line in client.get(f"{path}/results").text.splitlines()]
        if [one["line"] for one in results] != list(range(1, self.lines + 1)):
            wrong.append(f"{len(results)} results for {self.lines} lines, or not in their order")
        bad = [one["line"] for one in results if (one["outcome"] == "refused") != (one["line"] % 50 == 0)]
        if bad:
            wrong.append(f"lines {bad[:5]} have another outcome than they should")
        for line in range(0, self.lines, max(1, self.lines // 20)):
            if line % 50 == 49:
                continue
            name = f"i{number}-{line}"
            answer = client.post(f"{_BASE}/queries", json=body(self.seed, number, line)).json()
            best = answer["candidates"][0]["submap_id"] if answer.get("candidates") else None
            if (answer.get("verdict"), best) != ("matched", name):
                wrong.append(f"{name} is not found: {answer.get('verdict')}, {best}")
        return wrong

    def figures(self) -> Figures:
        """How many were interrupted, and how all of them ended."""
        return {"interrupted": self.interrupted, "ended": self.ended, "lines": self.lines}
