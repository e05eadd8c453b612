"""Jobs belong to a collection, not to its name; and what they count while others write."""

from typing import Any

import httpx
import orjson
import pytest
from fastapi import FastAPI

from server.checks.all_checks import inspect
from server.collections import crud
from server.index import flushing
from server.jobs import running_job
from server.jobs.folder import JobFolder
from server.schemas.collections import CollectionPut
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from server.service_parts import Service
from server.store.sqlite.database import Database
from tests.server.factories import put_submap
from tests.server.jobs.test_jobs import finished, left, line, upload

URL = "/v1/collections/plots"


@pytest.fixture
def as_caller(client: httpx.Client, app: FastAPI, service: Service) -> dict[str, dict[str, str]]:
    """Headers of the robots of two tenants, who both may see `plots`, and of the operator."""
    patterns = {"first": ["plots*"], "second": ["plots*"], "operator": ["*"]}
    made = {name: api_keys.make(service.database, name, list(Scope), seen)[0] for name, seen in patterns.items()}
    app.state.authenticator = Authenticator(service.settings, service.database)
    return {name: {"Authorization": f"Bearer {secret}"} for name, secret in made.items()}


@pytest.mark.parametrize("again", [False, True])
def test_results_go_with_the_collection(
    client: httpx.Client, as_caller: dict[str, dict[str, str]], again: bool
) -> None:
    first, second, operator = as_caller.values()
    job = finished_as(client, first, upload(client, [line("secret", 1)], first))
    constraints = finished_as(client, first, client.post(f"{URL}/constraints", json={}, headers=first))
    for one in (job, constraints):
        assert client.get(one["links"]["results"], headers=second).status_code == 200
    client.delete(URL, headers=first).raise_for_status()
    if again:
        client.put(URL, json={}, headers=second).raise_for_status()
    for one, what, caller in (
        (job, "results", first),
        (job, "errors", first),
        (job, "results", operator),
        (constraints, "results", first),
    ):
        response = client.get(one["links"][what], headers=caller)
        assert (response.status_code, response.json()["type"]) == (410, "/problems/gone"), (what, response.text)
    assert client.get(f"{constraints['links']['results']}?format=g2o", headers=first).status_code == 410
    expected = 404 if again else 200
    assert client.get(job["links"]["self"], headers=second).status_code == expected
    assert client.get(job["links"]["results"], headers=second).status_code == (404 if again else 410)
    assert client.delete(job["links"]["self"], headers=second).status_code == (404 if again else 204)
    listed = {name: client.get("/v1/jobs", headers=caller).json()["jobs"] for name, caller in as_caller.items()}
    assert [len(listed[name]) for name in as_caller] == ([2, 0, 2] if again else [1, 1, 1])


def finished_as(client: httpx.Client, caller: dict[str, str], accepted: httpx.Response) -> dict[str, Any]:
    """The job, once it is at its end."""
    assert accepted.status_code == 202, accepted.text
    while (job := client.get(accepted.headers["Location"], params={"wait": "5"}, headers=caller).json())[
        "finished"
    ] is None:
        continue
    return dict(job)


def test_files_of_results_are_removed_with_the_collection(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished(client, upload(client, [line("a", 1)]))
    monkeypatch.setattr("server.jobs.folder._GRACE", -1.0)
    service.jobs.runner.clean_up()
    assert len(left(client, service.settings)) == 1
    client.delete(URL).raise_for_status()
    client.put(URL, json={}).raise_for_status()
    service.jobs.runner.clean_up()
    assert left(client, service.settings) == []


def test_an_upload_is_for_the_collection_that_was_there_when_it_began(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = JobFolder.publish

    def publish(*arguments: Any) -> None:
        crud.delete(service.database, "plots")
        crud.ensure(service.database, "plots", CollectionPut())
        real(*arguments)

    monkeypatch.setattr(JobFolder, "publish", publish)
    response = upload(client, [line("a", 1)])
    assert (response.status_code, response.json()["type"]) == (404, "/problems/not-found")
    assert client.get("/v1/jobs").json()["jobs"] == []


def test_reindexing_beside_writers_leaves_a_sound_database(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored after the job counted the submaps is indexed, and counted, too."""
    for i in range(5):
        put_submap(client, "plots", f"p{i}", i).raise_for_status()
    real = flushing.rebuild

    def rebuild(*arguments: Any, **named: Any) -> int:
        put_submap(client, "plots", "late", 7).raise_for_status()
        return real(*arguments, **named)

    monkeypatch.setattr("server.jobs.types.reindex.rebuild", rebuild)
    job = finished(client, client.post(f"{URL}/reindex"))
    assert (job["state"], job["done"], job["total"]) == ("successful", 6, 6)
    assert list(inspect(service.database)) == []


def test_constraints_beside_writers_leave_a_sound_database(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_submap(client, "plots", "p0", 0).raise_for_status()
    put_submap(client, "plots", "p1", 1).raise_for_status()
    real, told = running_job.RunningJob.report, list[tuple[int, int | None]]()

    def report(self: running_job.RunningJob, tx: Any = None, **progress: Any) -> None:
        if not told:
            put_submap(client, "plots", "late", 7).raise_for_status()
        real(self, tx, **progress)
        told.append((self.done, self.total))
        assert list(inspect(service.database)) == []

    monkeypatch.setattr(running_job.RunningJob, "report", report)
    job = finished(client, client.post(f"{URL}/constraints", json={}))
    assert (job["state"], job["done"], job["total"]) == ("successful", 3, 3), told
    assert list(inspect(service.database)) == []


def test_a_job_of_an_older_version_that_did_more_than_it_counted_is_no_damage(
    client: httpx.Client, service: Service, database: Database
) -> None:
    job = finished(client, upload(client, [line("a", 1)]))
    with service.database.write() as tx:
        tx.jobs.change(job["id"], done=7, total=5)
    assert list(inspect(service.database)) == []
    assert orjson.loads(client.get(job["links"]["self"]).content)["done"] == 7
