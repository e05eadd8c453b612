"""A line of an import that ends the process that describes it, or never ends: it is refused, and no other line."""

import dataclasses
import threading
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app import create_app
from server.config.settings import Limits, Settings
from server.config.settings_groups import JobSettings
from server.errors import WorkerLost
from server.jobs.running_job import RunningJob
from server.platform.isolated_process import IsolatedProcess
from server.platform.process_pool import ProcessPool
from server.submaps import described_batches
from tests.server.factories import TestClient
from tests.server.jobs.poisoning import poisoned
from tests.server.jobs.test_jobs import finished, line, results, upload
from tests.server.platform import job_helpers
from urquhart import Budget

pytestmark = pytest.mark.usefixtures("forked_workers")

GIVEN = [[1, 2, 3], [4, 13, 6], [7, 8, 9], [10, 17, 12], [14, 19, 15], [16]]
FOUND = [-number if number in (13, 17, 19) else number for number in chain(*GIVEN)]


@pytest.mark.parametrize("processes", [1, 3])
@pytest.mark.parametrize("begun", [False, True])
def test_what_is_too_much_is_refused_alone_and_in_its_place(processes: int, begun: bool) -> None:
    with ProcessPool(processes, warm_up=job_helpers.load, patience=0.0) as workers:
        if begun and processes > 1:
            job_helpers.start(workers)
        assert list(chain(*workers.map(job_helpers.HOSTILE, GIVEN))) == FOUND
        assert list(chain(*workers.map(job_helpers.HOSTILE, [[1], [2]]))) == [1, 2], "the pool is as good as before"


def test_a_process_that_cannot_begin_is_not_the_fault_of_its_task() -> None:
    isolated = IsolatedProcess(job_helpers.fail_to_load)
    with pytest.raises(WorkerLost, match="exit code 7"):
        isolated.attempt(job_helpers.hostile, [1], 60.0)


@pytest.fixture
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[httpx.Client]:
    """A service whose processes meet what they cannot survive; every line is described in one of them."""
    real = described_batches.of_lines

    def of_lines(*arguments: Any, **named: Any) -> Any:
        return dataclasses.replace(real(*arguments, **(named | {"careful": True})), there=poisoned)

    monkeypatch.setattr(described_batches, "of_lines", of_lines)
    settings = Settings(
        database=str(tmp_path / "a.db"), limits=Limits(import_line_seconds=2.0), jobs=JobSettings(processes=2)
    )
    with TestClient(create_app(settings)) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


@pytest.mark.parametrize("name", ["poison", "endless"])
def test_one_line_does_not_end_an_import(client: httpx.Client, name: str) -> None:
    sent = [line(f"a{i}", i) for i in range(4)] + [line(name, 5)] + [line(f"b{i}", i) for i in range(4)]
    job = finished(client, upload(client, sent))
    assert (job["state"], job["counts"]) == ("successful", {"created": 8, "refused": 1})
    told = results(client, job)
    assert [one["line"] for one in told] == list(range(1, 10))
    (refused,) = results(client, job, "errors")
    assert (refused["line"], refused["id"]) == (5, name)
    assert refused["problem"]["type"] == "/problems/too-costly"
    assert refused["problem"]["limit"] == "import_line_seconds"


def test_all_or_nothing_names_the_line(client: httpx.Client) -> None:
    job = finished(client, upload(client, [line("a", 1), line("poison", 2)], mode="all"))
    assert (job["state"], job["counts"]) == ("failed", {"refused": 1, "skipped": 1})
    (refused,) = results(client, job, "errors")
    assert (refused["line"], refused["problem"]["type"]) == (2, "/problems/too-costly")


def test_lines_with_many_trees_are_not_described_in_the_service() -> None:
    few, many = b'{"xy": [%s]}' % b",".join([b"[0,0]"] * 500), b'{"xy": [%s]}' % b",".join([b"[0,0]"] * 20_000)
    assert described_batches._is_light(few)
    assert not described_batches._is_light(many)


def test_a_job_whose_process_ended_is_resumed_with_care(tmp_path: Path) -> None:
    """Such a job may have been ended by a line; whoever resumes it describes nothing in the service."""
    app = create_app(Settings(database=str(tmp_path / "a.db")))
    with TestClient(app) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        job = finished(client, upload(client, [line("a", 1)]))
        database = app.state.service.database
        with database.read() as tx:
            row = tx.jobs.get(job["id"])
            assert row is not None
            suspicion = []
            for starts in (1, 2, 3):
                begun = dataclasses.replace(row, progress={**row.progress, "starts": starts})
                suspicion.append(RunningJob(begun, database, threading.Event(), 1.0, Budget()).is_suspect)
    assert suspicion == [False, False, True]
