"""The proofs themselves: each finds what it looks for where it is there, and the page says what the figures say."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import schemathesis

from benchmarks import record
from benchmarks.reliability import contract, fuzz_readers
from benchmarks.reliability.__main__ import FULL, PAGE, PARTS, path_of, write_page
from benchmarks.reliability.exhaustion.attacks import ATTACKS
from benchmarks.reliability.fuzz_inputs import changed, damaged
from benchmarks.reliability.fuzz_targets import READERS, Reader
from benchmarks.reliability.hostile import TRIALS, clock, names, slow
from benchmarks.reliability.hostile.jobs import ndjson
from benchmarks.reliability.report import GROWTH, SECTIONS, faults, write_report
from benchmarks.reliability.shape_costs_report import MOST
from benchmarks.reliability.traffic import Told
from benchmarks.reliability.trees import body, forest
from benchmarks.reliability.worst_shapes import SHAPES
from benchmarks.server_process import served

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", sorted(READERS))
def test_only_errors_of_the_domain_come_out_of_the_readers(name: str) -> None:
    tally = fuzz_readers.feed(name, 800, seed=5)
    assert tally.findings == {}
    assert tally.inputs == 800
    assert tally.accepted > 4
    assert sum(tally.refused.values()) == tally.inputs - tally.accepted


def test_a_reader_that_breaks_or_hangs_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(given: int) -> str | None:
        if given == 7:
            raise ZeroDivisionError("seven")
        while given == 8:
            pass
        return "Refused" if given % 2 else None

    @contextmanager
    def broken(folder: Path) -> Iterator[Reader]:
        yield Reader(lambda rng: rng.randrange(9), read)

    monkeypatch.setitem(READERS, "broken", broken)
    monkeypatch.setattr(fuzz_readers, "PATIENCE", 0.05)
    tally = fuzz_readers.feed("broken", 40, seed=1)
    assert {what.split()[0] for what in tally.findings} == {"ZeroDivisionError", "TimeoutError"}
    assert set(tally.findings.values()) == {"7", "8"}
    assert tally.slowest[0] > 0.04


def test_damage_is_the_same_from_the_same_seed_and_mostly_damage() -> None:
    good = b'{"id": "p1", "xy": [[1.5, 2.5], [3, 4]]}'
    made = [damaged(random.Random(seed), good, b"[1, 2, 3]") for seed in range(200)]
    assert made == [damaged(random.Random(seed), good, b"[1, 2, 3]") for seed in range(200)]
    assert len(set(made)) > 150
    values = [changed(random.Random(seed), {"a": [1, 2], "b": "c"}) for seed in range(200)]
    assert sum(value != {"a": [1, 2], "b": "c"} for value in values) > 180


def test_an_answer_that_the_document_does_not_tell_of_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The document is changed, the server is not: what it is then not told of must be named."""

    def doctored(url: str) -> Any:
        document = httpx.get(f"{url}/openapi.json").json()
        paths = document["paths"]
        limits = paths["/v1/limits"]["get"]["responses"]["200"]["content"]["application/json"]
        limits["schema"] = {"type": "object", "required": ["colour"]}
        del paths["/livez"]["get"]["responses"]["200"]
        paths["/livez"]["get"]["responses"]["204"] = {"description": "Nothing."}
        document["paths"] = {path: paths[path] for path in ("/v1/limits", "/livez", "/readyz")}
        schema = schemathesis.openapi.from_dict(document)
        schema.config.update(base_url=url)
        return schema

    monkeypatch.setattr(contract, "schema_of", doctored)
    with served(tmp_path / "contract.db", tmp_path / "log") as server:
        seen = contract.examine(server.url, rounds=1, each=2, seed=0)
    assert sorted(where.partition(":")[0] for where in seen.failures) == ["getLimits", "getLiveness"]


def test_forests_are_apart_and_differ() -> None:
    one, other = forest(1, 2), forest(1, 3)
    assert one.shape == (60, 2)
    gaps = ((one[:, None] - one[None]) ** 2).sum(axis=2) ** 0.5
    assert sorted(gaps[gaps > 0.0])[0] > 2.0
    assert (one != other).any()
    assert body(4, session="s")["xy"] == forest(4).round(3).tolist()


def test_an_import_has_lines_that_are_refused() -> None:
    lines = ndjson(0, 1, 100).splitlines()
    assert [number for number, line in enumerate(lines, start=1) if b'"xy"' not in line] == [50, 100]


@pytest.mark.parametrize("trial", [slow.run, names.run, clock.run])
def test_some_hostile_trials(trial: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    assert trial(quick=True, seed=3)["problems"] == []


def test_modules_that_look_at_the_clock_are_found(tmp_path: Path) -> None:
    (tmp_path / "looks.py").write_text("import time\nprint(time.time())\n")
    (tmp_path / "waits.py").write_text("import time\nprint(time.monotonic())\n")
    assert clock.looks(tmp_path) == {"looks.py"}
    looking = {"platform/ids.py", "resources/idempotency.py", "store/repositories/submaps.py"}
    assert looking <= clock.looks(ROOT / "server")


def test_the_published_page_is_the_one_of_the_published_figures(tmp_path: Path) -> None:
    for name in PARTS:
        figures = record.read(path_of(ROOT / FULL, name))
        record.write(path_of(tmp_path, name), figures)
    assert write_page(tmp_path).read_text() == (ROOT / FULL / PAGE).read_text()


def test_the_published_figures_hold_what_is_claimed() -> None:
    figures = {name: record.read(path_of(ROOT / FULL, name)) for name in PARTS}
    assert set(figures) == set(SECTIONS)
    assert all("--quick" not in one["command"] for one in figures.values())
    assert figures["contract"]["cases"] >= 5_000
    assert figures["contract"]["failures"] == []
    assert figures["readers"]["inputs"] >= 1_000_000
    assert all(one["findings"] == [] for one in figures["readers"]["readers"].values())
    assert all(one["growth_megabytes"] < GROWTH for one in figures["readers"]["readers"].values())
    load = figures["load"]
    assert load["submaps"] == 10_000
    assert load["normal"]["seconds"] >= 300.0
    assert load["lost"] == []
    assert load["normal"]["wrong"] + load["overload"]["wrong"] == 0
    assert load["normal"]["errors"] == {}
    for kind in figures["fleet"]["kinds"].values():
        assert (kind["wrong"], kind["twice"]) == (0, 0)
        assert kind["named"] >= 0.98 * kind["been"]
    assert figures["fleet"]["sessions"] == 5
    season = figures["season"]
    assert (season["state"], season["results"], season["lines"]) == ("successful", 100_000, 100_000)
    alone, together = figures["meetings"]["alone"], figures["meetings"]["together"]
    assert sum(one["found"] + len(one["missed"]) for one in alone.values()) == 1_000
    # A handful of trees fit onto themselves in more than one way, and the answer says so.
    assert all(missed["landmarks"] < 8 for one in alone.values() for missed in one["missed"])
    assert all(one["most_metres"] < 0.05 for one in alone.values())
    assert (together["pairs"], together["untold"]) == (1_000, [])
    assert set(figures["hostile"]["trials"]) == set(TRIALS)
    attacks = figures["exhaustion"]["attacks"]
    assert set(attacks) == set(ATTACKS)
    assert all(one["megabytes"] < 500.0 and one["robot_errors"] == {} for one in attacks.values())
    assert set(figures["shapes"]["shapes"]) == set(SHAPES)
    for costs in figures["shapes"]["shapes"].values():
        assert [cost["landmarks"] for cost in costs] == [100, 1_000, 5_000, 20_000]
        assert max(cost["megabytes"] for cost in costs) < MOST


def test_what_falls_short_is_said() -> None:
    figures: dict[str, Any] = {name: record.read(path_of(ROOT / FULL, name)) for name in PARTS}
    told = Told(milliseconds={"query": [1.0]}, matched=3, wrong=2, seconds=1.0)
    told.errors["query: 500 "] += 4
    figures["load"] |= {"normal": told.figures(), "lost": ["w1: 404, other trees"], "recovery_seconds": None}
    figures["contract"] |= {"failures": [{"where": "getSubmap: 500", "what": "a request"}]}
    figures["readers"]["readers"]["lines"]["findings"] = [{"what": "KeyError in read", "input": "x"}]
    figures["readers"]["readers"]["bodies"]["growth_megabytes"] = 264.0
    figures["fleet"]["kinds"]["inside-20"]["wrong"] = 3
    figures["season"] |= {"results": 99_999}
    figures["shapes"]["shapes"]["fan"][-1] |= {"silence": 1.25, "megabytes": 900.0}
    figures["hostile"]["trials"]["kills"]["problems"] = ["round 1: s5 was acknowledged and is gone"]
    found = faults(figures)
    for part in (
        "getSubmap: 500",
        "KeyError in read",
        "bodies: 264 MB",
        "20,000 landmarks, fan: 1.25 s of computing without asking",
        "20,000 landmarks, fan: 900 MB",
        "4 x query: 500",
        "2 wrong matches",
        "w1: 404",
        "s5 was",
        "3 wrong visits",
        "99999 lines of result",
    ):
        assert any(part in line for line in found), part
        assert part in " ".join(write_report(figures).split())
    assert (
        "Not run yet: contract, readers, load, fleet, season, meetings, hostile, shapes, exhaustion."
        in write_report({})
    )
