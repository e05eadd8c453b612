"""Sessions of the console: what a cookie opens, for how long, and for whom it does not."""

import re
import stat
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.config.settings import Settings
from server.errors import StorageError, Unauthorized
from server.security import api_keys
from server.security.console_sessions import HOURS, ConsoleSessions
from server.security.principal import Scope
from server.service_parts import Service
from tests.server.factories import TestClient

CONSOLE = {"Urquhart-Console": "1"}


@pytest.fixture
def key(client: httpx.Client, service: Service, app: FastAPI) -> str:
    """A key that reads all collections; from now on the service asks for one."""
    made, _ = api_keys.make(service.database, "reader", [Scope.READ], ["*"])
    app.state.authenticator._asks_for_keys = None
    return made


def sign_in(client: httpx.Client, key: str) -> httpx.Response:
    return client.post("/ui/session", json={"key": key}, headers=CONSOLE)


def test_a_session_opens_what_its_key_opens(client: httpx.Client, key: str) -> None:
    assert client.get("/v1/collections").status_code == 401
    answer = sign_in(client, f"  {key}\n")
    assert answer.status_code == 204
    assert client.get("/v1/collections").json()["collections"][0]["id"] == "plots"
    assert client.put("/v1/collections/other", json={}, headers=CONSOLE).status_code == 403
    told = client.get("/ui/session").json()
    assert (told["needs_key"], told["signed_in"], told["scopes"], told["patterns"]) == (True, True, ["read"], ["*"])
    assert told["key"] == key.split("_")[1]
    assert client.delete("/ui/session", headers=CONSOLE).status_code == 204
    assert client.get("/v1/collections").status_code == 401
    assert client.get("/ui/session").json()["signed_in"] is False


def test_the_cookie_is_for_this_host_and_not_for_scripts(client: httpx.Client, key: str) -> None:
    cookie = sign_in(client, key).headers["Set-Cookie"]
    assert re.fullmatch(
        r"urquhart_session=\w{8}\.\d{10}\.[0-9a-f]{64}; Path=/; Max-Age=\d+; HttpOnly; SameSite=Strict", cookie
    )
    assert key not in cookie
    assert 3600 * HOURS - 60 <= int(re.findall(r"Max-Age=(\d+)", cookie)[0]) <= 3600 * HOURS


def test_over_tls_the_cookie_is_secure(app: FastAPI, key: str) -> None:
    with TestClient(app, base_url="https://forest.example") as client:
        cookie = sign_in(client, key).headers["Set-Cookie"]
        assert cookie.startswith("__Host-urquhart_session=")
        assert cookie.endswith("; SameSite=Strict; Secure")
        assert client.get("/v1/collections").status_code == 200


def test_a_page_of_another_origin_changes_nothing(client: httpx.Client, app: FastAPI, service: Service) -> None:
    made, _ = api_keys.make(service.database, "all", list(Scope), ["*"])
    app.state.authenticator._asks_for_keys = None
    assert sign_in(client, made).status_code == 204
    # A form, or a request that needs no permission, has no header of its own.
    assert client.delete("/v1/collections/plots").status_code == 401
    assert client.post("/v1/collections/plots/queries", json={"xy": []}).status_code == 401
    for site in ("cross-site", "same-site"):
        assert client.get("/v1/collections", headers={"Sec-Fetch-Site": site}).status_code == 401
        headers = {"Sec-Fetch-Site": site, **CONSOLE}
        assert client.delete("/v1/collections/plots", headers=headers).status_code == 401
    assert client.get("/v1/collections", headers={"Sec-Fetch-Site": "same-origin"}).status_code == 200
    assert client.delete("/v1/collections/plots", headers=CONSOLE).status_code == 204


def test_nobody_is_signed_in_or_out_by_another_page(client: httpx.Client, key: str) -> None:
    for method in ("POST", "DELETE"):
        answer = client.request(method, "/ui/session", json={"key": key})
        assert answer.status_code == 403
        assert "Set-Cookie" not in answer.headers


@pytest.mark.parametrize("given", ["", "urq_no", "urq_aaaaaaaa_" + "b" * 43])
def test_a_wrong_key_begins_no_session(client: httpx.Client, key: str, given: str) -> None:
    answer = sign_in(client, given)
    assert answer.status_code == 401
    assert answer.json()["type"] == "/problems/unauthorized"
    assert "Set-Cookie" not in answer.headers


def test_a_session_ends(client: httpx.Client, app: FastAPI, key: str, service: Service) -> None:
    sessions = app.state.authenticator._sessions
    row = api_keys.listed(service.database)[0]
    token, _ = sessions.issue(row.id, row.digest, hours=-0.001)
    client.cookies.set("urquhart_session", token)
    assert client.get("/v1/collections").status_code == 401
    told = client.get("/ui/session").json()
    assert told["signed_in"] is False
    assert "ended" in told["refusal"]


def test_a_revoked_key_ends_its_sessions(client: httpx.Client, app: FastAPI, key: str, service: Service) -> None:
    assert sign_in(client, key).status_code == 204
    api_keys.revoke(service.database, key.split("_")[1])
    app.state.authenticator._known.clear()
    assert client.get("/v1/collections").status_code == 401


def test_a_token_with_anything_changed_is_none(client: httpx.Client, app: FastAPI, key: str) -> None:
    assert sign_in(client, key).status_code == 204
    token = client.cookies["urquhart_session"]
    name, ends, seal = token.split(".")
    client.cookies.clear()
    for forged in (
        f"{name}.{int(ends) + 1}.{seal}",
        f"{name[:-1]}{'a' if name[-1] != 'a' else 'b'}.{ends}.{seal}",
        f"{name}.{ends}.{'0' * 64}",
        f"{name}.{ends}",
        token + "0",
    ):
        headers = {"Cookie": f"urquhart_session={forged}"}
        assert client.get("/v1/collections", headers=headers).status_code == 401
    # Only the cookie holds a session: there is no header for it.
    assert client.get("/v1/collections", headers={"Authorization": f"Session {token}"}).status_code == 401
    assert client.get("/v1/collections", headers={"Authorization": token}).status_code == 401


def test_a_service_without_keys_needs_no_session(client: httpx.Client) -> None:
    told = client.get("/ui/session").json()
    assert (told["needs_key"], told["signed_in"], told["scopes"]) == (False, True, ["admin", "read", "write"])
    # A cookie that is left from before is not in the way.
    client.cookies.set("urquhart_session", "anything")
    assert client.get("/v1/collections").status_code == 200
    assert client.get("/ui/session").json()["signed_in"] is True
    assert sign_in(client, "urq_x").status_code == 401


def test_processes_and_restarts_share_sessions_and_copies_of_the_database_do_not(tmp_path: Path) -> None:
    digest = b"d" * 32
    token, ends = ConsoleSessions(tmp_path / "a.db", clock=lambda: 1e9).issue("abcd1234", digest)
    other = ConsoleSessions(tmp_path / "a.db", clock=lambda: 1e9 + 3600 * HOURS - 1)
    assert other.is_sealed(other.read(token), digest)
    assert not other.is_sealed(other.read(token), b"e" * 32)
    copied = ConsoleSessions(tmp_path / "copy.db", clock=lambda: 1e9)
    assert not copied.is_sealed(copied.read(token), digest)
    assert ends == 1e9 + 3600 * HOURS
    with pytest.raises(Unauthorized, match="ended"):
        ConsoleSessions(tmp_path / "a.db", clock=lambda: float(ends)).read(token)


def test_the_secret_is_private_and_never_half_written(tmp_path: Path) -> None:
    secret = tmp_path / "a.db.session-secret"
    secret.write_bytes(b"half")
    token, _ = ConsoleSessions(tmp_path / "a.db").issue("abcd1234", b"d" * 32)
    sessions = ConsoleSessions(tmp_path / "a.db")
    assert sessions.is_sealed(sessions.read(token), b"d" * 32)
    assert len(secret.read_bytes()) == 32
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    assert [path.name for path in tmp_path.iterdir()] == [secret.name]


def test_a_folder_that_cannot_be_written_begins_no_session(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="session-secret"):
        ConsoleSessions(tmp_path / "missing" / "a.db").issue("abcd1234", b"d" * 32)


def test_no_session_opens_a_service_that_others_can_reach(tmp_path: Path) -> None:
    database = tmp_path / "a.db"
    with TestClient(create_app(Settings(database=str(database)))) as client:
        made, _ = api_keys.make(client.app.state.service.database, "r", [Scope.READ], ["plots-*"])  # type: ignore[attr-defined]
    with TestClient(create_app(Settings(database=str(database), host="0.0.0.0"))) as client:
        assert client.get("/ui").status_code == 200
        assert client.get("/v1/collections").status_code == 401
        assert sign_in(client, made).status_code == 204
        assert client.get("/v1/collections").json() == {"collections": []}
        assert client.get("/v1/collections/other").status_code == 404


def test_keys_are_listed_for_who_sees_all_without_their_secrets(client: httpx.Client, app: FastAPI, key: str) -> None:
    database = app.state.service.database
    operator, _ = api_keys.make(database, "operator", [Scope.ADMIN], ["*"])
    tenant, _ = api_keys.make(database, "tenant", list(Scope), ["plots*"])
    listed = client.get("/ui/keys", headers={"Authorization": f"Bearer {operator}"})
    assert [one["name"] for one in listed.json()["keys"]] == ["reader", "operator", "tenant"]
    assert not [secret for secret in (key, operator, tenant) if secret.split("_")[2] in listed.text]
    for other in (key, tenant):
        assert client.get("/ui/keys", headers={"Authorization": f"Bearer {other}"}).status_code == 403
    assert client.get("/ui/keys").status_code == 401
