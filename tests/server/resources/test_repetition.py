"""A POST that is sent again: among processes, for callers of fewer scopes, and what is removed."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from sqlalchemy import func, select, update

from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from server.store.repositories import stored_responses
from server.store.service_records import ResponseRecord
from server.store.service_tables import IdempotencyRow
from server.store.sqlite.database import Database
from tests.server.factories import forest, points
from tests.server.processes import Server

SUBMAPS = "/v1/collections/plots/submaps"


def test_two_processes_store_it_once(tmp_path: Path, serve: Callable[..., Server]) -> None:
    servers = [serve(tmp_path / "shared.db") for _ in range(2)]
    servers[0].client.put("/v1/collections/plots", json={}).raise_for_status()

    def send(i: int) -> httpx.Response:
        # Four rounds of four attempts each, half of them to either process.
        headers = {"Idempotency-Key": f"k{i // 4}"}
        return servers[i % 2].client.post(SUBMAPS, json={"xy": points(forest(i // 4)), "query": {}}, headers=headers)

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(send, range(16)))
    assert {answer.status_code for answer in answers} == {201}
    for start in range(0, 16, 4):
        some = answers[start : start + 4]
        assert len({(answer.content, answer.headers["Location"], answer.headers["ETag"]) for answer in some}) == 1
        assert [answer.headers.get("Idempotency-Replayed") for answer in some].count(None) == 1
    for server in servers:
        assert server.client.get("/v1/collections/plots").json()["counts"]["submaps"] == 4


def test_answers_outlive_the_process(tmp_path: Path, serve: Callable[..., Server]) -> None:
    first, headers = serve(tmp_path / "shared.db"), {"Idempotency-Key": "k"}
    first.client.put("/v1/collections/plots", json={}).raise_for_status()
    answer = first.client.post(SUBMAPS, json={"xy": points(forest(1))}, headers=headers)
    first.kill()
    again = serve(tmp_path / "shared.db").client.post(SUBMAPS, json={"xy": points(forest(1))}, headers=headers)
    assert (again.content, again.headers["Location"]) == (answer.content, answer.headers["Location"])
    assert again.headers["Idempotency-Replayed"] == "true"


def _row(operation: str, name: str) -> ResponseRecord:
    return ResponseRecord(
        caller="",
        operation=operation,
        name=name,
        digest="d" * 64,
        status=201,
        headers={},
        body=b"{}",
    )


def test_old_answers_are_removed_some_at_a_time(database: Database) -> None:
    now = datetime.now(UTC)

    def keep(name: str) -> None:
        with database.write() as tx:
            tx.responses.keep(_row("post", name), now - timedelta(hours=24))

    def names() -> list[str]:
        with database.read_connection() as connection:
            return list(connection.scalars(select(IdempotencyRow.name).order_by(IdempotencyRow.key)))

    for i in range(250):
        keep(f"old{i}")
    with database.write_connection() as connection:
        connection.execute(update(IdempotencyRow).values(created=now - timedelta(hours=25)))
    left = []
    for i in range(3):
        keep(f"new{i}")
        left.append(sum(name.startswith("old") for name in names()))
    assert left == [150, 50, 0]
    assert names() == ["new0", "new1", "new2"]
    with database.read_connection() as connection:
        assert connection.scalar(select(func.count()).select_from(IdempotencyRow)) == 3


def test_only_the_newest_answers_are_kept(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_responses, "_MOST", 10)
    since = datetime.now(UTC) - timedelta(hours=24)
    for i in range(30):
        with database.write() as tx:
            tx.responses.keep(_row("put", str(i)), since)
    with database.read_connection() as connection:
        names = list(connection.scalars(select(IdempotencyRow.name).order_by(IdempotencyRow.key)))
    assert names == [str(i) for i in range(19, 30)]


def test_a_question_on_the_way_needs_leave_to_read(client: httpx.Client, app: FastAPI) -> None:
    store = app.state.service.database
    writer, both = (
        api_keys.make(store, "a", scopes, ["*"])[0] for scopes in ([Scope.WRITE], [Scope.WRITE, Scope.READ])
    )
    app.state.authenticator = Authenticator(app.state.service.settings, store)
    for secret, wanted, status in ((writer, False, 201), (writer, True, 403), (both, True, 201)):
        sent: dict[str, Any] = {"xy": points(forest(1))} | ({"query": {}} if wanted else {})
        response = client.post(SUBMAPS, json=sent, headers={"Authorization": f"Bearer {secret}"})
        assert response.status_code == status
    headers = {"Authorization": f"Bearer {both}"}
    assert client.get("/v1/collections/plots", headers=headers).json()["counts"]["submaps"] == 2
