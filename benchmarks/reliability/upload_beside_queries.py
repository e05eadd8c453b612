"""Part `season`: a survey office uploads all it saw, while robots go on asking.

The robots ask in a collection of their own, one query after another with a pause between. The same lines are stored by
the library alone for comparison.
"""

import gzip
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.hostile.jobs import finished
from benchmarks.reliability.prefilled import lines_of, store
from benchmarks.reliability.traffic import questions
from benchmarks.scale.measurement import spread
from benchmarks.scale.tiled_forest import World
from benchmarks.server_process import served

_ROBOTS: Final = "/v1/collections/robots"
_SEASON: Final = "/v1/collections/season"
_JSON: Final = {"Content-Type": "application/json"}
_UPLOAD: Final = {"Content-Type": "application/x-ndjson", "Content-Encoding": "gzip"}
_PAUSE: Final = 0.05
_PATIENCE: Final = 1800.0


def run(*, quick: bool, seed: int) -> Figures:
    """Ask alone, during the import, and after it; seconds of the upload and of the import."""
    lines, mapped, seconds = (2_000, 100, 2.0) if quick else (100_000, 1_000, 20.0)
    world, robots = World(lines, seed), World(mapped, seed + 1)
    asked = [one.raw for one in questions(robots, 100)]
    with tempfile.TemporaryDirectory() as room:
        folder = Path(room)
        upload = folder / "season.ndjson.gz"
        with gzip.open(upload, "wb", compresslevel=1) as file:
            file.writelines(line + b"\n" for line in lines_of(world))
        with gzip.open(upload, "rb") as packed:
            library = _store(folder / "library.db", _SEASON, packed, lines)
        path = folder / "season.db"
        _store(path, _ROBOTS, lines_of(robots), mapped)
        megabytes = upload.stat().st_size / 1e6
        with (
            served(path, folder / "log") as server,
            httpx.Client(base_url=server.url, timeout=_PATIENCE) as client,
        ):
            client.put(_SEASON, json={}).raise_for_status()
            with _asking(server.url, asked) as before:
                time.sleep(seconds)
            with _asking(server.url, asked) as during:
                began = time.perf_counter()
                with upload.open("rb") as file:
                    posted = client.post(f"{_SEASON}/imports", content=file, headers=_UPLOAD)
                uploaded = time.perf_counter() - began
                job = finished(client, posted.raise_for_status().headers["Location"], _PATIENCE)
                imported = time.perf_counter() - began
            began = time.perf_counter()
            first = client.post(f"{_SEASON}/queries", content=questions(world, 1)[0].raw, headers=_JSON)
            first_seconds = time.perf_counter() - began
            with _asking(server.url, asked) as after:
                time.sleep(seconds)
            results = sum(1 for _ in client.get(job["links"]["results"]).iter_lines())
            logged = server.failures()
    return {
        "lines": lines,
        "megabytes": megabytes,
        "upload_seconds": uploaded,
        "import_seconds": imported,
        "a_second": lines / imported,
        "library_a_second": library,
        "state": job["state"],
        "counts": job["counts"],
        "results": results,
        "first_query": {"verdict": first.json()["verdict"], "seconds": first_seconds},
        "before": _summary(before),
        "during": _summary(during),
        "after": _summary(after),
        "logged": logged[:20],
    }


def _store(path: Path, collection: str, lines: Iterable[bytes], count: int) -> float:
    """Store so many lines without the service; submaps a second."""
    stored, seconds = store(path, collection.rpartition("/")[2], lines)
    if stored != count:
        raise RuntimeError(f"{stored} of {count} lines were stored")
    return count / seconds


@contextmanager
def _asking(url: str, asked: list[bytes]) -> Iterator[list[tuple[float, Any]]]:
    """One robot that asks; milliseconds and verdicts of its answers, in which only `matched` is right."""
    told: list[tuple[float, Any]] = []
    stop = threading.Event()

    def ask() -> None:
        with httpx.Client(base_url=url, timeout=_PATIENCE) as client:
            number = 0
            while not stop.wait(_PAUSE):
                began = time.perf_counter()
                response = client.post(f"{_ROBOTS}/queries", content=asked[number % len(asked)], headers=_JSON)
                spent = 1e3 * (time.perf_counter() - began)
                told.append((spent, response.json().get("verdict", response.status_code)))
                number += 1

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield told
    finally:
        stop.set()
        thread.join()


def _summary(told: list[tuple[float, Any]]) -> Figures:
    return {
        "asked": len(told),
        "matched": sum(verdict == "matched" for _, verdict in told),
        **spread([milliseconds for milliseconds, _ in told]),
    }
