"""POST of submaps: ids made by the service, repetition, a question in the same call; sessions; parameters."""

import gzip
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from server.platform.ids import new_id
from server.resources import idempotency
from server.security import api_keys
from server.security.authenticator import Authenticator
from server.security.principal import Scope
from server.store.repositories.stored_responses import StoredResponses
from tests.server.factories import forest, observed, points, put_submap

SUBMAPS = "/v1/collections/plots/submaps"


def body(seed: int, **fields: Any) -> dict[str, Any]:
    return {"xy": points(forest(seed)), **fields}


def count(client: httpx.Client) -> int:
    counts: dict[str, int] = client.get("/v1/collections/plots").json()["counts"]
    return counts["submaps"]


def test_the_service_makes_ids_in_the_order_of_time(client: httpx.Client) -> None:
    made = [client.post(SUBMAPS, json=body(seed)) for seed in range(3)]
    for response in made:
        assert response.status_code == 201
        stored = client.get(response.headers["Location"])
        assert stored.json()["id"] == response.json()["id"]
        assert stored.headers["ETag"].removeprefix("W/") == response.headers["ETag"]
        assert "query" not in response.json()
    listed = client.get(SUBMAPS).json()["submaps"]
    assert [one["id"] for one in listed] == [response.json()["id"] for response in made]
    ids = [new_id() for _ in range(5000)]
    assert len(set(ids)) == 5000
    assert [one[:9] for one in ids] == sorted(one[:9] for one in ids)


def test_sent_again_it_is_stored_once(client: httpx.Client) -> None:
    headers = {"Idempotency-Key": "robot-2/17"}
    first = client.post(SUBMAPS, json=body(1, query={}), headers=headers)
    put_submap(client, "plots", "other", 2).raise_for_status()
    again = client.post(SUBMAPS, json=body(1, query={}), headers=headers)
    assert (first.status_code, again.status_code) == (201, 201)
    assert first.content == again.content
    assert first.headers["Location"] == again.headers["Location"]
    assert first.headers["ETag"] == again.headers["ETag"]
    assert again.headers["Idempotency-Replayed"] == "true"
    assert "Idempotency-Replayed" not in first.headers
    assert count(client) == 2
    other = client.post(SUBMAPS, json=body(2), headers=headers)
    assert (other.status_code, other.json()["type"]) == (422, "/problems/idempotency-key-reused")
    asked = client.post(f"{SUBMAPS}?query=true", json=body(1, query={}), headers=headers)
    assert asked.status_code == 422
    assert count(client) == 2
    assert client.post(SUBMAPS, json=body(1), headers={"Idempotency-Key": "other"}).status_code == 201
    assert client.post(SUBMAPS, json=body(1)).status_code == 201
    assert count(client) == 4


def test_what_was_refused_may_be_tried_again_under_its_key(client: httpx.Client) -> None:
    headers = {"Idempotency-Key": "k"}
    assert client.post(SUBMAPS, json={"xy": [[0, 0], [1, 1], [2, 2]]}, headers=headers).status_code == 422
    assert client.post(SUBMAPS, json=body(1), headers=headers).status_code == 201


@pytest.mark.parametrize("key", ["", "two words", "x" * 256, "\u00e9"])
def test_keys_that_cannot_be(client: httpx.Client, key: str) -> None:
    response = client.post(SUBMAPS, json=body(1), headers={b"Idempotency-Key": key.encode("latin-1")})
    assert response.status_code == 422
    assert response.json()["errors"]
    assert count(client) == 0


def test_at_the_same_time_it_is_stored_once(client: httpx.Client) -> None:
    barrier = threading.Barrier(8)

    def send(_: int) -> httpx.Response:
        barrier.wait()
        return client.post(SUBMAPS, json=body(1), headers={"Idempotency-Key": "k"})

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(send, range(8)))
    assert {answer.content for answer in answers} == {answers[0].content}
    assert [answer.headers.get("Idempotency-Replayed") for answer in answers].count(None) == 1
    assert count(client) == 1


def test_the_answer_and_the_submap_are_stored_together_or_not_at_all(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("the power goes out")

    with monkeypatch.context() as patched:
        patched.setattr(StoredResponses, "keep", fail)
        assert client.post(SUBMAPS, json=body(1), headers={"Idempotency-Key": "k"}).status_code == 500
    assert count(client) == 0
    assert client.post(SUBMAPS, json=body(1), headers={"Idempotency-Key": "k"}).status_code == 201


def test_answers_are_forgotten_in_time_and_with_the_collection(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    headers = {"Idempotency-Key": "k"}
    client.post(SUBMAPS, json=body(1), headers=headers).raise_for_status()
    client.delete("/v1/collections/plots").raise_for_status()
    assert client.post(SUBMAPS, json=body(1), headers=headers).status_code == 404
    client.put("/v1/collections/plots", json={}).raise_for_status()
    assert "Idempotency-Replayed" not in client.post(SUBMAPS, json=body(1), headers=headers).headers
    with monkeypatch.context() as patched:
        patched.setattr(idempotency.IdempotencyKey, "since", datetime.now(UTC) + timedelta(hours=1))
        assert "Idempotency-Replayed" not in client.post(SUBMAPS, json=body(1), headers=headers).headers
    assert count(client) == 2


def test_keys_of_callers_are_their_own(client: httpx.Client, app: FastAPI) -> None:
    store = app.state.service.database
    secrets = [api_keys.make(store, name, list(Scope), ["*"])[0] for name in "ab"]
    app.state.authenticator = Authenticator(app.state.service.settings, store)
    for secret in secrets:
        headers = {"Idempotency-Key": "k", "Authorization": f"Bearer {secret}"}
        answer = client.post(SUBMAPS, json=body(1), headers=headers)
        assert answer.status_code == 201
        assert "Idempotency-Replayed" not in answer.headers


# ------------------------------------------------------- asked, then stored


@pytest.mark.parametrize("how", ["parameter", "member"])
@pytest.mark.parametrize("method", ["POST", "PUT"])
def test_a_loop_is_closed_in_one_call(client: httpx.Client, how: str, method: str) -> None:
    put_submap(client, "plots", "p", 1, session="monday").raise_for_status()
    seen, truth = observed(forest(1), 4)
    sent = {"xy": seen, "session": "tuesday"} | ({"query": {"limit": 3}} if how == "member" else {})
    url = SUBMAPS if method == "POST" else f"{SUBMAPS}/q"
    response = client.request(method, url, json=sent, params={"query": "true"} if how == "parameter" else {})
    assert response.status_code == 201
    answer = response.json()["query"]
    best = answer["candidates"][0]
    assert (answer["verdict"], best["submap_id"], best["session"]) == ("matched", "p", "monday")
    assert best["transform"]["x"] == pytest.approx(truth.x, abs=0.1)
    # Stored again it does not find itself.
    own = response.json()["id"]
    again = client.put(f"{SUBMAPS}/{own}", json=sent | {"query": {}})
    assert again.json()["outcome"] == "unchanged"
    assert [one["submap_id"] for one in again.json()["query"]["candidates"]] == ["p"]
    excluded = client.put(f"{SUBMAPS}/{own}", json=sent | {"query": {"exclude": {"session": "monday"}}})
    assert excluded.json()["query"]["verdict"] == "no_match"


def test_a_question_that_cannot_be_asked_stores_nothing(client: httpx.Client) -> None:
    response = client.post(SUBMAPS, json=body(1, query={"limit": 1000}))
    assert (response.status_code, response.json()["errors"][0]["pointer"]) == (422, "/query/limit")
    response = client.post(SUBMAPS, json=body(1, query={"limits": 1}))
    assert response.json()["errors"][0]["pointer"] == "/query/limits"
    assert count(client) == 0


# ---------------------------------------------------------------- sessions


def test_sessions_by_name(client: httpx.Client) -> None:
    for i, (session, stamp) in enumerate(
        [("b", "2026-05-01T10:00:00Z"), ("a", None), ("b", "2026-05-01T08:00:00Z"), (None, None), ("c", None)]
    ):
        put_submap(client, "plots", f"p{i}", i, session=session, stamp=stamp).raise_for_status()
    first = client.get("/v1/collections/plots/sessions", params={"limit": "2"}).json()
    assert first["sessions"] == [
        {"session": "a", "submaps": 1, "landmarks": 60, "first": None, "last": None},
        {
            "session": "b",
            "submaps": 2,
            "landmarks": 120,
            "first": "2026-05-01T08:00:00Z",
            "last": "2026-05-01T10:00:00Z",
        },
    ]
    response = client.get("/v1/collections/plots/sessions", params={"limit": "2", "cursor": first["next"]})
    assert [one["session"] for one in response.json()["sessions"]] == ["c"]
    assert "next" not in response.json()
    assert "Link" not in response.headers
    other = client.get(SUBMAPS, params={"limit": "2"}).json()["next"]
    for listing, cursor in (("sessions", other), ("submaps", first["next"]), ("sessions", "x")):
        refused = client.get(f"/v1/collections/plots/{listing}", params={"cursor": cursor})
        assert (refused.status_code, refused.json()["errors"][0]["parameter"]) == (422, "cursor")


# -------------------------------------------------------------- parameters


@pytest.mark.parametrize(
    ("path", "name"),
    [
        (f"{SUBMAPS}?sesion=a", "sesion"),
        (f"{SUBMAPS}?limit=1&limit=2", "limit"),
        ("/v1/collections?page=2", "page"),
        ("/v1/collections/plots?x", "x"),
    ],
)
def test_parameters_that_are_not_known_or_come_twice_are_refused(client: httpx.Client, path: str, name: str) -> None:
    response = client.get(path)
    assert response.status_code == 422
    assert response.json()["errors"][0]["parameter"] == name


# -------------------------------------------------------------------- gzip


def packed(content: bytes) -> bytes:
    return gzip.compress(content, mtime=0)  # these are names of tests, too, which must not depend on when they are read


GZIP = {"Content-Type": "application/json", "Content-Encoding": "gzip"}


def test_packed_bodies_are_read(client: httpx.Client) -> None:
    content = httpx.Request("POST", "http://x", json=body(1)).content
    assert client.put(f"{SUBMAPS}/p", content=packed(content), headers=GZIP).status_code == 201
    halves = packed(content[:100]) + packed(content[100:])
    assert client.put(f"{SUBMAPS}/p", content=halves, headers=GZIP).json()["outcome"] == "unchanged"
    for header in ("x-gzip", "GZIP", "identity"):
        sent = content if header == "identity" else packed(content)
        response = client.put(f"{SUBMAPS}/p", content=sent, headers=GZIP | {"Content-Encoding": header})
        assert response.json()["outcome"] == "unchanged"


@pytest.mark.parametrize(
    ("content", "encoding", "status"),
    [
        (b"{}", "gzip", 400),
        (packed(b"{}")[:-4], "gzip", 400),
        (packed(b"{}"), "br", 415),
        (packed(b"{}"), "gzip, gzip", 415),
        (packed(b" " * 50_000_000), "gzip", 413),
    ],
)
def test_packed_bodies_that_cannot_be_read(client: httpx.Client, content: bytes, encoding: str, status: int) -> None:
    response = client.put(f"{SUBMAPS}/p", content=content, headers=GZIP | {"Content-Encoding": encoding})
    assert response.status_code == status
    assert response.headers["Content-Type"] == "application/problem+json"
    assert count(client) == 0


def test_answers_are_packed_for_who_accepts_it(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    plain = client.get(f"{SUBMAPS}/p", headers={"Accept-Encoding": "identity"})
    assert "Content-Encoding" not in plain.headers
    assert "Accept-Encoding" in plain.headers["Vary"]
    small = client.get(f"{SUBMAPS}/p", headers={"Accept-Encoding": "br;q=1, gzip;q=0.5"})
    assert small.headers["Content-Encoding"] == "gzip"
    assert small.json() == plain.json()
    assert int(small.headers["Content-Length"]) < 0.6 * len(plain.content)
    assert small.headers["ETag"] == f"W/{plain.headers['ETag']}"
    for etag in (small.headers["ETag"], plain.headers["ETag"]):
        assert client.get(f"{SUBMAPS}/p", headers={"If-None-Match": etag}).status_code == 304
        assert client.put(f"{SUBMAPS}/p", json=body(1), headers={"If-Match": etag}).status_code == 200
    for header in ("gzip;q=0", "*;q=0", "br", ""):
        answer = client.get(f"{SUBMAPS}/p", headers={"Accept-Encoding": header})
        assert "Content-Encoding" not in answer.headers
    assert "Content-Encoding" not in client.get("/livez", headers={"Accept-Encoding": "gzip"}).headers
    head = client.head(f"{SUBMAPS}/p", headers={"Accept-Encoding": "gzip"})
    assert (head.content, head.headers["Content-Length"]) == (b"", small.headers["Content-Length"])
