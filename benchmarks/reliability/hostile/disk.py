"""A disk that is full: while submaps are stored, while lines are imported, while a snapshot is made, at a start."""

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.hostile.jobs import finished, has_jobs, ndjson
from benchmarks.reliability.trees import body
from benchmarks.server_process import served

_BASE: Final = "/v1/collections/plots"
_MEGABYTES: Final = 48
_BALLAST: Final = 36
"""MB that are taken away, and given back."""


def run(*, quick: bool, seed: int) -> Figures:
    """On a small disk of its own; needs leave to mount one."""
    with tempfile.TemporaryDirectory() as folder:
        disk, log = Path(folder) / "disk", Path(folder) / "log"
        disk.mkdir()
        with _mounted(disk) as there:
            if not there:
                return {"skipped": "no file system can be mounted here", "problems": []}
            return _fill(disk, log, seed)


def _fill(disk: Path, log: Path, seed: int) -> Figures:
    path, ballast, problems = disk / "full.db", disk / "ballast", list[str]()
    figures: Figures = {"megabytes": _MEGABYTES}
    with served(path, log) as server, httpx.Client(base_url=server.url, timeout=120.0) as client:
        client.put(_BASE, json={}).raise_for_status()
        ballast.write_bytes(bytes(_BALLAST * 1_000_000))
        stored, full = 0, None
        for number in range(20_000):
            response = client.put(f"{_BASE}/submaps/s{number}", json=body(seed, number))
            if response.status_code != 201:
                full = response
                break
            stored += 1
        figures["stored"] = stored
        if full is None or (full.status_code, full.json()["type"]) != (507, "/problems/storage-full"):
            problems.append(f"a full disk is told as {full and full.status_code}: {full and full.text[:200]}")
        problems += _intact(client, seed, stored)
        if has_jobs(client):
            figures["import_full"] = _import(client, problems, seed, full=True)
        if "/v1/snapshots" in client.get("/openapi.json").json()["paths"]:
            figures["snapshot_full"] = _snapshot(client, problems, path, full=True)
        server.kill()
    problems += [line for line in server.failures() if "507" not in line and "full" not in line]
    # At a start on a disk that is still full: what is there is read, whatever cannot be written.
    with (
        suppress(RuntimeError),
        served(path, log) as server,
        httpx.Client(base_url=server.url, timeout=120.0) as client,
    ):
        figures["started_on_a_full_disk"] = True
        problems += _intact(client, seed, stored)
    figures.setdefault("started_on_a_full_disk", False)
    ballast.unlink()
    with served(path, log) as server, httpx.Client(base_url=server.url, timeout=120.0) as client:
        problems += _intact(client, seed, stored)
        again = client.put(f"{_BASE}/submaps/again", json=body(seed, 90_000))
        if again.status_code != 201:
            problems.append(f"with room again a PUT is answered {again.status_code}: {again.text[:200]}")
        if has_jobs(client):
            figures["import_after"] = _import(client, problems, seed, full=False)
        if "/v1/snapshots" in client.get("/openapi.json").json()["paths"]:
            figures["snapshot_after"] = _snapshot(client, problems, path, full=False)
    return {**figures, "problems": problems[:20]}


def _intact(client: httpx.Client, seed: int, stored: int) -> list[str]:
    """What was acknowledged is counted, and some of it asked for."""
    counted = client.get(_BASE).json().get("counts", {}).get("submaps")
    wrong = [] if counted in (stored, stored + 1) else [f"{counted} submaps are counted, {stored} were acknowledged"]
    for number in range(0, stored, max(1, stored // 25)):
        answer: dict[str, Any] = client.post(f"{_BASE}/queries", json=body(seed, number)).json()
        best = answer["candidates"][0]["submap_id"] if answer.get("candidates") else None
        if best != f"s{number}":
            wrong.append(f"s{number} is not found: {answer.get('verdict') or answer.get('title')}, {best}")
    return wrong


def _import(client: httpx.Client, problems: list[str], seed: int, *, full: bool) -> str:
    """How an import ends."""
    name = "imported-full" if full else "imported"
    made = client.put(f"/v1/collections/{name}", json={})
    target = name if made.status_code in (200, 201) else "plots"
    raw = ndjson(seed, 1 if full else 2, 5_000 if full else 200)
    response = client.post(
        f"/v1/collections/{target}/imports", content=raw, headers={"Content-Type": "application/x-ndjson"}
    )
    if response.status_code != 202:
        if not full or response.status_code != 507:
            problems.append(f"an import is answered {response.status_code}: {response.text[:200]}")
        return f"answered {response.status_code}"
    job = finished(client, response.headers["Location"], 30.0)
    kind = (job.get("problem") or {}).get("type", "")
    if full and (job["state"] == "successful" or (job["state"] == "failed" and kind != "/problems/storage-full")):
        problems.append(f"an import on a full disk is {job['state']}: {kind}")
    if not full and job["state"] != "successful":
        problems.append(f"with room again an import is {job['state']}: {job.get('problem')}")
    return f"{job['state']} {kind}".strip()


def _snapshot(client: httpx.Client, problems: list[str], path: Path, *, full: bool) -> str:
    """How a snapshot ends; one that fails leaves nothing behind."""
    folder = path.with_name(path.name + ".snapshots")
    before = _files(folder)
    response = client.post("/v1/snapshots", json={})
    left = _files(folder) - before
    if full and (response.status_code != 507 or left):
        problems.append(f"a snapshot on a full disk is answered {response.status_code}, {len(left)} files are left")
    if not full and response.status_code not in (201, 507):
        problems.append(f"with room again a snapshot is answered {response.status_code}: {response.text[:200]}")
    return f"answered {response.status_code}"


def _files(folder: Path) -> set[Path]:
    """What lies there, but for the lock, which is empty and stays."""
    return {path for path in folder.iterdir() if path.suffix != ".lock"} if folder.is_dir() else set()


@contextmanager
def _mounted(folder: Path) -> Iterator[bool]:
    """A small file system at `folder`; False where that is not allowed."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={_MEGABYTES}m", "tmpfs", str(folder)]
    try:
        there = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        there = False
    try:
        yield there
    finally:
        if there:
            subprocess.run(["umount", str(folder)], check=True)
