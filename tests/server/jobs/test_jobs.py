"""Imports and other jobs over HTTP: every line has its result, whatever it holds and whatever happens."""

import gzip
import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.config.settings import Limits, Settings
from server.config.settings_groups import IndexSettings
from server.errors import StorageBusy, StorageFull, WorkerLost
from server.index.flushing import count_uncovered
from server.jobs import queue, runner, running_job
from server.jobs.folder import JobFolder
from server.jobs.running_job import RunningJob
from server.jobs.types import import_submaps
from server.platform.file_locks import try_lock
from server.schemas.jobs import LineResult
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import UNRESTRICTED, Scope
from server.service_parts import Service
from server.store.repositories.jobs import JobReader
from server.store.service_records import Queue
from server.store.sqlite.sqlite_errors import storage_errors
from server.submaps import bulk_ingest
from tests.server.factories import TestClient, forest, points, put_submap

IMPORTS = "/v1/collections/plots/imports"
NDJSON = {"Content-Type": "application/x-ndjson"}


pytestmark = pytest.mark.usefixtures("forked_workers")


def line(name: str, seed: int, **fields: Any) -> bytes:
    return orjson.dumps({"id": name, "xy": points(forest(seed)), **fields})


def upload(
    client: httpx.Client, lines: Iterable[bytes], headers: dict[str, str] | None = None, **parameters: str
) -> httpx.Response:
    content = b"".join(one + b"\n" for one in lines)
    return client.post(IMPORTS, content=content, headers=NDJSON | (headers or {}), params=parameters)


def finished(client: httpx.Client, accepted: httpx.Response) -> dict[str, Any]:
    """The job, once it is at its end."""
    assert accepted.status_code == 202, accepted.text
    for _ in range(60):
        job: dict[str, Any] = client.get(accepted.headers["Location"], params={"wait": "5"}).json()
        if job["finished"] is not None:
            return job
    raise AssertionError(job)


def results(client: httpx.Client, job: dict[str, Any], what: str = "results") -> list[dict[str, Any]]:
    response = client.get(job["links"][what])
    assert response.status_code == 200, response.text
    assert response.headers["Content-Type"] == "application/x-ndjson"
    told = [orjson.loads(one) for one in response.content.splitlines()]
    for one in told:
        LineResult.model_validate(one)  # what the OpenAPI document says of a line
    return told


def outcomes(client: httpx.Client, job: dict[str, Any]) -> list[tuple[int, str | None, str]]:
    return [(one["line"], one.get("id"), one["outcome"]) for one in results(client, job)]


def count(client: httpx.Client) -> int:
    counts: dict[str, int] = client.get("/v1/collections/plots").json()["counts"]
    return counts["submaps"]


# ------------------------------------------------------------------ imports


@pytest.mark.parametrize("mode", ["continue", "all"])
def test_the_index_is_written_when_an_import_is_over(settings: Settings, mode: str) -> None:
    """The first who asks in what was imported does not have to write it first."""
    index = IndexSettings(flush_submaps=20, memory_submaps=30, maintenance_seconds=3600)
    with TestClient(create_app(settings.model_copy(update={"index": index}))) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        service: Service = client.app.state.service  # type: ignore[attr-defined]
        job = finished(client, upload(client, [line(f"p{number}", number) for number in range(60)], mode=mode))
        assert job["counts"] == {"created": 60}
        assert count_uncovered(service.database, "plots", 1000) <= 20
        # A few more are left for later.
        job = finished(client, upload(client, [line(f"q{number}", 100 + number) for number in range(15)], mode=mode))
        assert count_uncovered(service.database, "plots", 1000) == 15


def test_an_index_that_cannot_be_written_is_no_failure(
    settings: Settings, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*arguments: object, **named: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(import_submaps, "flush", full)
    with TestClient(create_app(settings)) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        job = finished(client, upload(client, [line("p", 1)]))
    assert (job["state"], job["counts"]) == ("successful", {"created": 1})
    assert "the index is not written yet" in caplog.text


def test_a_line_is_told_what_a_put_would_be_told(client: httpx.Client) -> None:
    wrong: dict[str, Any] = {"xy": [[0, 0], [1, 1], [2, "5"]], "sesion": "x", "stamp": "yesterday"}
    job = finished(client, upload(client, [orjson.dumps({"id": "p", **wrong})]))
    (told,) = results(client, job, "errors")
    assert told["id"] == "p"
    direct = client.put("/v1/collections/plots/submaps/p", json=wrong).json()
    del direct["request_id"]
    assert len(direct["errors"]) == 3
    assert told["problem"] == direct


def test_every_line_has_its_result(client: httpx.Client) -> None:
    put_submap(client, "plots", "there", 1).raise_for_status()
    put_submap(client, "plots", "other", 2).raise_for_status()
    lines = [
        line("new", 3),
        line("there", 1),
        b"",
        b"{",
        b"[]",
        line("other", 4),
        orjson.dumps({"id": "flat", "xy": [[0, 0], [1, 1], [2, 2]]}),
        orjson.dumps({"xy": [[0, 0], [1, 1], [2, 5]]}),
        line("a/b", 5),
        line("same", 6),
        line("same", 7),
    ]
    job = finished(client, upload(client, lines))
    assert job["state"] == "successful"
    assert outcomes(client, job) == [
        (1, "new", "created"),
        (2, "there", "unchanged"),
        (4, None, "refused"),
        (5, None, "refused"),
        (6, "other", "replaced"),
        (7, "flat", "refused"),
        (8, None, "refused"),
        (9, "a/b", "refused"),
        (10, "same", "created"),
        (11, "same", "replaced"),
    ]
    assert (job["total"], job["done"]) == (11, 11)
    assert job["counts"] == {"created": 2, "refused": 5, "replaced": 2, "unchanged": 1}
    errors = results(client, job, "errors")
    assert [one["line"] for one in errors] == [4, 5, 7, 8, 9]
    problem = errors[2]["problem"]
    direct = client.put("/v1/collections/plots/submaps/flat", json=orjson.loads(lines[6]) | {}).json()
    assert problem["type"] == "/problems/invalid-landmarks"
    assert direct["status"] == 422
    assert problem["errors"][0]["pointer"] == "/xy"
    assert errors[1]["problem"]["type"] == "/problems/invalid-request"
    answer = client.post("/v1/collections/plots/queries", json={"xy": points(forest(7))}).json()
    assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", "same")


@pytest.mark.parametrize(
    ("on_conflict", "expected"),
    [
        ("replace", ["replaced", "unchanged", "created", "replaced"]),
        ("skip", ["skipped", "unchanged", "created", "skipped"]),
        ("fail", ["refused", "unchanged", "created", "refused"]),
    ],
)
def test_what_is_taken(client: httpx.Client, on_conflict: str, expected: list[str]) -> None:
    put_submap(client, "plots", "a", 1).raise_for_status()
    put_submap(client, "plots", "b", 2).raise_for_status()
    lines = [line("a", 3), line("b", 2), line("c", 4), line("c", 5)]
    job = finished(client, upload(client, lines, on_conflict=on_conflict))
    assert [outcome for _, _, outcome in outcomes(client, job)] == expected
    assert job["state"] == "successful"
    stored = client.get("/v1/collections/plots/submaps/c").json()["landmarks"][0]
    kept = forest(5 if on_conflict == "replace" else 4)[0]
    assert (stored["x"], stored["y"]) == (kept[0], kept[1])
    for one in results(client, job):
        if one["outcome"] == "refused":
            assert one["problem"]["type"] == "/problems/conflict"


def test_all_or_nothing(client: httpx.Client) -> None:
    revision = client.get("/v1/collections/plots").json()["revision"]
    job = finished(client, upload(client, [line("a", 1), b"{", line("b", 2)], mode="all"))
    assert (job["state"], job["problem"]["type"]) == ("failed", "/problems/lines-refused")
    assert outcomes(client, job) == [(1, "a", "skipped"), (2, None, "refused"), (3, "b", "skipped")]
    assert job["counts"] == {"refused": 1, "skipped": 2}
    assert client.get("/v1/collections/plots").json()["revision"] == revision
    job = finished(client, upload(client, [line("a", 1), line("b", 2), line("a", 3)], mode="all"))
    assert job["state"] == "successful"
    assert outcomes(client, job) == [(1, "a", "created"), (2, "b", "created"), (3, "a", "replaced")]
    job = finished(client, upload(client, [line("c", 1), line("b", 9)], mode="all", on_conflict="fail"))
    assert job["state"] == "failed"
    assert outcomes(client, job) == [(1, "c", "skipped"), (2, "b", "refused")]
    assert count(client) == 2


def test_an_empty_upload_is_done_at_once(client: httpx.Client) -> None:
    for content in (b"", b"\n\n"):
        job = finished(client, client.post(IMPORTS, content=content, headers=NDJSON))
        assert (job["state"], job["counts"]) == ("successful", {})
        assert results(client, job) == []


def test_packed_uploads(client: httpx.Client) -> None:
    content = line("a", 1) + b"\r\n" + line("b", 2)
    packed = gzip.compress(content)
    headers = NDJSON | {"Content-Encoding": "gzip"}
    job = finished(client, client.post(IMPORTS, content=packed, headers=headers))
    assert outcomes(client, job) == [(1, "a", "created"), (2, "b", "created")]
    assert job["total"] == 2
    for broken, where in ((packed[:-9], "in line 2;"), (b"not gzip", "not gzip"), (packed + b"junk", "not gzip")):
        response = client.post(IMPORTS, content=broken, headers=headers)
        assert (response.status_code, response.json()["type"]) == (400, "/problems/malformed-json")
        assert where in response.json()["detail"]
    assert client.post(IMPORTS, content=packed, headers=NDJSON | {"Content-Encoding": "br"}).status_code == 415
    assert client.post(IMPORTS, content=content, headers={"Content-Type": "text/csv"}).status_code == 415
    assert client.post(IMPORTS, content=content, headers=NDJSON, params={"on_conflict": "x"}).status_code == 422
    assert len(client.get("/v1/jobs").json()["jobs"]) == 1


@pytest.fixture
def small(settings: Settings) -> Iterator[httpx.Client]:
    """A service of small limits."""
    limits = Limits(
        body_bytes=20_000, import_bytes=100_000, import_lines=50_000, import_all_lines=3, import_all_bytes=3000
    )
    with TestClient(create_app(settings.model_copy(update={"limits": limits}))) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


def left(client: httpx.Client, settings: Settings) -> list[str]:
    folder = Path(f"{settings.database_path}.jobs")
    return sorted(path.name for path in folder.iterdir() if path.suffix != ".lock") if folder.exists() else []


def test_limits_of_uploads(small: httpx.Client, settings: Settings) -> None:
    bomb = gzip.compress(b" " * 300_000_000)
    assert len(bomb) < 300_000
    for content, headers in ((bomb, {"Content-Encoding": "gzip"}), (b" " * 100_001, {})):
        response = small.post(IMPORTS, content=content, headers=NDJSON | headers)
        assert (response.status_code, response.json()["limit"]) == (413, "import_bytes")
    response = small.post(IMPORTS, content=b"\n" * 50_001, headers=NDJSON)
    assert (response.status_code, response.json()["limit"]) == (413, "import_lines")
    assert "Blank lines count" in response.json()["detail"]
    assert left(small, settings) == []
    wide = b'{"id": "wide", "properties": {"x": "' + b"y" * 20_000 + b'"}}'
    job = finished(small, upload(small, [line("a", 1), wide, line("b", 2)]))
    assert outcomes(small, job) == [(1, "a", "created"), (2, None, "refused"), (3, "b", "created")]
    assert results(small, job, "errors")[0]["problem"]["limit"] == "body_bytes"
    job = finished(small, upload(small, [line(name, 1) for name in "cdef"], mode="all"))
    assert (job["state"], job["problem"]["limit"]) == ("failed", "import_all_lines")
    job = finished(small, upload(small, [line(name, 1) for name in "cd"], mode="all"))
    assert (job["state"], job["problem"]["limit"]) == ("failed", "import_all_bytes")
    assert count(small) == 2
    assert small.get("/v1/limits").json()["limits"]["import_bytes"] == 100_000


def test_an_upload_that_says_it_is_too_large_is_not_read(small: httpx.Client) -> None:
    read: list[bytes] = []

    def pieces() -> Iterator[bytes]:
        for _ in range(11):
            read.append(b" " * 10_000)
            yield read[-1]

    headers = NDJSON | {"Content-Length": "110000"}
    response = small.post(IMPORTS, content=pieces(), headers=headers)
    assert (response.status_code, response.json()["got"]) == (413, 110_000)


def test_blank_lines_have_no_result_and_are_counted(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also at the end, and where what was written before has to be cut off."""
    monkeypatch.setattr(bulk_ingest, "describe_lines", _small_batches(bulk_ingest.describe_lines))
    real, stopped = RunningJob.report, list[int]()

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        if self.done == 6 and not stopped:
            stopped.append(1)
            with service_folder(client).results(self.id).open("ab") as file:
                file.write(b"never committed\n" * 100)
            raise running_job.Interrupted
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)
    job = finished(client, upload(client, [b"", b" ", b"\t", b"", line("a", 1), b"{", b"", b""]))
    assert stopped
    assert (job["state"], job["done"], job["total"]) == ("successful", 8, 8)
    assert outcomes(client, job) == [(5, "a", "created"), (6, None, "refused")]


@pytest.mark.parametrize("mode", ["continue", "all"])
@pytest.mark.parametrize("blank", [b"\n", b" \t \r\n"])
def test_blank_lines_cost_next_to_nothing(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, mode: str, blank: bytes
) -> None:
    """They are skipped together, and there is no transaction for them."""
    monkeypatch.setattr(import_submaps, "_check_size", lambda *_: None)  # all of them at once, too
    real, reported = RunningJob.report, list[int]()

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        reported.append(self.done)
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)
    run = blank * 100_000
    content = run + line("a", 1) + b"\n" + run + b"\n" + line("b", 2) + b"\n" + run + b"  "
    job = finished(client, client.post(IMPORTS, content=content, headers=NDJSON, params={"mode": mode}))
    assert (job["state"], job["done"], job["total"]) == ("successful", 300_004, 300_004)
    assert outcomes(client, job) == [(100_001, "a", "created"), (200_003, "b", "created")]
    assert len(reported) < 10


def test_a_line_that_begins_blank_and_is_too_long_is_refused(small: httpx.Client) -> None:
    """Only its beginning is read: what it holds is not known, so it is not passed over."""
    job = finished(small, upload(small, [b" " * 25_000 + line("a", 1), line("b", 2)]))
    assert outcomes(small, job) == [(1, None, "refused"), (2, "b", "created")]


def service_folder(client: httpx.Client) -> JobFolder:
    """Of the service in this process."""
    parts: Service = client.app.state.service  # type: ignore[attr-defined]
    return parts.jobs.folder


def test_outcomes_do_not_depend_on_batches(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = [line("a", 1), line("a", 1), line("a", 2), line("b", 3), line("a", 1), line("b", 3)]
    expected = {
        "replace": ["created", "unchanged", "replaced", "created", "replaced", "unchanged"],
        "skip": ["created", "unchanged", "skipped", "created", "unchanged", "unchanged"],
        "fail": ["created", "unchanged", "refused", "created", "unchanged", "unchanged"],
    }
    describe = bulk_ingest.describe_lines
    for size in (1, 2, 3, 6):
        monkeypatch.setattr(bulk_ingest, "describe_lines", _small_batches(describe, size))
        for on_conflict, outcome in expected.items():
            client.delete("/v1/collections/plots").raise_for_status()
            client.put("/v1/collections/plots", json={}).raise_for_status()
            job = finished(client, upload(client, lines, on_conflict=on_conflict))
            assert [one for _, _, one in outcomes(client, job)] == outcome, (size, on_conflict)
            revision = client.get("/v1/collections/plots").json()["revision"]
            assert all(one["revision"] <= revision for one in results(client, job) if "revision" in one)
            stored = client.get("/v1/collections/plots/submaps/a").json()["landmarks"][0]
            assert (stored["x"], stored["y"]) == tuple(forest(1)[0])
            assert count(client) == 2


def test_an_upload_sent_again_is_done_once(client: httpx.Client, settings: Settings) -> None:
    headers = {"Idempotency-Key": "season"}
    first = upload(client, [line("a", 1)], headers)
    finished(client, first)
    again = upload(client, [line("a", 1)], headers)
    assert again.headers["Location"] == first.headers["Location"]
    assert again.headers["Idempotency-Replayed"] == "true"
    assert upload(client, [line("a", 2)], headers).status_code == 422
    assert upload(client, [line("a", 1)], headers, mode="all").status_code == 422
    assert len(client.get("/v1/jobs").json()["jobs"]) == 1
    assert len(left(client, settings)) == 1  # the results


def test_a_full_disk_takes_nothing_on(
    client: httpx.Client, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("server.jobs.upload.os.fsync", full)
        response = upload(client, [line("a", 1)])
    assert (response.status_code, response.json()["type"]) == (507, "/problems/storage-full")
    assert left(client, settings) == []
    assert client.get("/v1/jobs").json()["jobs"] == []
    with monkeypatch.context() as patched:
        patched.setattr(import_submaps, "_write_results", full)
        job = finished(client, upload(client, [line("a", 1)]))
    assert (job["state"], job["problem"]["status"]) == ("failed", 507)
    assert count(client) == 0
    assert left(client, settings) == [f"{job['id']}.results"]  # what was sent makes room
    with pytest.raises(StorageFull), storage_errors(settings.database_path):
        full()


def test_a_service_that_only_reads_takes_nothing_on(settings: Settings) -> None:
    with TestClient(create_app(settings)) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        made = finished(client, upload(client, [line("a", 1)]))
    reading = settings.model_copy(update={"database": f"sqlite:///{settings.database_path}?mode=ro"})
    with TestClient(create_app(reading)) as client:
        for response in (upload(client, [line("b", 2)]), client.post("/v1/collections/plots/reindex")):
            assert (response.status_code, response.json()["type"]) == (503, "/problems/storage-read-only")
        assert outcomes(client, made) == [(1, "a", "created")]
        assert left(client, settings) == [f"{made['id']}.results"]


# --------------------------------------------------------- the life of a job


def test_jobs_are_listed_newest_first_and_by_what_they_are(client: httpx.Client) -> None:
    client.put("/v1/collections/other", json={}).raise_for_status()
    made = [finished(client, upload(client, [line("a", i)]))["id"] for i in range(3)]
    other = finished(client, client.post("/v1/collections/other/reindex"))["id"]
    page = client.get("/v1/jobs", params={"limit": "2"})
    assert [job["id"] for job in page.json()["jobs"]] == [other, made[2]]
    following = client.get("/v1/jobs", params={"limit": "2", "cursor": page.json()["next"]}).json()
    assert [job["id"] for job in following["jobs"]] == [made[1], made[0]]
    assert "next" not in following
    assert [job["id"] for job in client.get("/v1/jobs", params={"collection": "other"}).json()["jobs"]] == [other]
    assert client.get("/v1/jobs", params={"state": "running"}).json()["jobs"] == []
    assert len(client.get("/v1/jobs", params={"state": "successful"}).json()["jobs"]) == 4
    assert client.get("/v1/jobs", params={"state": "done"}).status_code == 422
    assert client.get("/v1/jobs/nope").status_code == 404


def test_a_finished_job_can_be_forgotten(client: httpx.Client, settings: Settings) -> None:
    job = finished(client, upload(client, [line("a", 1)]))
    assert client.delete(job["links"]["self"]).status_code == 204
    assert client.get(job["links"]["self"]).status_code == 404
    assert left(client, settings) == []
    assert count(client) == 1


def held(monkeypatch: pytest.MonkeyPatch, until: Callable[[], bool]) -> None:
    """Batches of imports wait."""
    real = RunningJob.report

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        while not until() and not self._stopping.is_set():
            time.sleep(0.01)
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)


def held_at_work(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> tuple[httpx.Response, list[bool]]:
    """A job that is running, and that waits, with all jobs after it, until something is in the list."""
    go: list[bool] = []
    held(monkeypatch, lambda: bool(go))
    accepted = client.post("/v1/collections/plots/reindex")
    _until(lambda: client.get(accepted.headers["Location"]).json()["state"] == "running")
    return accepted, go


def test_a_job_at_work_can_be_dismissed(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whoever reports from outside of the transaction can be dismissed meanwhile.
    accepted, go = held_at_work(client, monkeypatch)
    url = accepted.headers["Location"]
    second = client.post("/v1/collections/plots/reindex")
    assert (second.status_code, second.json()["type"]) == (409, "/problems/conflict")
    answer = client.get(url, params={"wait": "0.2"})
    assert answer.headers["Retry-After"] == "1"
    assert client.get(f"{url}/results").status_code == 409
    dismissed = client.delete(url)
    assert (dismissed.status_code, dismissed.json()["dismissed"]) == (202, True)
    go.append(True)
    assert finished(client, accepted)["state"] == "dismissed"
    assert client.get(f"{url}/results").status_code == 410


def test_a_job_that_waits_is_dismissed_at_once(
    client: httpx.Client, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, go = held_at_work(client, monkeypatch)
    second = upload(client, [line("a", 1)])
    assert second.json()["state"] == "accepted"
    dismissed = client.delete(second.headers["Location"])
    assert (dismissed.status_code, dismissed.json()["state"]) == (202, "dismissed")
    assert left(client, settings) == []
    assert client.delete(second.headers["Location"]).status_code == 204
    go.append(True)
    assert finished(client, first)["state"] == "successful"
    assert count(client) == 0


def test_a_dismissed_import_keeps_what_it_stored(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk_ingest, "describe_lines", _small_batches(bulk_ingest.describe_lines))
    real, reported = RunningJob.report, list[int]()

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        reported.append(self.done)
        if len(reported) == 3:
            tx.jobs.change(self.id, dismissed=True)
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)
    job = finished(client, upload(client, [line(f"p{i}", i) for i in range(10)]))
    assert (job["state"], job["done"], count(client)) == ("dismissed", 4, 4)
    assert outcomes(client, job) == [(i + 1, f"p{i}", "created") for i in range(4)]


def _small_batches(describe: Callable[..., Any], size: int = 2) -> Callable[..., Any]:
    return lambda *arguments: describe(*arguments[:-1], replace(arguments[-1], batch_size=size))


def test_a_stopped_job_goes_on_where_it_was(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk_ingest, "describe_lines", _small_batches(bulk_ingest.describe_lines))
    real, stopping = RunningJob.report, list[int]()

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        if self.done == 6 and not stopping:
            stopping.append(1)
            raise running_job.Interrupted
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)
    with TestClient(create_app(settings)) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        job = finished(client, upload(client, [line(f"p{i}", i) for i in range(10)]))
    assert stopping
    with TestClient(create_app(settings)) as client:
        assert job["state"] == "successful"
        assert outcomes(client, job) == [(i + 1, f"p{i}", "created") for i in range(10)]
        assert job["counts"] == {"created": 10}


def failing(monkeypatch: pytest.MonkeyPatch, error: Exception, times: int) -> list[int]:
    """Reports raise an error so many times, whoever makes them; how often they were made."""
    real, reports = RunningJob.report, list[int]()

    def report(self: RunningJob, tx: Any = None, **progress: Any) -> None:
        reports.append(self.done)
        if len(reports) <= times:
            raise error
        real(self, tx, **progress)

    monkeypatch.setattr(RunningJob, "report", report)
    return reports


def test_a_job_that_ends_processes_is_given_up(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    reports = failing(monkeypatch, WorkerLost("gone"), 100)
    job = finished(client, upload(client, [line("a", 1)]))
    assert (job["state"], job["problem"]["type"]) == ("failed", "/problems/internal-error")
    assert "never got on" in job["problem"]["detail"]
    assert len(reports) == 5


@pytest.mark.parametrize(
    ("error", "times"), [(running_job.Interrupted(), 9), (StorageBusy("busy"), 9), (WorkerLost("gone"), 3)]
)
def test_what_is_no_fault_of_a_job_does_not_end_it(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, error: Exception, times: int
) -> None:
    monkeypatch.setattr(runner, "_LOOK", 0.01)
    reports = failing(monkeypatch, error, times)
    job = finished(client, upload(client, [line("a", 1)]))
    assert (job["state"], len(reports)) == ("successful", times + 1)
    assert outcomes(client, job) == [(1, "a", "created")]


def test_a_look_that_fails_is_not_the_last(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, failed = JobReader.queues, list[int]()

    def queues(self: JobReader) -> list[Queue]:
        if not failed:
            failed.append(1)
            raise RuntimeError("unforeseen")
        return real(self)

    monkeypatch.setattr(JobReader, "queues", queues)
    service.jobs.runner.wake()
    _until(lambda: bool(failed))
    assert finished(client, upload(client, [line("a", 1)]))["state"] == "successful"


def test_a_defect_fails_the_job_and_not_the_service(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(import_submaps, "_write_results", lambda *_: 1 / 0)
        job = finished(client, upload(client, [line("a", 1)]))
    assert (job["state"], job["problem"]["type"]) == ("failed", "/problems/internal-error")
    assert "ZeroDivisionError" in caplog.text
    assert count(client) == 0
    assert finished(client, upload(client, [line("a", 1)]))["state"] == "successful"


def test_a_collection_that_is_gone_fails_its_jobs(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, go = held_at_work(client, monkeypatch)
    second = upload(client, [line("a", 1)])
    client.delete("/v1/collections/plots").raise_for_status()
    client.put("/v1/collections/plots", json={}).raise_for_status()
    put_submap(client, "plots", "new", 3).raise_for_status()
    go.append(True)
    for accepted in (first, second):
        job = finished(client, accepted)
        assert (job["state"], job["problem"]["type"]) == ("failed", "/problems/not-found")
    assert count(client) == 1
    assert left(client, service.settings) == []


def test_a_collection_that_goes_in_the_middle_of_an_import(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bulk_ingest, "describe_lines", _small_batches(bulk_ingest.describe_lines))
    real, gone = import_submaps._observe, list[int]()

    def observe(*arguments: Any) -> None:
        real(*arguments)
        gone.append(1)
        if len(gone) == 2:
            client.delete("/v1/collections/plots").raise_for_status()

    monkeypatch.setattr(import_submaps, "_observe", observe)
    job = finished(client, upload(client, [line(f"p{i}", i) for i in range(10)]))
    assert (job["state"], job["problem"]["type"], job["done"]) == ("failed", "/problems/not-found", 4)
    assert client.get(job["links"]["results"]).status_code == 410


def test_reindexing(client: httpx.Client, service: Service) -> None:
    for i in range(5):
        put_submap(client, "plots", f"p{i}", i).raise_for_status()
    job = finished(client, client.post("/v1/collections/plots/reindex"))
    assert (job["state"], job["total"], job["done"], job["counts"]) == ("successful", 5, 5, {"indexed": 5})
    assert list(service.indexes.folder.path.glob("*.segment"))
    answer = client.post("/v1/collections/plots/queries", json={"xy": points(forest(3))}).json()
    assert answer["candidates"][0]["submap_id"] == "p3"
    assert client.post("/v1/collections/nope/reindex").status_code == 404


def test_results_are_removed_in_time(
    client: httpx.Client, service: Service, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = finished(client, upload(client, [line("a", 1)]))
    service.jobs.runner.clean_up()
    assert results(client, job)
    old = settings.jobs.model_copy(update={"keep_days": 1e-9})
    monkeypatch.setattr(service.jobs.runner, "_context", _with(service.jobs.runner._context, old))
    monkeypatch.setattr("server.jobs.folder._GRACE", 0.0)
    time.sleep(0.01)
    service.jobs.runner.clean_up()
    assert left(client, settings) == []
    assert client.get(job["links"]["self"]).json()["counts"] == {"created": 1}
    for what in ("results", "errors"):
        response = client.get(job["links"][what])
        assert (response.status_code, response.json()["type"]) == (410, "/problems/gone")


def test_the_newest_jobs_are_remembered(
    client: httpx.Client, service: Service, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [finished(client, upload(client, [line("a", i)]))["id"] for i in range(3)]
    few = settings.jobs.model_copy(update={"keep_jobs": 2})
    monkeypatch.setattr(service.jobs.runner, "_context", _with(service.jobs.runner._context, few))
    monkeypatch.setattr("server.jobs.folder._GRACE", 0.0)
    service.jobs.runner.clean_up()
    assert [job["id"] for job in client.get("/v1/jobs").json()["jobs"]] == [made[2], made[1]]
    assert left(client, settings) == sorted(f"{job}.results" for job in made[1:])


def test_an_upload_is_not_removed_before_its_job_is_there(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long it lay there, and whatever the clock says."""
    monkeypatch.setattr("server.jobs.folder._GRACE", -1.0)
    real = queue.accept

    def accept(*arguments: Any, **named: Any) -> Any:
        service.jobs.runner.clean_up()
        return real(*arguments, **named)

    monkeypatch.setattr(queue, "accept", accept)
    job = finished(client, upload(client, [line("a", 1)]))
    assert outcomes(client, job) == [(1, "a", "created")]


def test_an_upload_that_is_gone_is_no_success(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = queue.accept

    def accept(*arguments: Any, **named: Any) -> Any:
        service.jobs.folder.input(arguments[3].id).unlink()
        return real(*arguments, **named)

    monkeypatch.setattr(queue, "accept", accept)
    job = finished(client, upload(client, [line("a", 1)]))
    assert (job["state"], job["problem"]["status"]) == ("failed", 503)
    assert "upload is missing" in job["problem"]["detail"]


def test_results_are_read_to_their_end_although_the_job_is_forgotten(client: httpx.Client, service: Service) -> None:
    job = finished(client, upload(client, [line("a", 1)]))
    found = queue.results(service.database, service.jobs.folder, UNRESTRICTED, job["id"])
    assert client.delete(job["links"]["self"]).status_code == 204
    with found.file as file:
        assert orjson.loads(file.read(found.size))["outcome"] == "created"


def _with(context: running_job.JobContext, jobs: Any) -> running_job.JobContext:
    settings = context.settings.model_copy(update={"jobs": jobs})
    return running_job.JobContext(settings, context.database, context.indexes, context.metrics, context.folder)


def test_what_was_never_taken_on_is_removed(client: httpx.Client, service: Service) -> None:
    folder = service.jobs.folder
    folder.make()
    finished(client, upload(client, [line("a", 1)]))
    stray = [folder.arriving("x"), folder.input("y"), folder.results("z")]
    for path in stray:
        path.write_bytes(b"left")
        os.utime(path, (1, 1))
    with folder.arriving("x").open("rb") as sending:
        assert try_lock(sending)
        service.jobs.runner.clean_up()
    assert [path.exists() for path in stray] == [True, False, False]
    service.jobs.runner.clean_up()
    assert not folder.arriving("x").exists()


def test_jobs_of_others_are_not_there(client: httpx.Client, app: FastAPI) -> None:
    job = finished(client, upload(client, [line("a", 1)]))
    store = app.state.service.database
    foreign = {"Authorization": f"Bearer {api_keys.make(store, 'foreign', list(Scope), ['theirs'])[0]}"}
    app.state.authenticator = Authenticator(app.state.service.settings, store)
    url = job["links"]["self"]
    for method, path in (("GET", url), ("DELETE", url), ("GET", f"{url}/results"), ("GET", f"{url}/errors")):
        there = client.request(method, path, headers=foreign)
        not_there = client.request(method, path.replace(job["id"], "nope"), headers=foreign)
        assert there.status_code == not_there.status_code == 404
        assert there.json()["detail"].replace(job["id"], "nope") == not_there.json()["detail"]
    assert client.get("/v1/jobs", headers=foreign).json()["jobs"] == []
    assert upload(client, [line("b", 1)], foreign).status_code == 404


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
