"""API keys: who is let in, to what, and that nobody sees what is another's."""

import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute

from server.app import create_app
from server.config.settings import Settings
from server.errors import Conflict, InvalidField, NotFound, Unauthorized
from server.http.admission.request_admission import REFUSAL_SECONDS
from server.http.authorization import GuardedRoute
from server.security import api_keys
from server.security.authenticator import Authenticator, check_exposure
from server.security.operation_scopes import SCOPES
from server.security.principal import ANONYMOUS, UNRESTRICTED, Principal, Scope
from server.security.rate_limit import RateLimiter
from server.store.sqlite.database import Database
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.processes import Server

ALL = list(Scope)


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.fixture
def guarded(client: httpx.Client, settings: Settings, app: FastAPI) -> httpx.Client:
    """The service with a submap `p` in `plots`, and keys asked for from now on."""
    put_submap(client, "plots", "p", 1).raise_for_status()
    made, _ = api_keys.make(app.state.service.database, "owner", ALL, ["*"])
    client.headers.update(bearer(made))
    forgetful(app)
    return client


def forgetful(app: FastAPI) -> None:
    """The service looks up keys again."""
    app.state.authenticator = Authenticator(app.state.service.settings, app.state.service.database)


def test_an_address_that_is_refused_again_and_again_is_slowed_down(guarded: httpx.Client, app: FastAPI) -> None:
    """Its refusals are late; those who hold a key are not delayed, even at the same address."""
    app.state.shared.refusals = RateLimiter(1e-6)  # one refusal, and no other in this test
    seconds = []
    for headers, status in ((bearer("wrong"), 401), (bearer("wrong"), 401), ({}, 200)):
        began = time.monotonic()
        assert guarded.get("/v1/limits", headers=headers).status_code == status
        seconds.append(time.monotonic() - began)
    first, second, owner = seconds
    assert second >= REFUSAL_SECONDS
    assert max(first, owner) < second


# --------------------------------------------------------------- the ring


def test_a_key_is_told_once_and_only_its_hash_is_kept(database: Database) -> None:
    secret, info = api_keys.make(database, "robot", [Scope.WRITE, Scope.READ], ["plots-*"])
    assert api_keys.listed(database) == [info]
    assert (info.scopes, info.patterns, info.state(datetime.now(UTC))) == (("read", "write"), ("plots-*",), "usable")
    database.dispose()
    kept = database.path.read_bytes() + b"".join(p.read_bytes() for p in database.path.parent.glob("*.db-wal"))
    assert secret.rsplit("_", 1)[1].encode() not in kept
    assert info.id.encode() in kept


def test_who_asks(database: Database) -> None:
    settings = Settings(database=str(database.path))
    assert Authenticator(settings, database).authenticate(None) == UNRESTRICTED
    secret, info = api_keys.make(database, "robot", [Scope.READ], ["plots-*", "b?"])
    authenticator = Authenticator(settings, database)
    assert authenticator.from_cache(f"Bearer {secret}") is None
    caller = authenticator.authenticate(f"Bearer {secret}")
    assert (
        caller
        == authenticator.from_cache(f"bearer  {secret}")
        == Principal(info.id, frozenset({Scope.READ}), ("plots-*", "b?"))
    )
    assert [caller.sees(name) for name in ("plots-1", "plots", "b2", "b22", "Plots-1")] == [
        True,
        False,
        True,
        False,
        False,
    ]
    late, _ = api_keys.make(database, "late", ALL, ["*"], datetime.now(UTC) - timedelta(seconds=1))
    wrong = secret[:-1] + ("a" if secret[-1] != "a" else "b")
    for header in (None, "", "Bearer", "Bearer x", f"Basic {secret}", f"Bearer {wrong}", f"Bearer {late}"):
        with pytest.raises(Unauthorized):
            authenticator.authenticate(header)


def test_revoking_is_for_good_and_the_last_key_leaves_the_door_shut(database: Database) -> None:
    secret, info = api_keys.make(database, "robot", ALL, ["*"])
    settings = Settings(database=str(database.path))
    api_keys.revoke(database, info.id)
    with pytest.raises(Conflict, match="revoked"):
        api_keys.revoke(database, info.id)
    with pytest.raises(NotFound):
        api_keys.revoke(database, "nobody00")
    for header in (None, f"Bearer {secret}"):
        with pytest.raises(Unauthorized):
            Authenticator(settings, database).authenticate(header)


def test_what_is_remembered_gets_old(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    secret, info = api_keys.make(database, "robot", ALL, ["*"])
    authenticator = Authenticator(Settings(database=str(database.path)), database)
    authenticator.authenticate(f"Bearer {secret}")
    api_keys.revoke(database, info.id)
    assert authenticator.from_cache(f"Bearer {secret}") is not None
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + 1.1)
    assert authenticator.from_cache(f"Bearer {secret}") is None
    with pytest.raises(Unauthorized, match="revoked"):
        authenticator.authenticate(f"Bearer {secret}")


@pytest.mark.parametrize(("scopes", "patterns"), [([], ["*"]), (ALL, []), (ALL, [""]), (ALL, ["a/b"]), (ALL, ["[a]"])])
def test_keys_that_would_open_nothing_are_refused(database: Database, scopes: list[Scope], patterns: list[str]) -> None:
    with pytest.raises(InvalidField):
        api_keys.make(database, "robot", scopes, patterns)
    assert not api_keys.listed(database)


def test_other_machines_are_served_with_a_key_or_on_purpose_only(database: Database) -> None:
    path = str(database.path)
    for host in ("localhost", "127.0.0.2", "::1", "[::1]"):
        check_exposure(Settings(database=path, host=host), database)
    check_exposure(Settings(database=path, host="0.0.0.0", insecure=True), database)
    exposed = [Settings(database=path, host=host) for host in ("0.0.0.0", "forest.example", "::")]
    for settings in exposed:
        with pytest.raises(Conflict, match="keys create"):
            check_exposure(settings, database)
    _, info = api_keys.make(database, "robot", ALL, ["*"])
    for settings in exposed:
        check_exposure(settings, database)
        with pytest.raises(Unauthorized):
            Authenticator(settings, database).authenticate(None)
    api_keys.revoke(database, info.id)
    with pytest.raises(Conflict, match="keys create"):
        check_exposure(exposed[0], database)


# --------------------------------------------------------------- the door


def test_every_route_is_guarded_and_has_its_scope(app: FastAPI) -> None:
    routes = [route for router in app.state.routers for route in router.routes]
    assert routes
    assert {route.operation_id for route in routes if route.include_in_schema} == set(SCOPES)
    for route in routes:
        assert isinstance(route, APIRoute)
        assert isinstance(route, GuardedRoute) or not route.include_in_schema


def test_scopes(guarded: httpx.Client, app: FastAPI) -> None:
    made = {
        scope: bearer(api_keys.make(app.state.service.database, scope.value, [scope], ["plots"])[0]) for scope in Scope
    }
    body = {"xy": points(forest(2))}
    asked: list[tuple[Scope, str, str, Any]] = [
        (Scope.READ, "GET", "/v1/collections/plots", None),
        (Scope.READ, "POST", "/v1/collections/plots/queries", body),
        (Scope.WRITE, "PUT", "/v1/collections/plots/submaps/q", body),
        (Scope.WRITE, "DELETE", "/v1/collections/plots/submaps/q", None),
        (Scope.ADMIN, "PATCH", "/v1/collections/plots", {"title": "x"}),
        (Scope.ADMIN, "DELETE", "/v1/collections/plots", None),
    ]
    for scope, method, path, json in asked:
        for other in Scope:
            if other is not scope:
                refused = guarded.request(method, path, json=json, headers=made[other])
                assert refused.status_code == 403
                assert refused.json()["type"] == "/problems/forbidden"
        assert guarded.request(method, path, json=json, headers=made[scope]).is_success, (method, path)


def test_keeping_an_answer_is_a_write(guarded: httpx.Client, app: FastAPI) -> None:
    reader = bearer(api_keys.make(app.state.service.database, "reader", [Scope.READ], ["*"])[0])
    body = {"xy": points(forest(1)), "store": True}
    assert guarded.post("/v1/collections/plots/queries", json=body, headers=reader).status_code == 403
    assert guarded.post("/v1/collections/plots/queries", json=body).json()["id"] == "1"


def test_without_a_key_nothing_is_read_or_told(guarded: httpx.Client) -> None:
    for headers in ({"Authorization": ""}, bearer("urq_aaaaaaaa_" + "b" * 43), {"Authorization": "Basic eA=="}):
        answer = guarded.put(
            "/v1/collections/plots/submaps/q",
            content=b"not json",
            headers=headers | {"Content-Type": "application/json"},
        )
        assert answer.status_code == 401
        assert answer.headers["WWW-Authenticate"].startswith("Bearer")
        assert "plots" not in guarded.get("/", headers=headers).text
        for path in ("/livez", "/readyz", "/problems/gone", "/openapi.json", "/docs"):
            assert guarded.get(path, headers=headers).status_code in {200, 503}, path
        for path in ("/metrics", "/v1/limits", "/v1/collections"):
            assert guarded.get(path, headers=headers).status_code == 401, path
    assert "plots" in guarded.get("/").text


def test_lists_show_what_the_key_sees(guarded: httpx.Client, app: FastAPI) -> None:
    for i in range(7):
        guarded.put(f"/v1/collections/a{i}", json={}).raise_for_status()
        guarded.put(f"/v1/collections/b-{i}", json={}).raise_for_status()
    some = bearer(api_keys.make(app.state.service.database, "some", ALL, ["b-*", "a3"])[0])
    seen, cursor = [], None
    while True:
        parameters = {"limit": "3"} | ({"cursor": cursor} if cursor else {})
        page = guarded.get("/v1/collections", params=parameters, headers=some).raise_for_status().json()
        seen += [one["id"] for one in page["collections"]]
        if (cursor := page.get("next")) is None:
            break
    assert seen == ["b-0", "b-1", "b-2", "a3", "b-3", "b-4", "b-5", "b-6"]
    assert guarded.get("/metrics", headers=some).status_code == 403
    assert guarded.get("/metrics").status_code == 200
    assert guarded.put("/v1/collections/c", json={}, headers=some).status_code == 404
    assert guarded.put("/v1/collections/b-new", json={}, headers=some).status_code == 201


# ------------------------------------------------- what belongs to others


def operations(app: FastAPI) -> Iterator[tuple[str, str, str]]:
    """Method, path and operation id of every operation of the document."""
    for path, item in app.openapi()["paths"].items():
        for method, operation in item.items():
            yield method.upper(), path, operation["operationId"]


BODIES: dict[str, Any] = {
    "putStand": {},
    "patchStand": {"shift": [1.0, 0.0]},
    "postCoregistration": {},
    "putCollection": {},
    "patchCollection": {"title": "mine"},
    "postSubmap": {"xy": points(forest(3))},
    "putSubmap": {"xy": points(forest(3))},
    "patchSubmap": {"properties": {}},
    "postImport": {},
    "postReindex": {},
    "postConstraints": {},
    "postMap": {},
    "postMerge": {"from": "robot2", "to": "robot1"},
    "postOdometry": {
        "edges": [
            {"from": "p", "to": "q", "x": 1.0, "y": 0.0, "yaw": 0.0, "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 1e-4]}
        ]
    },
    "postPoses": {"poses": [{"id": "p", "map_pose": None}]},
    "queryBatch": {"queries": [{"xy": points(forest(1))}]},
    "query": {"xy": points(forest(1))},
}
OWN_RULES = {
    "getLandingPage",
    "getProblem",
    "getLiveness",
    "getReadiness",
    "getMetrics",
    "getLimits",
    "listCollections",
    "listJobs",
    "getJob",
    "getJobResults",
    "getJobErrors",
    "listJobFiles",
    "getJobFile",
    "deleteJob",
    "postSnapshot",
    "listSnapshots",
    "getSnapshot",
    "deleteSnapshot",
    "readStemMap",
    "getFeaturesLandingPage",
    "getConformance",
    "listFeatureCollections",
}
"""Operations without a collection in their path: each has a test of its own."""
PARTS = {
    "submap": "p",
    "stand": "s",
    "session": "s",
    "query": "1",
    "rank": "1",
    "map": "1",
    "merge": "1",
    "constraint": "1",
}
GIS = {"table": "landmarks", "kind": "landmarks", "feature": "p:0"}


def test_what_is_anothers_is_not_there(guarded: httpx.Client, app: FastAPI) -> None:
    ring = app.state.service.database
    foreign = bearer(api_keys.make(ring, "foreign", ALL, ["theirs-*"])[0])
    weak = bearer(api_keys.make(ring, "weak", [Scope.READ], ["theirs-*"])[0])
    guarded.post("/v1/collections/plots/queries", json={"xy": points(forest(1)), "store": True}).raise_for_status()
    before = guarded.get("/v1/collections/plots").json()
    walked = 0
    for method, path, operation in operations(app):
        if "{collection}" not in path:
            assert operation in OWN_RULES, f"{operation} names no collection: say in a test of its own what it shows"
            continue
        url = path.format(collection="plots", **PARTS, **GIS)
        body = {"json": BODIES[operation]} if method in {"PUT", "PATCH", "POST"} else {}
        there = guarded.request(method, url, headers=foreign, **body)
        not_there = guarded.request(method, url.replace("plots", "nothing"), headers=foreign, **body)
        assert there.status_code == not_there.status_code == 404, (method, url)
        assert _told(there) == _told(not_there), (method, url)
        if SCOPES[operation] is not Scope.READ:
            assert guarded.request(method, url, headers=weak, **body).status_code == 403, (method, url)
        nobody = guarded.request(method, url, headers={"Authorization": ""}, **body)
        assert nobody.status_code == 401, (method, url)
        assert "plots" not in nobody.text
        walked += 1
    assert walked >= 14
    assert guarded.get("/v1/collections/plots").json() == before


def _told(response: httpx.Response) -> tuple[Any, ...]:
    problem = response.json()
    problem.pop("request_id")
    problem["detail"] = problem["detail"].replace("plots", "nothing")
    headers = {name for name in response.headers if name not in {"x-request-id", "content-length"}}
    return problem, headers


def test_nobody_may_do_nothing() -> None:
    assert not ANONYMOUS.sees("plots")
    assert not ANONYMOUS.scopes
    assert not ANONYMOUS.sees_all


# ---------------------------------------------------------- real processes


def test_keys_are_made_and_revoked_while_two_processes_serve(serve: Callable[..., Server], tmp_path: Path) -> None:
    path = tmp_path / "shared.db"
    servers = [serve(path), serve(path)]
    for server in servers:
        assert server.client.put("/v1/collections/plots", json={}).is_success
    database = Database(path)
    secret, info = api_keys.make(database, "robot", ALL, ["plots"])
    for server in servers:
        _until(lambda server=server: server.client.get("/v1/collections").status_code == 401)  # type: ignore[misc]
        assert server.client.get("/v1/collections", headers=bearer(secret)).json()["collections"][0]["id"] == "plots"
    api_keys.revoke(database, info.id)
    database.dispose()
    for server in servers:
        _until(
            lambda server=server: server.client.get("/v1/collections", headers=bearer(secret)).status_code == 401  # type: ignore[misc]
        )
        assert server.client.get("/readyz").status_code == 200


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_an_exposed_service_without_a_key_does_not_start(tmp_path: Path) -> None:
    app = create_app(Settings(database=str(tmp_path / "new.db"), host="0.0.0.0"))
    with pytest.raises(Conflict, match="keys create"), TestClient(app):
        pass
