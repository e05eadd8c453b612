"""Every write is done once, however often it is sent under one Idempotency-Key: also where others write in between."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from server.queries import lookup
from server.service_parts import Service
from tests.server.factories import forest, observed, points, put_submap

COLLECTION = "/v1/collections/plots"
SUBMAP = f"{COLLECTION}/submaps/p"
KEY = {"Idempotency-Key": "k"}


def body(seed: int, **fields: Any) -> dict[str, Any]:
    return {"xy": points(forest(seed)), **fields}


def test_every_write_takes_a_key(document: dict[str, Any]) -> None:
    """A write is whatever is no GET. A new route that takes no key fails here."""
    without = []
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            names = {parameter["name"].lower() for parameter in operation.get("parameters", ())}
            if method in {"post", "put", "patch", "delete"} and "idempotency-key" not in names:
                without.append(f"{method} {path}")
    assert without == []


@pytest.mark.parametrize(
    ("method", "sent"),
    [("PUT", body(1)), ("PUT", body(1, query={})), ("PATCH", {"session": "a"}), ("PATCH", body(3)), ("DELETE", None)],
)
def test_a_repetition_undoes_nobodys_write(client: httpx.Client, method: str, sent: dict[str, Any] | None) -> None:
    if method != "PUT":
        put_submap(client, "plots", "p", 1).raise_for_status()
    first = client.request(method, SUBMAP, json=sent, headers=KEY)
    assert first.is_success
    client.put(SUBMAP, json=body(2, session="another's")).raise_for_status()
    stored = client.get(SUBMAP)
    again = client.request(method, SUBMAP, json=sent, headers=KEY)
    assert (again.status_code, again.content) == (first.status_code, first.content)
    assert again.headers.get("ETag") == first.headers.get("ETag")
    assert again.headers["Idempotency-Replayed"] == "true"
    assert "Idempotency-Replayed" not in first.headers
    assert client.get(SUBMAP).json() == stored.json()


def test_a_put_that_changed_nothing_is_not_done_later(client: httpx.Client) -> None:
    client.put(SUBMAP, json=body(1)).raise_for_status()
    assert client.put(SUBMAP, json=body(1), headers=KEY).json()["outcome"] == "unchanged"
    client.put(SUBMAP, json=body(2)).raise_for_status()
    assert client.put(SUBMAP, json=body(1), headers=KEY).json()["outcome"] == "unchanged"
    assert client.get(SUBMAP).json()["landmarks"][0]["x"] == forest(2)[0, 0]


def test_a_repetition_meets_no_condition_again(client: httpx.Client) -> None:
    etag = client.put(SUBMAP, json=body(1)).headers["ETag"]
    conditional = KEY | {"If-Match": etag}
    assert client.put(SUBMAP, json=body(2), headers=conditional).status_code == 200
    assert client.put(SUBMAP, json=body(2), headers=conditional).status_code == 200
    refused = client.put(SUBMAP, json=body(2), headers=KEY | {"If-Match": "*"})
    assert (refused.status_code, refused.json()["type"]) == (422, "/problems/idempotency-key-reused")


@pytest.mark.parametrize("method", ["PUT", "PATCH", "DELETE"])
def test_collections_too(client: httpx.Client, method: str) -> None:
    path = "/v1/collections/other"
    if method != "PUT":
        client.put(path, json={}).raise_for_status()
    sent = {"title": "mine"} if method != "DELETE" else None
    first = client.request(method, path, json=sent, headers=KEY)
    assert first.is_success
    if method == "DELETE":
        client.put(path, json={"title": "theirs"}).raise_for_status()
    else:
        client.patch(path, json={"title": "theirs"}).raise_for_status()
    again = client.request(method, path, json=sent, headers=KEY)
    assert (again.status_code, again.content, again.headers["Idempotency-Replayed"]) == (
        first.status_code,
        first.content,
        "true",
    )
    assert client.get(path).json()["title"] == "theirs"
    other = client.request(method, path, json={"title": "x"} if sent else None, headers=KEY | {"If-Match": "*"})
    assert other.status_code == 422


def test_a_snapshot_of_the_same_name_is_not_deleted(client: httpx.Client) -> None:
    for _ in range(2):
        client.post("/v1/snapshots", json={"name": "s"}).raise_for_status()
        assert client.delete("/v1/snapshots/s", headers=KEY).status_code == 204
    assert client.get("/v1/snapshots/s").status_code == 200


def test_a_job_that_was_dismissed_is_not_forgotten(client: httpx.Client, service: Service) -> None:
    service.jobs.runner.stop()
    job = client.post(f"{COLLECTION}/reindex", headers=KEY).json()["id"]
    first = client.delete(f"/v1/jobs/{job}", headers=KEY)
    again = client.delete(f"/v1/jobs/{job}", headers=KEY)
    assert (first.status_code, again.status_code) == (202, 202)
    assert first.content == again.content
    assert client.get(f"/v1/jobs/{job}").status_code == 200


# ----------------------------------------------------------------- batches


def test_a_batch_stores_its_answers_once(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 4)
    sent = {"queries": [{"xy": seen, "store": True}, {"xy": seen}, {"xy": "no"}, {"xy": seen, "store": True}]}
    first = client.post(f"{COLLECTION}/queries/batch", json=sent, headers=KEY).json()["results"]
    again = client.post(f"{COLLECTION}/queries/batch", json=sent, headers=KEY).json()["results"]
    assert [one.get("id") for one in first] == ["1", None, None, "2"]
    assert [again[0], again[2], again[3]] == [first[0], first[2], first[3]]
    assert again[1]["candidates"] == first[1]["candidates"]
    other = client.post(f"{COLLECTION}/queries/batch", json={"queries": [{"xy": [], "store": True}]}, headers=KEY)
    assert (other.status_code, other.json()["type"]) == (422, "/problems/idempotency-key-reused")
    assert client.get(f"{COLLECTION}/queries/3").status_code == 404


def test_a_batch_goes_on_where_it_ended(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 4)
    sent = {"queries": [{"xy": seen, "store": True}] * 3}
    searched: list[object] = []
    look_up = lookup.look_up

    def failing(*arguments: Any, **options: Any) -> Any:
        searched.append(None)
        if len(searched) == 2:
            raise RuntimeError("the power goes out")
        return look_up(*arguments, **options)

    monkeypatch.setattr(lookup, "look_up", failing)
    assert client.post(f"{COLLECTION}/queries/batch", json=sent, headers=KEY).status_code == 500
    results = client.post(f"{COLLECTION}/queries/batch", json=sent, headers=KEY).json()["results"]
    assert [one["id"] for one in results] == ["1", "2", "3"]
    assert len(searched) == 4  # the first one is not searched again


# ---------------------------------------------------- while it is at work


def test_a_repetition_waits_for_the_first_attempt(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 4)
    began, searches = threading.Event(), list[object]()
    look_up = lookup.look_up

    def slow(*arguments: Any, **options: Any) -> Any:
        searches.append(None)
        began.set()
        time.sleep(0.5)
        return look_up(*arguments, **options)

    monkeypatch.setattr(lookup, "look_up", slow)
    sent = {"queries": [{"xy": seen, "store": True}]}

    def send(_: int) -> httpx.Response:
        return client.post(f"{COLLECTION}/queries/batch", json=sent, headers=KEY)

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(send, 0)
        assert began.wait(60.0)
        again = pool.submit(send, 1)
        assert first.result().json()["results"][0]["id"] == again.result().json()["results"][0]["id"] == "1"
    assert len(searches) == 1


def test_it_is_told_to_come_again_when_that_takes_long(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service.repetitions, "_patience", 0.05)
    began, go_on = threading.Event(), threading.Event()
    look_up = lookup.look_up

    def held(*arguments: Any, **options: Any) -> Any:
        began.set()
        assert go_on.wait(60.0)
        return look_up(*arguments, **options)

    monkeypatch.setattr(lookup, "look_up", held)
    sent = {"xy": points(forest(1)), "store": True}
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(lambda: client.post(f"{COLLECTION}/queries", json=sent, headers=KEY))
        assert began.wait(60.0)
        early = client.post(f"{COLLECTION}/queries", json=sent, headers=KEY)
        go_on.set()
        assert first.result().status_code == 200
    assert (early.status_code, early.json()["type"]) == (409, "/problems/still-running")
    assert early.headers["Retry-After"] == "1"
    again = client.post(f"{COLLECTION}/queries", json=sent, headers=KEY)
    assert again.headers["Idempotency-Replayed"] == "true"
    assert again.json()["id"] == first.result().json()["id"]
