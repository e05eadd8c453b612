"""A clock that is set while the service runs: a year back, a year ahead, and there again."""

import ast
import itertools
import tempfile
from pathlib import Path
from typing import Any, Final

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.server_process import BenchmarkServer, served

_YEAR: Final = 365 * 86_400.0
_HOUR: Final = 3_600.0
_JUMPS: Final = (0.0, -_YEAR, _YEAR, -_HOUR, _HOUR, -3 * _YEAR, 20 * _YEAR, 0.0)
_BASE: Final = "/v1/collections/plots"
_SMALL: Final = {"URQUHART_INDEX__FLUSH_SUBMAPS": "4", "URQUHART_INDEX__MAINTENANCE_SECONDS": "0.2"}
"""So that segments are written and merged between the jumps."""
_LOOKS: Final = ("time.time", "time.time_ns", "datetime.now", "datetime.utcnow", "date.today")


def run(*, quick: bool, seed: int) -> Figures:
    """Store, replace, delete, ask, repeat and page after every jump; nothing may depend on what time it is."""
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        clock = Path(folder) / "clock"
        clock.write_text("0")
        program = ("-m", "benchmarks.reliability.hostile.jumping_clock", str(clock))
        with served(Path(folder) / "clock.db", Path(folder) / "log", program, **_SMALL) as server:
            with httpx.Client(base_url=server.url, timeout=60.0) as client:
                client.put(_BASE, json={}).raise_for_status()
                jumps = _JUMPS * (1 if quick else 3)
                for number, jump in enumerate(jumps):
                    clock.write_text(str(jump))
                    problems += [f"{jump / _YEAR:+.2f} years: {what}" for what in _live(client, seed, number)]
                problems += _repeats(client, clock, seed)
            _pages(server, problems, 8 * len(jumps) + 2)
            problems += server.failures()
    return {"jumps": len(jumps), "looks": sorted(looks(Path("server"))), "problems": problems[:20]}


def looks(folder: Path) -> set[str]:
    """Modules of the service that look at the wall clock, by their path in `folder`."""
    found = set()
    for path in folder.rglob("*.py"):
        calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
        if any(ast.unparse(call.func) in _LOOKS for call in calls):
            found.add(str(path.relative_to(folder)))
    return found


def _live(client: httpx.Client, seed: int, number: int) -> list[str]:
    """What a robot does in an hour; what of it went wrong."""
    wrong: list[str] = []
    revision = client.get(_BASE).json()["revision"]
    for turn in range(8):
        client.put(f"{_BASE}/submaps/n{number}-{turn}", json=body(seed, number, turn)).raise_for_status()
    found = {turn: _found(client, seed, number, turn) for turn in range(8)}
    wrong += [f"submap {turn} is {name}" for turn, name in found.items() if name != f"n{number}-{turn}"]
    client.put(f"{_BASE}/submaps/n{number}-0", json=body(seed, number, 100)).raise_for_status()
    client.put(f"{_BASE}/submaps/gone", json=body(seed, number, 101)).raise_for_status()
    client.delete(f"{_BASE}/submaps/gone").raise_for_status()
    if _found(client, seed, number, 100) != f"n{number}-0":
        wrong.append("what was replaced is not found as it is now")
    left = [_found(client, seed, number, turn) for turn in (0, 101)]
    wrong += [f"{name} is found where nothing is any more" for name in left if name is not None]
    if client.get(_BASE).json()["revision"] != revision + 11:
        wrong.append("the revision does not count the writes")
    return wrong


def _repeats(client: httpx.Client, clock: Path, seed: int) -> list[str]:
    """A POST sent again after the clock was set back, or a little ahead, is not done again."""
    wrong = []
    clock.write_text("0")
    first = _post(client, seed)
    for jump in (-_YEAR, -_HOUR, _HOUR, 23 * _HOUR):
        clock.write_text(str(jump))
        again = _post(client, seed)
        if again.json()["id"] != first.json()["id"] or "Idempotency-Replayed" not in again.headers:
            wrong.append(f"{jump / _HOUR:+.0f} hours later a POST is done again")
    clock.write_text(str(25 * _HOUR))  # which is longer than answers are kept
    late = _post(client, seed)
    if late.status_code not in (200, 201):
        wrong.append(f"25 hours later a POST is answered {late.status_code}")
    clock.write_text("0")
    return wrong


def _post(client: httpx.Client, seed: int) -> httpx.Response:
    return client.post(f"{_BASE}/submaps", json=body(seed, 7_777), headers={"Idempotency-Key": "once"})


def _found(client: httpx.Client, *seed: int) -> str | None:
    answer: dict[str, Any] = client.post(f"{_BASE}/queries", json=body(*seed)).json()
    return str(answer["candidates"][0]["submap_id"]) if answer["verdict"] == "matched" else None


def _pages(server: BenchmarkServer, problems: list[str], expected: int) -> None:
    """Listing page by page shows each once, in the order in which they came."""
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        ids: list[str] = []
        cursor: str | None = ""
        while cursor is not None:
            page = client.get(f"{_BASE}/submaps?limit=7" + (f"&cursor={cursor}" if cursor else "")).json()
            ids += [one["id"] for one in page["submaps"]]
            cursor = page.get("next")
    if len(ids) != expected or len(set(ids)) != expected:
        problems.append(f"{len(ids)} submaps are listed, {len(set(ids))} of them different, of {expected}")
    numbers = [int(name[1:].partition("-")[0]) for name in ids if name.startswith("n")]
    if any(b < a for a, b in itertools.pairwise(numbers)):
        problems.append("submaps are not listed in the order in which they came")
