"""The demo and `urquhart serve` as processes: they do what they say, and leave nothing running."""

import math
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.cli import run
from server.commands.demo.observations import DemoQuestion, DemoStand, ask, judge
from server.commands.demo.service import running_service
from server.commands.support.failure import CommandError
from server.stem_maps.reader import StemMap, read_stem_map
from tests.server.forked import Forked
from urquhart import SE2
from urquhart_client import Client, ConnectionFailed, ProblemError, QueryResult

ROOT = Path(__file__).parents[3]
PATIENCE = 120.0


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Child processes find the packages even where they are not installed."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "clients" / "python")]))


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts `urquhart` with arguments in a directory of its own, and ends it after the test."""
    started: list[subprocess.Popen[str]] = []

    def call(*arguments: object) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "server.cli", *(str(argument) for argument in arguments)]
        # A session of its own, as a terminal would give it: signals sent to it do not reach the tests.
        process = subprocess.Popen(
            command,
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            # A shell's background jobs hand on that SIGINT is ignored: a terminal's do not.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        started.append(process)
        return process

    yield call
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


def address_in(process: "subprocess.Popen[str]") -> str:
    """The address that the process prints, read line by line so that it goes on."""
    assert process.stdout is not None
    lines = []
    for line in process.stdout:
        lines.append(line)
        if found := re.search(r"http://127\.0\.0\.1:\d+", line):
            return found[0]
    pytest.fail("no address in: " + "".join(lines))


def wait_until_ready(url: str) -> None:
    deadline = time.monotonic() + PATIENCE
    with Client(url) as client:
        while True:
            try:
                client.ready()
                return
            except (ConnectionFailed, ProblemError):
                assert time.monotonic() < deadline
                time.sleep(0.05)


def wait_until_gone(url: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            with Client(url, timeout=5.0) as client:
                client.live()
        except ConnectionFailed:
            return
        assert time.monotonic() < deadline, f"{url} still answers"
        time.sleep(0.05)


# ------------------------------------------------------------------ serve


def test_workers_answer_and_do_not_outlive_the_process_that_started_them(start: Start) -> None:
    """How a service ends that is told to is tested with the demo's, and in `tests/server/http/test_drain.py`."""
    process = start("serve", "--port", 0, "--database", "a.db", "--workers", 2)
    url = address_in(process)
    wait_until_ready(url)
    with Client(url) as client:
        client.put_collection("plots")
        trees = np.random.default_rng(1).uniform(-30.0, 30.0, (60, 2))
        client.put_submap("plots", "p7", xy=trees)
        # Every worker answers from the same database, whichever of them took the write.
        for _ in range(8):
            with Client(url) as another:
                assert another.query("plots", trees).verdict == "matched"
    process.kill()
    process.wait(PATIENCE)
    wait_until_gone(url)


# ------------------------------------------------------------------- demo


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A folder with an eighth of each stem map."""
    folder = tmp_path / "small"
    folder.mkdir()
    for whole in (ROOT / "data" / "stem_maps").glob("*.csv"):
        head, *trees = whole.read_text().splitlines(keepends=True)
        x, y = np.array([[float(value) for value in tree.split(",")[1:3]] for tree in trees]).T
        near = np.flatnonzero((x < np.quantile(x, 0.35)) & (y < np.quantile(y, 0.35)))
        (folder / whole.name).write_text(head + "".join(trees[i] for i in near))
    return folder


def test_the_demo_recognises_draws_and_leaves_nothing_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("URQUHART_PORT", "not a port")  # the caller's settings do not reach the demo's service
    mine = tmp_path / "demo-output" / "mine.txt"
    mine.parent.mkdir()
    mine.write_text("kept")
    code = run(["demo", "--observations", "6", "--seed", "4"])
    out = capfd.readouterr().out
    assert code == 0, out
    assert "in the database: 6 of 6 matched and right" in out
    assert "unknown forest: 10 of 10 not matched, 0 false" in out
    for name in ("match.svg", "tessellation.svg"):
        assert f"drawn: demo-output/{name}" in out
        assert ElementTree.fromstring((tmp_path / "demo-output" / name).read_text()).tag.endswith("svg")
    assert mine.read_text() == "kept"
    found = re.search(r"http://127\.0\.0\.1:\d+", out)
    assert found is not None
    wait_until_gone(found[0])


def test_the_demo_keeps_its_service_when_asked(start: Start, small: Path) -> None:
    process = start("demo", "--data", small, "--observations", 2, "--keep")
    out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out
    kept = re.search(r"still serving on (\S+) ; stop it with: kill (\d+)", out)
    assert kept is not None
    try:
        wait_until_ready(kept[1])
        with Client(kept[1]) as client:
            assert [one.id for one in client.collections()] == ["forests"]
            page = re.search(r"in a browser: (\S+)/ui/collections/forests/queries/(\d+)", out)
            assert page is not None and page[1] == kept[1]
            assert client.explanation("forests", page[2]).verdict == "matched"
    finally:
        os.kill(int(kept[2]), signal.SIGTERM)
    wait_until_gone(kept[1])


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_demo_stops_its_service(tmp_path: Path, small: Path, number: signal.Signals, code: int) -> None:
    said = tmp_path / "said"
    arguments = ["demo", "--data", str(small), "--observations", "1000", "--keep"]
    process = Forked("urquhart", arguments, folder=tmp_path, environment=os.environ, output=said, errors=said)
    deadline = time.monotonic() + PATIENCE
    while (found := re.search(r"http://127\.0\.0\.1:\d+", said.read_text())) is None:
        assert process.poll() is None and time.monotonic() < deadline, said.read_text()
        time.sleep(0.05)
    process.send_signal(number)
    assert process.wait(PATIENCE) == code
    assert "Traceback" not in said.read_text()
    wait_until_gone(found[0])


def test_the_demo_without_its_data_says_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["demo", "--data", "nowhere"]) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert "give their directory with --data" in err
    (tmp_path / "partly").mkdir()
    assert run(["demo", "--data", "partly"]) == 2
    assert "partly/lansing.csv: no such file" in capfd.readouterr().err
    assert not (tmp_path / "demo-output").exists()


def test_wrong_answers_fail_the_demo(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The stand that should be unknown is one that is stored: every one of its matches is false."""
    data = tmp_path / "data"
    data.mkdir()
    source = ROOT / "data" / "stem_maps"
    for name, contents in (("lansing", "lansing"), ("bei", "longleaf"), ("longleaf", "longleaf")):
        (data / f"{name}.csv").write_bytes((source / f"{contents}.csv").read_bytes())
    assert run(["demo", "--data", str(data), "--out", str(tmp_path / "out"), "--observations", "2"]) == 1
    assert "10 false" in capfd.readouterr().out


def test_a_service_that_does_not_start_is_told_with_its_reason(tmp_path: Path) -> None:
    database = tmp_path / "notes.db"
    database.write_text("not a database" * 100)
    with (
        pytest.raises(CommandError, match=r"the service did not start: .*not a SQLite database"),
        running_service(database, tmp_path / "server.log", keep=False),
    ):
        pytest.fail("it must not be reached")


# -------------------------------------------------------------- questions

STAND = DemoStand("stand", sensor_range=20.0, radius=20.0, spacing=10.0)
UNKNOWN = DemoStand("unknown", sensor_range=20.0)


def result(verdict: str, frame: str = "stand", x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> QueryResult:
    candidate: dict[str, Any] = {
        "rank": 1, "submap_id": "s", "transform": {"x": 0, "y": 0, "yaw": 0},
        "map_pose": {"frame_id": frame, "x": x, "y": y, "yaw": yaw},
        "inlier_count": 9, "inlier_ratio": 1, "rms": 0, "overlap_ratio": 1, "support": 1, "log_odds": 9,
        "confidence": 1,
    }  # fmt: skip
    return QueryResult.model_validate(
        {
            "collection": "c",
            "verdict": verdict,
            "reason": "r",
            "method": "robust",
            "revision": 1,
            "candidates": [candidate],
        }
    )


@pytest.mark.parametrize(
    ("stand", "answered", "right", "wrong"),
    [
        (STAND, result("matched", x=10.5, y=20.5, yaw=0.04 - 2 * math.pi), True, False),
        (STAND, result("matched", x=11.5, y=20.0), False, True),
        (STAND, result("matched", x=10.0, y=20.0, yaw=0.06), False, True),
        (STAND, result("matched", frame="other", x=10.0, y=20.0), False, True),
        (STAND, result("ambiguous", x=10.0, y=20.0), False, False),
        (STAND, result("no_match"), False, False),
        (UNKNOWN, result("matched", frame="unknown", x=10.0, y=20.0), False, True),
        (UNKNOWN, result("ambiguous"), True, False),
        (UNKNOWN, result("no_match"), True, False),
    ],
)
def test_answers_are_judged_by_the_true_pose(stand: DemoStand, answered: QueryResult, right: bool, wrong: bool) -> None:
    question = DemoQuestion(stand, np.zeros((3, 2)), SE2(10.0, 20.0, 0.0))
    answer = judge(question, answered, 1.0)
    assert (answer.right, answer.wrong) == (right, wrong)


def test_questions_are_asked_where_there_are_trees_and_by_seed() -> None:
    stem_map = read_stem_map(ROOT / "data" / "stem_maps" / "longleaf.csv")
    stand = DemoStand("longleaf", sensor_range=25.0)
    question = ask(stand, stem_map, np.random.default_rng(3))
    again = ask(stand, stem_map, np.random.default_rng(3))
    np.testing.assert_array_equal(question.xy, again.xy)
    assert len(question.xy) >= 0.7 * stand.minimum_trees
    placed = question.pose.apply(question.xy)
    nearest = np.array([np.hypot(*(stem_map.xy - tree).T).min() for tree in placed])
    assert 0.0 < nearest.max() < 1.0  # at most 0.2 m of noise on each coordinate
    bare = StemMap("bare", ("1",), np.zeros((1, 2)))
    with pytest.raises(RuntimeError, match="no place with 25 trees"):
        ask(stand, bare, np.random.default_rng(3))
