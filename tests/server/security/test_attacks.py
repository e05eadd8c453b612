"""Whoever holds a key, or none, and wants more than it allows: over real HTTP, with what no decent client sends."""

import base64
import hmac
import json
import os
import socket
import stat
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import update

from server.app import create_app
from server.commands.support.database import open_database
from server.config.settings import Limits, Settings
from server.errors import InvalidField, Unauthorized
from server.security import api_keys, authenticator
from server.security.principal import Principal, Scope
from server.service_parts import Service
from server.snapshots import restoring
from server.store.service_tables import KeyRow
from server.store.sqlite.database import Database
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.served import Served, Threaded, read_all, wait_until

A, B = "/v1/collections/a-1", "/v1/collections/b"
HIDDEN = "hidden"
"""Stands in whatever is in `b`: its title, its submap, its session, its snapshot. Nobody of `a-*` may ever read it."""
TREES = {"a": points(forest(1)), "b": points(forest(9))}
JSON = "Content-Type: application/json\r\n"
NDJSON = {"Content-Type": "application/x-ndjson"}
SCOPES: dict[str, tuple[list[Scope], list[str]]] = {
    "reader": ([Scope.READ], ["a-*"]),
    "writer": ([Scope.WRITE], ["a-*"]),
    "both": ([Scope.READ, Scope.WRITE], ["a-*"]),
    "tenant": (list(Scope), ["b"]),
    "owner": (list(Scope), ["*"]),
    "turning": (list(Scope), ["a-*"]),
    "leaving": (list(Scope), ["a-*"]),
    "revoked": (list(Scope), ["*"]),
}


@dataclass
class Tenants:
    """A service with tenants: `a-1` and `a-2` are of some keys, `b` is of another, all of it is the owner's."""

    served: Served
    database: Database
    secrets: dict[str, str]
    job_of_b: str = ""
    cursors: dict[str, str] = field(default_factory=dict)

    def bearer(self, who: str) -> dict[str, str]:
        """The header that says who."""
        return {"Authorization": f"Bearer {self.secrets[who]}"} if who else {}

    def ask(self, who: str, method: str, path: str, **more: Any) -> httpx.Response:
        """A request by the holder of a key, or by nobody."""
        headers = self.bearer(who) | more.pop("headers", {})
        return self.served.client.request(method, path, headers=headers, **more)

    def raw(self, head: str, body: str | bytes = b"") -> bytes:
        """What a connection says to these bytes until it is closed; the head without its last empty line."""
        content = body.encode() if isinstance(body, str) else body
        with socket.create_connection(("127.0.0.1", self.served.port), timeout=60.0) as connection:
            connection.sendall(head.encode("latin-1") + b"\r\n" + content)
            return read_all(connection)

    def get(self, target: str, authorization: str, method: str = "GET", more: str = "") -> tuple[int, str]:
        """Status and all of the answer to a request for exactly this target, with exactly this header."""
        answer = self.raw(
            f"{method} {target} HTTP/1.1\r\nHost: localhost\r\n{authorization}{more}Connection: close\r\n"
        )
        return int(answer.split(b" ", 2)[1]), answer.decode("utf-8", "replace")

    def line(self, who: str) -> str:
        """The header as it is sent."""
        return f"Authorization: Bearer {self.secrets[who]}\r\n"

    def finished(self, who: str, job: dict[str, Any]) -> dict[str, Any]:
        """A job at its end."""
        told: dict[str, Any] = self.ask(who, "GET", f"/v1/jobs/{job['id']}?wait=60").raise_for_status().json()
        assert told["state"] == "successful"
        return told


@pytest.fixture(scope="module")
def tenants(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tenants]:
    folder = tmp_path_factory.mktemp("tenants")
    database = open_database(Settings(database=str(folder / "urquhart.db")))
    made = {name: api_keys.make(database, name, scopes, patterns) for name, (scopes, patterns) in SCOPES.items()}
    late, _ = api_keys.make(database, "late", list(Scope), ["*"], datetime.now(UTC) - timedelta(seconds=1))
    api_keys.revoke(database, made["revoked"][1].id)
    secrets = {name: secret for name, (secret, _) in made.items()} | {"late": late}
    served = Served(folder, URQUHART_LOG__LEVEL="debug")
    tenants = Tenants(served, database, secrets)
    try:
        _fill(tenants)
        yield tenants
        # Of all that was tried meanwhile.
        assert not [name for name, secret in secrets.items() if secret.split("_")[2] in served.log.read_text()]
        log = served.log.read_text()
        assert "Traceback" not in log, log[log.index("Traceback") - 2_000 :]
    finally:
        served.close()
        database.dispose()


def _fill(tenants: Tenants) -> None:
    for path, title in ((A, "a"), ("/v1/collections/a-2", "a"), (B, f"{HIDDEN} title")):
        tenants.ask("owner", "PUT", path, json={"title": title}).raise_for_status()
    for path, name, session, trees in ((A, "p", "monday", "a"), (B, HIDDEN, f"{HIDDEN}-session", "b")):
        for number in (1, 2):
            body = {"xy": TREES[trees], "session": f"{session}-{number}"}
            tenants.ask("owner", "PUT", f"{path}/submaps/{name}-{number}", json=body).raise_for_status()
    for path, trees, times in ((A, "a", 1), (B, "b", 3)):
        for _ in range(times):
            kept = {"xy": TREES[trees], "store": True}
            tenants.ask("owner", "POST", f"{path}/queries", json=kept).raise_for_status()
    tenants.ask("owner", "POST", "/v1/snapshots", json={"name": f"{HIDDEN}-snapshot"}).raise_for_status()
    for path in (A, B):
        for _ in range(2):
            job = tenants.ask("owner", "POST", f"{path}/constraints", json={}).raise_for_status().json()
            tenants.finished("owner", job)
    tenants.job_of_b = job["id"]
    for listing in ("/v1/collections", f"{B}/submaps", f"{B}/sessions", "/v1/jobs"):
        page = tenants.ask("owner", "GET", f"{listing}?limit=1").raise_for_status().json()
        tenants.cursors[listing] = page["next"]


def same(there: httpx.Response, made_up: httpx.Response, name: str, other: str) -> bool:
    """Whether two answers differ in nothing but the name that was asked for."""

    def told(response: httpx.Response) -> tuple[Any, ...]:
        lengths = {"content-length", "x-request-id", "date"}
        headers = {key: value for key, value in response.headers.items() if key not in lengths}
        request_id = response.headers["X-Request-Id"]
        return response.status_code, headers, response.text.replace(request_id, "").replace(name, other)

    return told(there) == told(made_up)


# --------------------------------------------------------------------- paths

TARGETS = [
    "/v1/collections/a-1/../b/submaps",
    "/v1/collections/a-1/%2e%2e/b/submaps",
    "/v1/collections/a-1/%2E./b/submaps",
    "/v1/collections/a-1%2F..%2Fb/submaps",
    "/v1/collections/a-1%252F..%252Fb/submaps",
    "/v1/collections/a-1%5C..%5Cb/submaps",
    "/v1/collections/a-1\\..\\b/submaps",
    "/v1/collections//b/submaps",
    "/v1//collections/b/submaps",
    "//v1/collections/b/submaps",
    "/v1/collections/./b/submaps",
    "/v1/collections/b/./submaps",
    "/v1/collections/b/submaps/",
    "/v1/collections/b/submaps/.",
    "/v1/collections/b;a-1/submaps",
    "/v1/collections/a-1;/../b/submaps",
    "/v1/collections/b/submaps;x=1",
    "/v1/collections/b%00/submaps",
    "/v1/collections/a-1%00/../b/submaps",
    "/v1/collections/b%20/submaps",
    "/v1/collections/b%0d%0a/submaps",
    "/v1/collections/B/submaps",
    "/V1/collections/b/submaps",
    "/v1/collections/%EF%BD%82/submaps",
    "/v1/collections/b%CC%81/submaps",
    "/v1/collections/%C1%A2/submaps",
    "/v1/collections/%e2%80%8bb/submaps",
    "/v1/collections/*/submaps",
    "/v1/collections/%3F/submaps",
    "/v1/collections/[b]/submaps",
    "http://x/v1/collections/b/submaps",
    "x/v1/collections/b/submaps",
    "*",
    "/docs/assets/../../v1/collections/b/submaps",
    "/docs/assets/..%2f..%2f..%2fserved.log",
    "/v1/snapshots/..%2furquhart",
    "/problems/..%2fv1%2fcollections%2fb",
    "/v1/collections/a-1/submaps?collection=b",
    "/v1/collections/a-1/queries/..%2f..%2fb%2fqueries%2f1",
]


@pytest.mark.parametrize("target", TARGETS)
def test_only_one_path_leads_to_a_collection(tenants: Tenants, target: str) -> None:
    # Nor for who may see it: where a proxy has rules for paths, they must mean what the service means.
    for who in ("reader", "owner"):
        status, answer = tenants.get(target, tenants.line(who))
        assert status in {400, 404, 405, 422}, answer
        assert HIDDEN not in answer


@pytest.mark.parametrize("target", [f"{B}/submaps", "/v1/collections/%62/submaps", "/v1/collections%2fb%2fsubmaps"])
def test_what_is_let_in_is_what_is_read(tenants: Tenants, target: str) -> None:
    assert tenants.get(target, tenants.line("owner"))[0] == 200
    for who, expected in (("reader", 404), ("writer", 403), ("tenant", 200)):
        status, answer = tenants.get(target, tenants.line(who))
        assert (status, HIDDEN in answer) == (expected, expected == 200)


@pytest.mark.parametrize("name", ["B", "%EF%BD%82", "b%00", "b.", "b-", "b%2Fsubmaps", "b%CC%81", "%2A", "b%3F", "a-1"])
def test_a_pattern_makes_nothing_beside_itself(tenants: Tenants, name: str) -> None:
    before = tenants.ask("owner", "GET", "/v1/collections").json()["collections"]
    head = (
        f"PUT /v1/collections/{name} HTTP/1.1\r\nHost: localhost\r\n{tenants.line('tenant')}{JSON}Content-Length: 2\r\n"
    )
    status = int(tenants.raw(f"{head}Connection: close\r\n", "{}").split(b" ", 2)[1])
    assert status in {404, 405}
    assert tenants.ask("owner", "GET", "/v1/collections").json()["collections"] == before


def test_lists_and_the_door_read_patterns_alike(database: Database) -> None:
    ids = ["a", "A", "a-1", "a.1", "ab", "b", "ba", "a~", "é", "éa", "日本", "a" * 128, "_", "-", "a日", "~"]
    with database.write() as tx:
        for name in ids:
            tx.collections.create(name, title=None, config={}, fingerprint="", crs=None, origin=None)
    patterns = ["*", "?", "a*", "*a", "a?", "??", "a-*", "a.*", "?*", "*?*?", "_", "é*", "日?", "A*", "a*" * 30]
    for pattern in patterns:
        api_keys.make(database, "one", [Scope.READ], [pattern])
        caller = Principal("", frozenset(), (pattern,))
        with database.read() as tx:
            listed = [row.id for row in tx.collections.page([pattern], limit=100)]
        assert listed == [name for name in ids if caller.sees(name)], pattern
    for pattern in ("[ab]", "[!a]", "a/b", "%", "a b", "", "a\n", "a\0", "{a,b}", "(a)", "a|b", "a\\*", "a" * 129):
        with pytest.raises(InvalidField):
            api_keys.make(database, "one", [Scope.READ], [pattern])


# ------------------------------------------------------------------ the header


def _forms(tenants: Tenants) -> dict[str, str]:
    own, other = tenants.secrets["owner"], tenants.secrets["reader"]
    own_id, own_secret = own.split("_")[1:]
    basic = base64.b64encode(f"{own_id}:{own}".encode()).decode()
    return {
        "nothing": "",
        "empty": "Authorization:\r\n",
        "scheme only": "Authorization: Bearer\r\n",
        "no scheme": f"Authorization: {own}\r\n",
        "basic": f"Authorization: Basic {basic}\r\n",
        "basic, plain": f"Authorization: Basic {own}\r\n",
        "token": f"Authorization: Token {own}\r\n",
        "digest": f'Authorization: Digest username="{own}"\r\n',
        "tab": f"Authorization: Bearer\t{own}\r\n",
        "no space": f"Authorization: Bearer{own}\r\n",
        "twice in one": f"Authorization: Bearer {own}, Bearer {own}\r\n",
        "list": f"Authorization: Bearer {own},\r\n",
        "parameter": f"Authorization: Bearer {own};a=b\r\n",
        "quoted": f'Authorization: Bearer "{own}"\r\n',
        "scheme twice": f"Authorization: Bearer Bearer {own}\r\n",
        "cut": f"Authorization: Bearer {own[:-1]}\r\n",
        "one more": f"Authorization: Bearer {own}a\r\n",
        "one other": f"Authorization: Bearer {own[:-1]}{'a' if own[-1] != 'a' else 'b'}\r\n",
        "no secret": f"Authorization: Bearer urq_{own_id}_\r\n",
        "id only": f"Authorization: Bearer {own_id}\r\n",
        "secret only": f"Authorization: Bearer {own_secret}\r\n",
        "another's secret": f"Authorization: Bearer urq_{own_id}_{other.split('_')[2]}\r\n",
        "another's id": f"Authorization: Bearer urq_{other.split('_')[1]}_{own_secret}\r\n",
        "lower case": f"Authorization: Bearer {own.lower()}\r\n",
        "upper case": f"Authorization: Bearer {own.upper()}\r\n",
        "pattern": f"Authorization: Bearer urq_{'?' * 8}_{'*' * 43}\r\n",
        "sql": f"Authorization: Bearer urq_{own_id}_' OR '1'='1\r\n",
        "long": f"Authorization: Bearer urq_{own_id}_{'a' * 50_000}\r\n",
        "not ascii": f"Authorization: Bearer {own[:-1]}\xe9\r\n",
        "wide digits": f"Authorization: Bearer urq_{'１' * 8}_{own_secret}\r\n".encode().decode("latin-1"),
        "doubled, first good": f"{tenants.line('owner')}Authorization: Bearer x\r\n",
        "doubled, last good": f"Authorization: Bearer x\r\n{tenants.line('owner')}",
        "doubled, both good": f"{tenants.line('owner')}{tenants.line('reader')}",
        "doubled, same": tenants.line("owner") * 2,
        "folded": f"Authorization: Bearer x\r\n {own}\r\n",
        "folded from another": f"X-Other: x\r\n {tenants.line('owner')}",
        "proxy": f"Proxy-Authorization: Bearer {own}\r\n",
        "x-api-key": f"X-API-Key: {own}\r\nX-Authorization: Bearer {own}\r\n",
        "x-forwarded": f"X-Forwarded-Authorization: Bearer {own}\r\nX-Remote-User: {own_id}\r\n",
        "cookie": f"Cookie: key={own}; Authorization=Bearer {own}\r\n",
        "expired": f"Authorization: Bearer {tenants.secrets['late']}\r\n",
        "revoked": f"Authorization: Bearer {tenants.secrets['revoked']}\r\n",
    }


def test_no_other_header_opens(tenants: Tenants) -> None:
    assert tenants.get("/v1/collections", tenants.line("owner"))[0] == 200
    for name, header in _forms(tenants).items():
        status, answer = tenants.get("/v1/collections", header)
        assert status == 401, name
        assert "\r\nwww-authenticate: bearer" in answer.lower(), name
        assert "a-1" not in answer, name
    assert "is expired" in tenants.get("/v1/collections", _forms(tenants)["expired"])[1]
    assert "is revoked" in tenants.get("/v1/collections", _forms(tenants)["revoked"])[1]


@pytest.mark.parametrize("bad", ["\0", "\x0b", "\r", "\x7f"])
def test_what_is_no_header_is_no_request(tenants: Tenants, bad: str) -> None:
    status, _ = tenants.get("/v1/collections", f"Authorization: Bearer {bad}{tenants.secrets['owner']}\r\n")
    assert status in {400, 401}


@pytest.mark.parametrize("name", ["key", "api_key", "access_token", "authorization", "token", "Authorization"])
def test_a_key_in_the_address_is_none(tenants: Tenants, name: str) -> None:
    for value in (tenants.secrets["owner"], f"Bearer%20{tenants.secrets['owner']}"):
        assert tenants.get(f"/v1/collections?{name}={value}", "")[0] == 401
        assert HIDDEN not in tenants.get(f"/?{name}={value}", "")[1]


def test_the_refusal_does_not_tell_whether_there_is_such_a_key(tenants: Tenants) -> None:
    known = tenants.secrets["owner"].split("_")[1]
    there, made_up = (
        tenants.ask("", "GET", "/v1/limits", headers={"Authorization": f"Bearer urq_{key_id}_{'a' * 43}"})
        for key_id in (known, "zzzzzzzz")
    )
    assert there.status_code == 401
    assert same(there, made_up, known, "zzzzzzzz")
    # Only who holds the secret is told what became of it.
    for gone in ("late", "revoked"):
        key_id = tenants.secrets[gone].split("_")[1]
        forged = {"Authorization": f"Bearer urq_{key_id}_{'a' * 43}"}
        assert same(tenants.ask("", "GET", "/v1/limits", headers=forged), made_up, key_id, "zzzzzzzz")


# ---------------------------------------------------------------- methods


def test_methods_are_what_they_say(tenants: Tenants) -> None:
    overrides = ["X-HTTP-Method-Override", "X-HTTP-Method", "X-Method-Override", "X-Original-Method"]
    for who in ("reader", "both"):
        for name in overrides:
            more = f"{name}: DELETE\r\nX-Original-URL: {B}\r\nX-Rewrite-URL: {B}\r\n"
            status, answer = tenants.get(f"{A}/submaps/p-1", tenants.line(who), more=more)
            assert (status, '"id":"p-1"' in answer, HIDDEN in answer) == (200, True, False)
        assert tenants.get(f"{A}/submaps/p-1?_method=DELETE", tenants.line(who))[0] == 422
    for method in ("delete", "DELETE\t", "TRACE", "CONNECT", "PROPFIND", "G%45T", "MOVE"):
        assert tenants.get(f"{A}/submaps/p-1", tenants.line("both"), method)[0] in {400, 405}, method
    assert tenants.ask("reader", "GET", f"{A}/submaps/p-1").status_code == 200


def test_head_and_options_tell_no_more_than_get(tenants: Tenants) -> None:
    for path in (B, f"{B}/submaps", f"{B}/submaps/{HIDDEN}-1", f"{B}/queries/1"):
        made_up = path.replace("/b", "/c", 1).replace(HIDDEN, "nobody") if HIDDEN in path else path.replace("/b", "/c")
        for method in ("HEAD", "OPTIONS"):
            for who in ("reader", ""):
                there, nothing = (tenants.ask(who, method, at) for at in (path, made_up))
                assert there.status_code == {"OPTIONS": 204}.get(method, 404 if who else 401), path
                assert not there.content
                assert same(there, nothing, "", "")
    assert tenants.ask("owner", "HEAD", B).headers["ETag"]
    assert "ETag" not in tenants.ask("reader", "HEAD", B).headers


# ---------------------------------------------------------------- framing

BODY = json.dumps({"xy": [[1, 2], [30, 4], [5, 60]]})
CHUNKED = f"{len(BODY):x}\r\n{BODY}\r\n0\r\n\r\n"
FRAMES = [
    ("Content-Length: 4\r\nTransfer-Encoding: chunked\r\n", CHUNKED),
    ("Transfer-Encoding: chunked\r\nContent-Length: 4\r\n", CHUNKED),
    (f"Content-Length: {len(CHUNKED)}\r\nTransfer-Encoding: chunked\r\n", CHUNKED),
    ("Content-Length: 0\r\nTransfer-Encoding: chunked\r\n", CHUNKED),
    (f"Content-Length: {len(BODY)}\r\nContent-Length: 0\r\n", BODY),
    (f"Content-Length: 0\r\nContent-Length: {len(BODY)}\r\n", BODY),
    (f"Content-Length: {len(BODY)}, 0\r\n", BODY),
    (f"Content-Length: +{len(BODY)}\r\n", BODY),
    (f"Content-Length: -{len(BODY)}\r\n", BODY),
    (f"Content-Length: 0x{len(BODY):x}\r\n", BODY),
    (f"Content-Length: {'9' * 30}\r\n", BODY),
    (f"Content-Length : {len(BODY)}\r\n", BODY),
    (f"Content-Length: {len(BODY)}\r\nTransfer-Encoding: identity\r\n", BODY),
    ("Transfer-Encoding: gzip, chunked\r\n", CHUNKED),
    ("Transfer-Encoding: chunked, identity\r\n", CHUNKED),
    ("Transfer-Encoding: xchunked\r\n", CHUNKED),
    ("Transfer-Encoding: \x0bchunked\r\n", CHUNKED),
    ("Transfer-Encoding : chunked\r\n", CHUNKED),
    ("Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n", CHUNKED),
    ("Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n", CHUNKED),
    ("X: y\rTransfer-Encoding: chunked\r\n", CHUNKED),
    ("Transfer-Encoding: chunked\r\n", f"zz\r\n{CHUNKED}"),
    ("Transfer-Encoding: chunked\r\n", f"-{CHUNKED}"),
    ("Transfer-Encoding: chunked\r\n", f"0x{CHUNKED}"),
    ("Transfer-Encoding: chunked\r\n", f"{'f' * 40}{CHUNKED}"),
    ("Transfer-Encoding: chunked\r\n", f"{len(BODY):x}\r\n{BODY}XX0\r\n\r\n"),
    ("Transfer-Encoding: chunked\r\n", CHUNKED.replace("\r\n", "\n")),
    ("Transfer-Encoding: chunked\r\n", CHUNKED.replace("\r\n", ";a\nb\r\n", 1)),
    ("Transfer-Encoding: chunked\r\n", CHUNKED.replace("\r\n", "\r", 1)),
]


@pytest.mark.parametrize(("headers", "body"), FRAMES, ids=range(len(FRAMES)))
def test_where_a_body_ends_is_not_for_two_to_argue_about(tenants: Tenants, headers: str, body: str) -> None:
    """What a proxy takes for the rest of a body must not be the next request to us, nor the other way round."""
    smuggled = f"{A}/submaps/smuggled-{FRAMES.index((headers, body))}"
    inner = (
        f"PUT {smuggled} HTTP/1.1\r\nHost: localhost\r\n{tenants.line('owner')}{JSON}"
        f"Content-Length: {len(BODY)}\r\nConnection: close\r\n\r\n{BODY}"
    )
    head = f"POST {A}/queries HTTP/1.1\r\nHost: localhost\r\n{tenants.line('reader')}{JSON}{headers}"
    answer = tenants.raw(head, body + inner)
    assert answer.startswith(b"HTTP/1.1 400 "), answer
    assert answer.count(b"HTTP/1.1 ") == 1
    assert tenants.ask("owner", "GET", smuggled).status_code == 404


@pytest.mark.parametrize(
    "head",
    [
        "GET /v1/\x01 HTTP/1.1\r\nHost: localhost\r\n",
        "GET /livez HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n",
        "GET /livez HTTP/1.1\r\n",
        "POST /v1/collections/a/queries HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nno size\r\n",
        "\x16\x03\x01 not HTTP\r\n",
    ],
)
def test_answers_to_what_is_no_http_are_as_safe_as_all_others(tenants: Tenants, head: str) -> None:
    told, _, body = tenants.raw(head).partition(b"\r\n\r\n")
    status, *lines = told.decode().split("\r\n")
    headers = dict(line.lower().split(": ", 1) for line in lines)
    assert status.startswith("HTTP/1.1 400 ")
    usual = tenants.ask("", "GET", "/livez").headers
    for name in ("content-security-policy", "x-content-type-options", "x-frame-options", "referrer-policy"):
        assert headers[name] == usual[name].lower()
    assert headers["content-type"] == "application/problem+json"
    assert json.loads(body)["request_id"] == headers["x-request-id"]


def test_the_same_requests_are_two_where_there_is_nothing_to_argue_about(tenants: Tenants) -> None:
    last = f"GET {A} HTTP/1.1\r\nHost: localhost\r\n{tenants.line('reader')}Connection: close\r\n\r\n"
    for headers, body in (
        (f"Content-Length: {len(BODY)}\r\n", BODY),
        ("Transfer-Encoding: chunked\r\n", CHUNKED),
    ):
        head = f"POST {A}/queries HTTP/1.1\r\nHost: localhost\r\n{tenants.line('reader')}{JSON}{headers}"
        assert tenants.raw(head, body + last).count(b"HTTP/1.1 200 ") == 2


def test_the_second_request_of_a_connection_has_its_own_key(tenants: Tenants) -> None:
    first = f"GET {B} HTTP/1.1\r\nHost: localhost\r\n{tenants.line('owner')}"
    for second, status in (("", b"401"), (tenants.line("reader"), b"404"), (tenants.line("tenant"), b"200")):
        answer = tenants.raw(first, f"GET {B} HTTP/1.1\r\nHost: localhost\r\n{second}Connection: close\r\n\r\n")
        _, one, two = answer.split(b"HTTP/1.1 ")
        assert (one[:3], two[:3]) == (b"200", status)


def test_a_key_behind_the_body_is_none(tenants: Tenants) -> None:
    trailed = CHUNKED.removesuffix("\r\n") + tenants.line("owner") + "\r\n"
    for header, status in (("", b"401"), (tenants.line("reader"), b"404")):
        head = f"POST {B}/queries HTTP/1.1\r\nHost: localhost\r\n{header}{JSON}Connection: close\r\n"
        assert tenants.raw(f"{head}Transfer-Encoding: chunked\r\n", trailed)[9:12] == status


# ------------------------------------------------------------------- hosts


HOSTS = ["evil.example", "evil.example/?a=b#", 'evil.example"><script>', "[::1", "evil.example:99999", "a@evil.example"]


@pytest.mark.parametrize("host", HOSTS)
def test_links_do_not_follow_the_host(tenants: Tenants, host: str) -> None:
    more = f"X-Forwarded-Host: {host}\r\nForwarded: host=evil.example\r\nX-Forwarded-Prefix: //evil.example\r\n"

    def ask(method: str, path: str, body: str = "", accept: str = "*/*") -> str:
        head = f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n{tenants.line('owner')}{more}Connection: close\r\n"
        head += f"Accept: {accept}\r\n" + (f"{JSON}Content-Length: {len(body)}\r\n" if body else "")
        return tenants.raw(head, body).decode()

    listing = ask("GET", f"{A}/submaps?limit=1")
    assert f"\r\nlink: <{A}/submaps?limit=1&cursor=" in listing
    stored = ask("POST", f"{A}/submaps", BODY)
    assert f"\r\nlocation: {A}/submaps/" in stored
    submap = json.loads(stored.partition("\r\n\r\n")[2])["links"]["self"]
    told = [listing, stored, ask("GET", "/"), ask("PUT", "/v1/collections", "{}"), ask("GET", "/nowhere")]
    told += [ask("GET", f"{A}?host=1"), ask("OPTIONS", A), ask("DELETE", submap)]
    assert [one[9:12] for one in told] == ["200", "201", "200", "405", "404", "422", "204", "204"]
    assert not [one for one in told if "evil.example" in one]
    assert "<script>" not in ask("GET", "/", accept="text/html")


# -------------------------------------------------- what belongs to others


def test_an_idempotency_key_is_its_callers_own(tenants: Tenants) -> None:
    def post(who: str, path: str, seed: int) -> httpx.Response:
        return tenants.ask(who, "POST", path, json={"xy": points(forest(seed))}, headers={"Idempotency-Key": "shared"})

    firsts = [post(who, f"{A}/submaps", 20) for who in ("owner", "both", "writer")]
    assert [one.status_code for one in firsts] == [201] * 3
    assert len({one.json()["id"] for one in firsts}) == 3
    # Other content, other collections: a key that another used is a new one, and nothing says that it was used.
    others = [post("turning", f"{A}/submaps", 21), post("both", "/v1/collections/a-2/submaps", 22)]
    assert [one.status_code for one in others] == [201, 201]
    assert not [one for one in (*firsts, *others) if "Idempotency-Replayed" in one.headers]
    again = post("both", f"{A}/submaps", 20)
    assert (again.headers["Idempotency-Replayed"], again.content) == ("true", firsts[1].content)
    theirs = post("owner", f"{B}/submaps", 23)
    assert theirs.status_code == 201
    assert same(post("both", f"{B}/submaps", 23), post("both", "/v1/collections/c/submaps", 23), "'b'", "'c'")
    for made in (*firsts, *others, theirs):
        tenants.ask("owner", "DELETE", made.headers["Location"]).raise_for_status()


def test_an_idempotency_key_of_a_job_is_its_callers_own(tenants: Tenants) -> None:
    line = json.dumps({"id": "p-1", "xy": TREES["a"]})

    def send(who: str, path: str) -> httpx.Response:
        headers = NDJSON | {"Idempotency-Key": "job"}
        return tenants.ask(who, "POST", f"{path}/imports?on_conflict=skip", content=line, headers=headers)

    jobs = [send("owner", A), send("both", A), send("both", "/v1/collections/a-2")]
    assert len({job.json()["id"] for job in jobs}) == 3
    assert send("both", A).json()["id"] == jobs[1].json()["id"]
    for job in jobs:
        tenants.finished("owner", job.json())
        assert '"caller"' not in job.text
        assert tenants.secrets["owner"].split("_")[1] not in job.text
    asked = [
        tenants.ask(who, "POST", f"{A}/constraints", json={}, headers={"Idempotency-Key": "job"})
        for who in ("reader", "both")
    ]
    assert len({job.json()["id"] for job in asked} | {job.json()["id"] for job in jobs}) == 5


def test_jobs_of_others_are_not_there(tenants: Tenants) -> None:
    ends = [("GET", ""), ("GET", "/results"), ("GET", "/results?format=g2o"), ("GET", "/errors"), ("DELETE", "")]
    for method, end in ends:
        there, made_up = (tenants.ask("both", method, f"/v1/jobs/{job}{end}") for job in (tenants.job_of_b, "0" * 26))
        assert there.status_code == 404
        assert same(there, made_up, tenants.job_of_b, "0" * 26)
    assert tenants.ask("tenant", "GET", f"/v1/jobs/{tenants.job_of_b}/results").status_code == 200
    listed = tenants.ask("reader", "GET", "/v1/jobs").json()["jobs"]
    assert {job["collection"] for job in listed} <= {"a-1", "a-2"}
    there, made_up = (tenants.ask("reader", "GET", f"/v1/jobs?collection={name}") for name in "bc")
    assert same(there, made_up, "'b'", "'c'")
    # Nor is it waited for.
    assert tenants.ask("reader", "GET", f"/v1/jobs/{tenants.job_of_b}?wait=60", timeout=50.0).status_code == 404


def test_a_cursor_opens_nothing(tenants: Tenants) -> None:
    of = tenants.cursors
    pages = [
        tenants.ask("reader", "GET", path, params={"cursor": cursor, "limit": "50"})
        for path, cursor in (
            ("/v1/collections", of["/v1/collections"]),
            ("/v1/jobs", of["/v1/jobs"]),
            (f"{A}/submaps", of[f"{B}/submaps"]),
            (f"{A}/sessions", of[f"{B}/sessions"]),
            ("/v1/collections", _cursor("collections", 0)),
            ("/v1/jobs", _cursor("jobs", 2**40)),
            (f"{A}/submaps", _cursor("submaps", 0)),
        )
    ]
    assert [page.status_code for page in pages] == [200] * 7
    assert not [page for page in pages if HIDDEN in page.text or '"b"' in page.text]
    assert {one["collection"] for one in pages[5].json()["jobs"]} >= {"a-1"}
    for path, cursor in (("/v1/jobs", of["/v1/collections"]), (f"{A}/submaps", of[f"{B}/sessions"])):
        assert tenants.ask("reader", "GET", path, params={"cursor": cursor}).status_code == 422
    # What they are made of: where a listing goes on, and not what it is of.
    made_of = [json.loads(base64.urlsafe_b64decode(cursor + "==")) for cursor in of.values()]
    assert [listing for listing, _ in made_of] == ["collections", "submaps", "sessions", "jobs"]
    assert made_of[2][1] == f"{HIDDEN}-session-1"
    assert all(isinstance(place, int) for _, place in (*made_of[:2], made_of[3]))


def _cursor(listing: str, place: int) -> str:
    return base64.urlsafe_b64encode(json.dumps([listing, place]).encode()).rstrip(b"=").decode()


def test_stored_answers_are_counted_in_their_own_collection(tenants: Tenants) -> None:
    # There are three in `b` and one here: that others are there is not to be told from what was and is not kept.
    for end in ("", "/explanation", "/candidates/1/match"):
        assert tenants.ask("reader", "GET", f"{A}/queries/1{end}").status_code == 200
        assert tenants.ask("reader", "GET", f"{A}/queries/2{end}").status_code == 404
        there, made_up = (tenants.ask("reader", "GET", f"/v1/collections/{name}/queries/3{end}") for name in "bc")
        assert (there.status_code, same(there, made_up, "'b'", "'c'")) == (404, True)


def test_nothing_of_others_is_found_or_left_out(tenants: Tenants) -> None:
    def query(**body: Any) -> httpx.Response:
        return tenants.ask("reader", "POST", f"{A}/queries", json=body)

    def told(**body: Any) -> dict[str, Any]:
        answer: dict[str, Any] = query(**body).raise_for_status().json()
        return {name: value for name, value in answer.items() if name != "stages"}

    hidden = [f"{HIDDEN}-1", f"{HIDDEN}-2"]
    assert told(xy=TREES["b"])["verdict"] == "no_match"
    assert told(xy=TREES["a"])["candidates"]
    assert told(xy=TREES["a"], exclude={"submap_ids": hidden}) == told(xy=TREES["a"])
    assert told(xy=TREES["a"], exclude={"session": f"{HIDDEN}-session-1"}) == told(xy=TREES["a"])
    assert same(query(submap_id=hidden[0]), query(submap_id="nobody"), hidden[0], "nobody")
    of_hidden, of_nobody = (
        tenants.ask("reader", "POST", f"{A}/constraints", json={"submap_ids": [name]}) for name in (hidden[0], "nobody")
    )
    assert (of_hidden.status_code, same(of_hidden, of_nobody, hidden[0], "nobody")) == (422, True)
    body = {"session": f"{HIDDEN}-session-1"}
    job = tenants.ask("reader", "POST", f"{A}/constraints", json=body).raise_for_status().json()
    told_of = tenants.ask("reader", "GET", f"/v1/jobs/{job['id']}?wait=60").json()
    results = tenants.ask("reader", "GET", f"/v1/jobs/{job['id']}/results").text
    assert not results or HIDDEN not in results
    assert told_of["counts"].get("constraints", 0) == 0
    listed = tenants.ask("reader", "GET", f"{A}/submaps", params={"session": f"{HIDDEN}-session-1"}).json()
    assert listed == {"submaps": []}
    assert HIDDEN not in tenants.ask("reader", "GET", f"{A}/sessions").text


def test_preconditions_hold_for_what_is_seen_only(tenants: Tenants) -> None:
    etag = tenants.ask("owner", "GET", B).headers["ETag"]
    for header in ("If-Match", "If-None-Match"):
        for value in (etag, "*", '"x"'):
            for method, body in (("GET", None), ("DELETE", None), ("PATCH", {"title": "mine"}), ("PUT", {})):
                there, made_up = (
                    tenants.ask("turning", method, f"/v1/collections/{name}", json=body, headers={header: value})
                    for name in "bc"
                )
                assert (there.status_code, same(there, made_up, "'b'", "'c'")) == (404, True)
    assert tenants.ask("owner", "GET", B, headers={"If-None-Match": etag}).status_code == 304


def test_what_is_for_all_tells_of_nobody(tenants: Tenants) -> None:
    assert HIDDEN in tenants.ask("owner", "GET", "/").text
    for who in ("", "reader", "writer", "late", "revoked"):
        for path in ("/", "/docs", "/openapi.json", "/livez", "/readyz", "/problems/not-found", "/v1/limits"):
            for accept in ("application/json", "text/html"):
                said = tenants.ask(who, "GET", path, headers={"Accept": accept})
                assert HIDDEN not in said.text
                assert HIDDEN not in str(said.headers)
                assert "/v1/collections/b" not in said.text
    page = tenants.ask("reader", "GET", "/").json()
    assert {one["id"] for one in page["collections"]} == {"a-1", "a-2"}
    assert tenants.ask("writer", "GET", "/").json()["collections"] == page["collections"]


def test_what_tells_of_all_is_for_those_who_see_all(tenants: Tenants) -> None:
    assert 'collection="b"' in tenants.ask("owner", "GET", "/metrics").text
    assert tenants.ask("owner", "GET", f"/v1/snapshots/{HIDDEN}-snapshot").status_code == 200
    for who in ("tenant", "reader", "both", "turning", ""):
        for method, path in (
            ("GET", "/metrics"),
            ("GET", "/v1/snapshots"),
            ("GET", f"/v1/snapshots/{HIDDEN}-snapshot"),
            ("DELETE", f"/v1/snapshots/{HIDDEN}-snapshot"),
            ("POST", "/v1/snapshots"),
        ):
            body = {"json": {"name": f"{HIDDEN}-snapshot"}} if method == "POST" else {}
            file = {"Accept": "application/vnd.sqlite3", "Range": "bytes=0-99"}
            refused = tenants.ask(who, method, path, headers=file, **body)
            assert refused.status_code == (403 if who else 401), (who, method, path)
            assert HIDDEN not in refused.text
    there, made_up = (tenants.ask("tenant", "GET", f"/v1/snapshots/{name}") for name in (f"{HIDDEN}-snapshot", "none"))
    assert same(there, made_up, f"{HIDDEN}-snapshot", "none")


# ------------------------------------------------------------------- scopes


def test_who_may_only_read_changes_nothing(tenants: Tenants) -> None:
    before = [tenants.ask("owner", "GET", path).json() for path in (A, f"{A}/submaps", f"{A}/sessions")]
    kept = {"xy": TREES["a"], "store": True}
    body = {"xy": TREES["a"]}
    for method, path, sent in (
        ("POST", f"{A}/queries", kept),
        ("PUT", f"{A}/submaps/new", body | {"query": {"store": True}}),
        ("PUT", f"{A}/submaps/p-1?query=true", body),
        ("POST", f"{A}/submaps", body),
        ("PATCH", f"{A}/submaps/p-1", {"properties": {}}),
        ("DELETE", f"{A}/submaps/p-1", None),
        ("POST", f"{A}/reindex", None),
        ("PUT", A, {}),
        ("PATCH", A, {"title": "mine"}),
        ("DELETE", A, None),
    ):
        assert tenants.ask("reader", method, path, json=sent).status_code == 403, (method, path)
    batch = tenants.ask("reader", "POST", f"{A}/queries/batch", json={"queries": [kept, {"xy": TREES["a"]}]})
    refused, answered = batch.raise_for_status().json()["results"]
    assert (refused["problem"]["status"], answered["id"]) == (403, None)
    others = tenants.ask("owner", "POST", f"{A}/constraints", json={}).json()
    assert tenants.ask("reader", "DELETE", f"/v1/jobs/{others['id']}").status_code == 403
    # Its own jobs are its own to end.
    own = tenants.ask("reader", "POST", f"{A}/constraints", json={}).json()
    assert tenants.ask("reader", "DELETE", f"/v1/jobs/{own['id']}").status_code in (202, 204)
    assert [tenants.ask("owner", "GET", path).json() for path in (A, f"{A}/submaps", f"{A}/sessions")] == before
    assert tenants.ask("owner", "GET", f"{A}/queries/2").status_code == 404


def test_who_may_only_write_reads_nothing(tenants: Tenants) -> None:
    """Not even on the way: what a write answers is of what was sent."""
    before = tenants.ask("owner", "GET", f"{A}/submaps/p-1").json()
    body = {"xy": points(forest(30))}
    for method, path, sent in (
        ("PATCH", f"{A}/submaps/p-1", {}),
        ("PATCH", f"{A}/submaps/p-1", {"properties": {"mine": True}}),
        ("PATCH", f"{A}/submaps/nobody", {}),
        ("PUT", f"{A}/submaps/new?query=true", body),
        ("PUT", f"{A}/submaps/new", body | {"query": {}}),
        ("POST", f"{A}/submaps?query=true", body),
        ("POST", f"{A}/submaps", body | {"query": {}}),
        ("POST", f"{A}/queries", body | {"store": True}),
        ("GET", f"{A}/submaps/p-1", None),
        ("GET", A, None),
    ):
        refused = tenants.ask("writer", method, path, json=sent)
        assert refused.status_code == 403, (method, path)
        assert "landmarks" not in refused.text
    assert tenants.ask("owner", "GET", f"{A}/submaps/p-1").json() == before
    assert tenants.ask("owner", "GET", f"{A}/submaps/new").status_code == 404
    receipt = tenants.ask("writer", "PUT", f"{A}/submaps/own", json=body).raise_for_status().json()
    assert receipt["counts"]["landmarks"] == 60
    assert "xy" not in receipt
    tenants.ask("writer", "DELETE", f"{A}/submaps/own").raise_for_status()


# ------------------------------------------------------------- in the middle


def test_a_key_that_is_narrowed_takes_what_was_begun_along(tenants: Tenants) -> None:
    who, idempotency_key = "turning", {"Idempotency-Key": "narrowed"}
    cursor = tenants.ask(who, "GET", "/v1/collections?limit=1").json()["next"]
    jobs = tenants.ask(who, "GET", "/v1/jobs").json()["jobs"]
    job = next(one["id"] for one in jobs if one["collection"] == "a-1")
    etag = tenants.ask(who, "GET", A).headers["ETag"]
    posted = tenants.ask(
        who, "POST", f"{A}/submaps", json={"xy": points(forest(40))}, headers=idempotency_key
    ).raise_for_status()
    with tenants.database.write_connection() as connection:
        key_id = tenants.secrets[who].split("_")[1]
        connection.execute(update(KeyRow).where(KeyRow.id == key_id).values(patterns=["a-2"], scopes=["read", "write"]))
    wait_until(lambda: tenants.ask(who, "GET", A).status_code == 404)
    assert tenants.ask(who, "GET", A, headers={"If-None-Match": etag}).status_code == 404
    for end in ("", "/results", "?wait=1"):
        assert tenants.ask(who, "GET", f"/v1/jobs/{job}{end}").status_code == 404
    again = tenants.ask(who, "POST", f"{A}/submaps", json={"xy": points(forest(40))}, headers=idempotency_key)
    assert (again.status_code, "Idempotency-Replayed" in again.headers) == (404, False)
    page = tenants.ask(who, "GET", "/v1/collections", params={"cursor": cursor}).json()
    assert [one["id"] for one in page["collections"]] in ([], ["a-2"])
    assert tenants.ask(who, "POST", "/v1/collections/a-2/reindex").status_code == 403
    tenants.ask("owner", "DELETE", posted.headers["Location"]).raise_for_status()


def test_a_key_that_is_revoked_is_nothing_on_an_open_connection(tenants: Tenants) -> None:
    who = "leaving"
    job = tenants.ask(who, "POST", f"{A}/constraints", json={}).raise_for_status().json()["id"]
    cursor = tenants.ask(who, "GET", "/v1/collections?limit=1").json()["next"]
    api_keys.revoke(tenants.database, tenants.secrets[who].split("_")[1])
    wait_until(lambda: tenants.ask(who, "GET", A).status_code == 401)
    for path in (f"/v1/jobs/{job}", f"/v1/jobs/{job}/results", f"/v1/collections?cursor={cursor}", "/v1/limits"):
        assert tenants.ask(who, "GET", path).status_code == 401
    # What it began ends with it, unless it has ended before.
    wait_until(lambda: tenants.ask("reader", "GET", f"/v1/jobs/{job}").json()["finished"] is not None)
    assert tenants.ask("reader", "GET", f"/v1/jobs/{job}").json()["state"] in ("dismissed", "successful")


def test_a_key_is_changed_for_another_without_a_gap(tenants: Tenants) -> None:
    """But what was sent under the old one is sent for the first time under the new one."""
    old, first = api_keys.make(tenants.database, "robot", [Scope.READ, Scope.WRITE], ["a-*"])
    tenants.secrets["old"] = old
    body, idempotency_key = {"xy": points(forest(50))}, {"Idempotency-Key": "rotated"}
    begun = tenants.ask("old", "POST", f"{A}/submaps", json=body, headers=idempotency_key).raise_for_status()
    tenants.secrets["new"], _ = api_keys.make(tenants.database, "robot", [Scope.READ, Scope.WRITE], ["a-*"])
    for who in ("old", "new"):
        assert tenants.ask(who, "GET", A).status_code == 200
    api_keys.revoke(tenants.database, first.id)
    wait_until(lambda: tenants.ask("old", "GET", A).status_code == 401)
    again = tenants.ask("new", "POST", f"{A}/submaps", json=body, headers=idempotency_key).raise_for_status()
    assert again.json()["id"] != begun.json()["id"]
    for made in (begun, again):
        tenants.ask("new", "DELETE", made.headers["Location"]).raise_for_status()


# ---------------------------------------------------------- besides HTTP


@pytest.mark.parametrize("header", ["known", "unknown", "revoked"])
def test_a_secret_is_compared_in_any_case(database: Database, monkeypatch: pytest.MonkeyPatch, header: str) -> None:
    secret, info = api_keys.make(database, "robot", [Scope.READ], ["*"])
    if header == "revoked":
        api_keys.revoke(database, info.id)
    compared: list[tuple[int, int]] = []

    def compare(left: bytes, right: bytes) -> bool:
        compared.append((len(left), len(right)))
        return left == right

    monkeypatch.setattr(hmac, "compare_digest", compare)
    given = f"urq_{'z' * 8 if header == 'unknown' else info.id}_{'z' * 43}"
    with pytest.raises(Unauthorized, match="no such key"):
        authenticator.Authenticator(Settings(database=str(database.path)), database).authenticate(f"Bearer {given}")
    assert compared == [(32, 32)]
    assert secret != given


def test_an_address_is_what_a_proxy_on_this_machine_says(tmp_path: Path) -> None:
    """The last that it says: what callers write before it themselves counts for nothing."""
    limits = Limits(requests_per_second=0.01)
    server = Threaded(create_app(Settings(database=str(tmp_path / "urquhart.db"), limits=limits)))
    try:
        asked = [
            server.client.get("/v1/limits", headers={"X-Forwarded-For": address}).status_code
            for address in ("192.0.2.1", "192.0.2.1", "192.0.2.2", "198.51.100.7, 192.0.2.1", "198.51.100.8, 192.0.2.3")
        ]
        assert asked == [200, 429, 200, 429, 200]
    finally:
        server.close()


def test_readiness_names_no_collection(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    reached, hold = threading.Event(), threading.Event()

    def slowly() -> Iterator[tuple[str, int, int]]:
        yield f"{HIDDEN}-wood", 3, 71
        reached.set()
        hold.wait(60)

    app = create_app(settings)
    monkeypatch.setattr(app.state.service.indexes, "warm_up", slowly)
    with TestClient(app) as client:
        try:
            assert reached.wait(60)
            response = client.get("/readyz")
            assert (response.status_code, response.json()["check"]) == (503, "index")
            assert HIDDEN not in response.text
            assert "71" not in response.json()["detail"]
        finally:
            hold.set()


def _open_to_others(path: Path) -> bool:
    """Whether other users of the machine can read a file, by its mode and those of the folders up to the database."""
    return bool(path.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH))


@pytest.mark.parametrize(("mask", "private"), [(0o077, True), (0o022, False)])
def test_what_is_written_is_as_private_as_the_umask_says(tmp_path: Path, mask: int, private: bool) -> None:
    before = os.umask(mask)
    try:
        database = tmp_path / "urquhart.db"
        with TestClient(create_app(Settings(database=str(database)))) as client:
            client.put("/v1/collections/plots", json={}).raise_for_status()
            put_submap(client, "plots", "p", 1).raise_for_status()
            line = json.dumps({"id": "q", "xy": points(forest(2))})
            for path, body in (("imports", line), ("reindex", None)):
                job = client.post(f"/v1/collections/plots/{path}", content=body, headers=NDJSON).raise_for_status()
                client.get(f"/v1/jobs/{job.json()['id']}?wait=60").raise_for_status()
            client.post("/v1/snapshots", json={"name": "one"}).raise_for_status()
            written = {path: _open_to_others(path) for path in tmp_path.rglob("*") if path.is_file()}
    finally:
        os.umask(before)
    assert {".db", ".db-wal", ".lock", ".results", ".json"} <= {path.suffix for path in written}
    assert [path for path in written if path.parent.name.endswith(".index")]
    assert set(written.values()) == {not private}


def test_a_private_database_has_private_copies_from_the_first_byte(
    client: httpx.Client, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    service.database.path.chmod(0o600)
    seen: list[bool] = []
    copy_to = Database.copy_to

    def watched(self: Database, target: Path, *, between: Callable[[], None]) -> None:
        copy_to(self, target, between=between)
        seen.append(_open_to_others(target) and _open_to_others(target.parent))

    monkeypatch.setattr(Database, "copy_to", watched)
    client.post("/v1/snapshots", json={"name": "one"}).raise_for_status()
    assert seen == [False]
    # The manifest names all collections.
    assert not [path for path in service.snapshots.path.glob("one.*") if _open_to_others(path)]


def test_a_private_database_stays_private_while_it_is_put_back(
    client: httpx.Client, service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.post("/v1/snapshots", json={"name": "one"}).raise_for_status()
    target = tmp_path / "other.db"
    target.write_bytes(service.snapshots.file("one").read_bytes())
    target.chmod(0o600)
    seen: list[bool] = []
    prove = restoring._prove

    def watched(source: restoring.RestoreSource, file: Path) -> None:
        seen.append(_open_to_others(file) and _open_to_others(file.parent))
        prove(source, file)

    monkeypatch.setattr(restoring, "_prove", watched)
    restoring.restore(restoring.find(service.database.path, "one"), target, force=True)
    assert seen == [False]
    assert not _open_to_others(target)


def test_the_log_holds_no_secret(tenants: Tenants) -> None:
    for header in _forms(tenants).values():
        tenants.get(f"{A}?key={tenants.secrets['owner']}", header)
    tenants.ask("owner", "GET", "/v1/limits", headers={"X-Request-Id": "the-last-one"})
    wait_until(lambda: "the-last-one" in tenants.served.log.read_text())
    text = tenants.served.log.read_text()
    assert f"key={tenants.secrets['owner'].split('_')[1]}" in text
    assert not [name for name, secret in tenants.secrets.items() if secret.split("_")[2] in text]
