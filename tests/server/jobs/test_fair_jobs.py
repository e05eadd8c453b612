"""Jobs of many callers: they take turns, nobody has too many, and the operator can end each."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from server import cli
from server.app import create_app
from server.config.settings import Limits, Settings
from server.config.settings_groups import JobSettings
from server.jobs import operator_commands, queue
from server.jobs.running_job import JobContext, RunningJob
from server.jobs.types import find_constraints
from server.security import api_keys
from server.security.principal import UNRESTRICTED, Scope
from server.service_parts import Service
from tests.server.factories import TestClient, put_submap
from tests.server.jobs.test_jobs import finished, line, upload

QUOTA = 5
CONSTRAINTS = "/v1/collections/plots/constraints"


@pytest.fixture
def app(tmp_path: Path) -> FastAPI:
    """A service in which a job gives way after every report."""
    limits = Limits(unfinished_jobs=QUOTA)
    return create_app(
        Settings(database=str(tmp_path / "a.db"), limits=limits, jobs=JobSettings(slice_seconds=1e-6, processes=1))
    )


@pytest.fixture
def client(app: FastAPI) -> Iterator[httpx.Client]:
    """A client with two collections, and some submaps in one of them."""
    with TestClient(app) as started:
        for collection in ("plots", "others"):
            started.put(f"/v1/collections/{collection}", json={}).raise_for_status()
        for i in range(6):
            put_submap(started, "plots", f"p{i}", i).raise_for_status()
        yield started


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Look-ups of constraints jobs report after each submap, and take long until the event is set."""
    let_go = threading.Event()
    real = find_constraints._look_up

    def look_up(*arguments: Any) -> Any:
        let_go.wait(0.5)
        return real(*arguments)

    monkeypatch.setattr(find_constraints, "_SILENCE", -1.0)
    monkeypatch.setattr(find_constraints, "_look_up", look_up)
    yield let_go
    let_go.set()


def key(app: FastAPI, *scopes: Scope) -> tuple[str, dict[str, str]]:
    """A new key: its id, and the header that shows it."""
    secret, info = api_keys.make(app.state.service.database, "robot", scopes or [Scope.READ, Scope.WRITE], ["*"])
    app.state.authenticator._asks_for_keys = None
    return info.id, {"Authorization": f"Bearer {secret}"}


def states(client: httpx.Client, headers: dict[str, str]) -> list[str]:
    return [job["state"] for job in client.get("/v1/jobs", headers=headers).json()["jobs"]]


def test_a_callers_many_jobs_do_not_keep_anothers_waiting(
    client: httpx.Client, app: FastAPI, slow: threading.Event
) -> None:
    """The other's job is done while most of the first caller's are not."""
    _, busy = key(app, Scope.READ)
    _, other = key(app)
    mine = [client.post(CONSTRAINTS, json={}, headers=busy) for _ in range(QUOTA)]
    accepted = upload(client, [line("new", 77)], other)
    for _ in range(600):
        job = client.get(accepted.headers["Location"], headers=other, params={"wait": "1"}).json()
        if job["finished"]:
            break
    assert job["state"] == "successful"
    found = [client.get(one.headers["Location"], headers=busy).json() for one in mine]
    assert sum(one["finished"] is None for one in found) >= QUOTA - 1
    slow.set()
    for one in mine:
        for _ in range(600):
            job = client.get(one.headers["Location"], headers=busy, params={"wait": "1"}).json()
            if job["finished"]:
                break
        assert (job["state"], job["done"]) == ("successful", 7), "a job that gave way goes on where it was"


def test_callers_take_turns(client: httpx.Client, app: FastAPI, service: Service) -> None:
    """Each gets a turn before anybody gets another, however many jobs the first has."""
    order: list[str] = []

    def work(job: RunningJob, context: JobContext) -> None:
        order.append(job.parameters["name"])
        job.done += 1
        job.report()
        if job.done < 2:
            job.yield_turn()

    runner = service.jobs.runner
    runner.stop()
    runner._job_types = {"import": work}
    limits = service.settings.limits
    for name, caller in (("a1", "a"), ("a2", "a"), ("a3", "a"), ("b1", "b"), ("c1", "c")):
        of = type(UNRESTRICTED)(caller, UNRESTRICTED.scopes, UNRESTRICTED.patterns)
        queue.accept(service.database, "plots", of, queue.NewJob("import", {"name": name}), None, limits)
    runner._stopping.clear()
    while runner.run_once():
        pass
    assert order[:3] == ["a1", "b1", "c1"]
    assert order[3:6] == ["a1", "b1", "c1"]
    assert order[6:] == ["a2", "a3"], "nobody else waits: there is nothing to give way to"


def test_a_caller_has_so_many_unfinished_jobs(client: httpx.Client, app: FastAPI, slow: threading.Event) -> None:
    _, busy = key(app, Scope.READ)
    _, other = key(app)
    answers = [client.post(CONSTRAINTS, json={}, headers=busy) for _ in range(QUOTA + 3)]
    assert [one.status_code for one in answers] == [202] * QUOTA + [429] * 3
    refused = answers[-1].json()
    assert refused["type"] == "/problems/too-many-jobs"
    assert (refused["limit"], refused["allowed"]) == ("unfinished_jobs", QUOTA)
    assert int(answers[-1].headers["Retry-After"]) >= 1
    assert client.get("/v1/limits", headers=busy).json()["limits"]["unfinished_jobs"] == QUOTA
    assert client.post(CONSTRAINTS, json={}, headers=other).status_code == 202, "another key has its own"
    dismissed = client.delete(answers[0].headers["Location"], headers=busy)
    assert dismissed.status_code == 202, "a key that may only read dismisses its own"
    slow.set()
    for _ in range(600):
        if client.post(CONSTRAINTS, json={}, headers=busy).status_code == 202:
            break
        time.sleep(0.1)
    else:
        raise AssertionError("the quota is never free again")


def test_an_upload_beyond_the_quota_is_refused_before_it_is_read(
    client: httpx.Client, app: FastAPI, slow: threading.Event
) -> None:
    _, busy = key(app)
    idempotency_key = busy | {"Idempotency-Key": "k1"}
    first = client.post(CONSTRAINTS, json={}, headers=idempotency_key)
    for _ in range(QUOTA - 1):
        client.post(CONSTRAINTS, json={}, headers=busy).raise_for_status()
    assert upload(client, [line("x", 1)], busy).status_code == 429
    again = client.post(CONSTRAINTS, json={}, headers=idempotency_key)
    assert (again.status_code, again.headers["Location"]) == (202, first.headers["Location"])
    assert again.headers["Idempotency-Replayed"] == "true"


def test_jobs_of_others_are_not_dismissed_by_who_may_only_read(
    client: httpx.Client, app: FastAPI, slow: threading.Event
) -> None:
    _, owner = key(app, Scope.READ)
    _, reader = key(app, Scope.READ)
    _, chief = key(app, Scope.ADMIN)
    job = client.post(CONSTRAINTS, json={}, headers=owner).headers["Location"]
    assert client.delete(job, headers=reader).status_code == 403
    assert client.delete(job, headers=chief).status_code == 202


def test_jobs_of_a_revoked_key_end(client: httpx.Client, app: FastAPI, service: Service, slow: threading.Event) -> None:
    name, busy = key(app, Scope.READ)
    _, other = key(app)
    for _ in range(QUOTA):
        client.post(CONSTRAINTS, json={}, headers=busy).raise_for_status()
    api_keys.revoke(service.database, name)
    for _ in range(600):
        if set(states(client, other)) == {"dismissed"}:
            break
        time.sleep(0.05)
    jobs = client.get("/v1/jobs", headers=other).json()["jobs"]
    assert [job["state"] for job in jobs] == ["dismissed"] * QUOTA
    assert all("revoked" in job["problem"]["detail"] for job in jobs)
    with service.database.write() as tx:
        assert tx.jobs.unfinished_of(name) == 0


def test_a_key_that_was_just_revoked_begins_nothing(client: httpx.Client, app: FastAPI, service: Service) -> None:
    name, busy = key(app, Scope.READ)
    assert client.get("/v1/jobs", headers=busy).status_code == 200, "the service remembers the key for a second"
    api_keys.revoke(service.database, name)
    assert client.post(CONSTRAINTS, json={}, headers=busy).status_code == 401
    assert not operator_commands.listed(service.database)


def test_the_operator_lists_and_cancels(
    client: httpx.Client,
    app: FastAPI,
    service: Service,
    slow: threading.Event,
    capsys: pytest.CaptureFixture[str],
) -> None:
    name, busy = key(app, Scope.READ)
    _, other = key(app)
    accepted = [client.post(CONSTRAINTS, json={}, headers=busy) for _ in range(3)]
    ids = [one.headers["Location"].rsplit("/", 1)[-1] for one in accepted]
    spared = client.post(CONSTRAINTS, json={}, headers=other).headers["Location"]
    database = ["--database", str(service.database.path)]
    assert cli.run(["jobs", "list", *database]) == 0
    said = capsys.readouterr().out
    assert all(job_id in said for job_id in ids)
    assert name in said
    assert cli.run(["jobs", "cancel", ids[0], *database]) == 0
    assert capsys.readouterr().out.split() == [ids[0]]
    assert cli.run(["jobs", "cancel", "--key", name, *database]) == 0
    assert set(capsys.readouterr().out.split()) >= set(ids[1:])
    for one in accepted:
        for _ in range(600):
            job = client.get(one.headers["Location"], headers=busy, params={"wait": "1"}).json()
            if job["finished"]:
                break
        assert job["state"] == "dismissed"
        assert "operator" in job["problem"]["detail"]
    assert not client.get(spared, headers=other).json()["dismissed"]
    for arguments in (["cancel"], ["cancel", "nothing"], ["cancel", ids[0]], ["cancel", ids[0], "--all"]):
        assert cli.run(["jobs", *arguments, *database]) == 2
    capsys.readouterr()
    assert cli.run(["jobs", "cancel", "--all", *database]) == 0
    slow.set()
    assert client.get(spared, headers=other, params={"wait": "30"}).json()["state"] == "dismissed"
    assert cli.run(["jobs", "list", *database]) == 0
    assert "no unfinished jobs" in capsys.readouterr().out
    assert cli.run(["jobs", "list", "--all", *database]) == 0
    assert ids[0] in capsys.readouterr().out


def test_an_import_that_gives_way_loses_no_line(client: httpx.Client, app: FastAPI) -> None:
    """Between its turns another's is done; every line has one result."""
    _, first = key(app)
    _, second = key(app)
    one = upload(client, [line(f"a{i}", i) for i in range(30)], first)
    two = upload(client, [line(f"b{i}", i) for i in range(30)], second)
    for accepted, headers in ((one, first), (two, second)):
        client.headers.update(headers)
        job = finished(client, accepted)
        assert (job["state"], job["counts"]) == ("successful", {"created": 30})
        lines = client.get(job["links"]["results"]).text.splitlines()
        assert len(lines) == 30
