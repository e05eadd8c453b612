"""What `make bench` relies on: its client, its history, and what counts as slower."""

from itertools import pairwise
from pathlib import Path

import pytest

from benchmarks.machine import ROOT
from benchmarks.service import history
from benchmarks.service.as_installed import Installed
from benchmarks.service.calibration import CalibrationLoop
from benchmarks.service.connection import HttpAnswer, address_of, request_bytes, take_answer
from benchmarks.service.history import LIMIT, Release, check, read, slower, write
from benchmarks.service.report import section
from benchmarks.service.start_costs import installed_sizes
from benchmarks.service.waterfall import STAGES, lines

ROWS = {
    "0.1.0": Release("AMD EPYC", {"library": 1.5, "query": 2.25, "PUT": 1.0, "empty": 0.125}),
    "0.2.0": Release("Intel(R) Xeon(R) Processor", {"library": 1.25, "query": 2.0}),
}
HEAD = {"against": "95bf473", "commit": "abc", "machine": {"processor": "a", "cores": 2, "python": "3.11"}}


def test_an_answer_is_taken_when_all_of_it_has_arrived() -> None:
    raw = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\nX-A: b\r\n\r\n{}"
    received = bytearray()
    for position in range(len(raw)):
        assert take_answer(received) is None
        received += raw[position : position + 1]
    received += b"HTTP/1.1 204 No Content\r\n\r\n"
    assert take_answer(received) == HttpAnswer(200, b"{}")
    assert take_answer(received) == HttpAnswer(204, b"")
    assert received == b""
    with pytest.raises(ValueError, match="without Content-Length"):
        take_answer(bytearray(b"HTTP/1.1 200 OK\r\n\r\n{}"))


def test_a_request_has_the_length_of_its_body() -> None:
    assert request_bytes("PUT", "/v1", b"{}").endswith(b"Content-Length: 2\r\n\r\n{}")
    assert b"Content-" not in request_bytes("GET", "/livez")
    assert address_of("http://127.0.0.1:80") == ("127.0.0.1", 80)
    with pytest.raises(ValueError, match="no host and port"):
        address_of("http://127.0.0.1")


def test_the_history_is_read_as_it_was_written() -> None:
    assert read(write(ROWS)) == ROWS
    assert read("") == {}


def test_another_kind_of_processor_is_not_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / history.PAGE).parent.mkdir()
    (tmp_path / history.PAGE).write_text(write({"0.3.0": Release("of another kind", {"query": 1e-9})}))
    monkeypatch.setattr(history, "ROOT", tmp_path)
    assert check() == 0
    assert "not compared with 0.3.0: that was measured on of another kind" in capsys.readouterr().out


def test_only_what_is_slower_each_time_is_slower() -> None:
    reference = {"query": 1.0, "PUT": 1.0}
    much = 1.5 * LIMIT
    noisy = iter([{"query": much, "PUT": much}, {"query": much, "PUT": 1.0}, {"query": 1.1 * LIMIT, "PUT": much}])
    assert slower(lambda: next(noisy), reference) == {"query": pytest.approx(1.1 * LIMIT)}
    quiet = iter([{"query": much, "PUT": 1.0}, {"query": 1.0, "PUT": much}])
    assert slower(lambda: next(quiet), reference) == {}
    assert slower(lambda: {"query": 1.0, "new": 9.0}, reference) == {}, "what has no reference is not judged"


def test_the_calibration_loop_takes_processor_time() -> None:
    assert CalibrationLoop().cpu_milliseconds() > 0.0


def test_stages_follow_each_other_and_the_page_shows_them() -> None:
    assert all(before.end == after.begin for before, after in pairwise(STAGES))
    stages = {stage.name: {"wall": 0.25, "cpu": 0.2} for stage in STAGES}
    figures = {"stages": stages, "whole": 2.25, "asked": 3, "submaps": 1000}
    assert len(lines(figures)) == len(STAGES)
    single = {"library": {"p50": 2.0}, "http": {"p50": 3.0}, "added": {"p50": 1.0, "cpu": 1.0}, "empty": {"p50": 0.5}}
    measured = HEAD | {"submaps": 1000, "trees": 90.0, "versions": {"95bf473": single, "now": single}}
    page = section({"single": measured, "waterfall": HEAD | figures})
    assert "| over HTTP: the same, p50, ms | 3.00 | 3.00 | 1.00 |  |  |" in page
    assert "| search | the library: describe, propose, verify, decide | 0.250 | 0.200 |" in page


def test_the_page_says_what_is_met_and_what_disturbed_it() -> None:
    started = {"version_seconds": 0.2, "start_seconds": 2.5, "idle": 200.0, "packages": {"numpy": 70.0, "scipy": 140.0}}
    kinds = {"PUT": {"first": 6.0, "later": 3.0, "ratio": 2.0}}
    figures = {
        "start": HEAD | {"others": 0.0, "versions": {"95bf473": {}, "now": started}},
        "first": HEAD | {"submaps": 10, "others": 0.5, "versions": {"now": {"kinds": kinds, "worst": 2.0}}},
    }
    page = section(figures)
    assert "| **later start, s** | - | 2.5 | - | at most 1.5 | **no** |" in page
    assert "| **`urquhart --version`, s** | - | 0.20 | - | at most 0.3 | yes |" in page
    assert "- later start, s: " in page
    assert "| PUT | 6.0 | 3.0 | 2.0 |" in page
    assert "| `scipy` |" in page
    assert "first 0.5)" in page
    assert "start 0.0" not in page


def test_the_packages_of_an_installation_are_those_that_the_project_needs() -> None:
    sizes = installed_sizes(ROOT / "pyproject.toml")
    assert {"numba", "llvmlite", "sqlalchemy"} <= sizes.keys()
    assert not {"pytest", "pyarrow", "gtsam"} & sizes.keys(), "extras are apart"
    assert all(size > 0.0 for size in sizes.values())


def test_a_start_is_measured_with_the_packages_of_an_installation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Installed, "names", frozenset({"numpy"}))
    assert all(Installed.find_spec(name) is not None for name in ("numpy", "json", "benchmarks"))
    assert Installed.find_spec("pytest") is None
    assert Installed.find_spec("no_such_module") is None
