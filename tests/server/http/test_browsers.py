"""What a page in somebody's browser can do to the service: nothing, unless it is the service's own page."""

import base64
import hashlib
import re
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.config.settings import Settings
from server.security import api_keys
from server.security.principal import Scope
from server.service_parts import Service
from tests.server.factories import TestClient, forest, points, put_submap

QUERY = {"xy": points(forest(1))}


def asked(client: httpx.Client, **headers: str) -> httpx.Response:
    return client.get("/v1/collections", headers=headers)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8420", "localhost.evil.example", "127.0.0.1@evil", "", ":"]
)
def test_a_foreign_name_is_refused(shared_client: httpx.Client, host: str) -> None:
    answer = asked(shared_client, Host=host)
    assert answer.status_code == 403
    assert answer.json()["type"] == "/problems/unknown-host"
    assert "allowed_hosts" in answer.json()["detail"]
    assert shared_client.get(answer.json()["type"]).status_code == 200


@pytest.mark.parametrize(
    "host", ["localhost", "localhost:8420", "LOCALHOST", "127.0.0.1:1", "[::1]:8420", "testserver"]
)
def test_the_services_own_names_are_known(shared_client: httpx.Client, host: str) -> None:
    assert asked(shared_client, Host=host).status_code == 200


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "null",
        "http://localhost:3000",
        "http://testserver.evil.example",
        "file://",
        "http://[",
        "",
    ],
)
@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "GET", "OPTIONS"])
def test_a_page_of_another_site_is_refused(shared_client: httpx.Client, origin: str, method: str) -> None:
    answer = shared_client.request(method, "/v1/collections/plots", headers={"Origin": origin})
    assert answer.status_code == 403
    assert "access-control-allow-origin" not in answer.headers
    assert shared_client.get("/v1/collections/plots").status_code == 200


@pytest.mark.parametrize("origin", ["http://testserver", "http://testserver:80"])
def test_the_services_own_page_may_ask(client: httpx.Client, origin: str) -> None:
    answer = client.post("/v1/collections/plots/queries", json=QUERY, headers={"Origin": origin})
    assert answer.status_code == 200


def test_a_service_with_keys_answers_under_any_name(client: httpx.Client, service: Service) -> None:
    secret, _ = api_keys.make(service.database, "robot", [Scope.READ], ["*"])
    client.app.state.authenticator._asks_for_keys = None  # type: ignore[attr-defined]
    headers = {"Authorization": f"Bearer {secret}"}
    assert asked(client, Host="forest.example", **headers).status_code == 200
    assert asked(client, Host="forest.example").status_code == 401


def test_names_can_be_allowed(tmp_path: Path) -> None:
    app = create_app(Settings(database=str(tmp_path / "a.db"), allowed_hosts="forest.example, plots.example"))
    with TestClient(app, base_url="http://plots.example") as client:
        api_keys.make(app.state.service.database, "robot", [Scope.READ], ["*"])
        assert asked(client).status_code == 401
        assert asked(client, Origin="https://forest.example").status_code == 401
        assert asked(client, Origin="https://evil.example").status_code == 403
        assert asked(client, Host="evil.example").status_code == 403, "configured, the check holds with keys as well"


def test_any_name_can_be_allowed(tmp_path: Path) -> None:
    app = create_app(Settings(database=str(tmp_path / "a.db"), allowed_hosts="*"))
    with TestClient(app, base_url="http://any.example") as client:
        assert asked(client, Origin="https://other.example").status_code == 200


def test_on_all_addresses_a_number_is_known_and_a_name_is_not(tmp_path: Path) -> None:
    app = create_app(Settings(database=str(tmp_path / "a.db"), host="0.0.0.0", insecure=True))
    with TestClient(app, base_url="http://172.17.0.2:8420") as client:
        assert asked(client, Host="192.0.2.7:8420").status_code == 200
        assert asked(client, Host="evil.example:8420").status_code == 403


@pytest.mark.parametrize("name", ["http://forest.example", "forest.example:80"])
def test_what_is_no_host_name_cannot_be_allowed(name: str) -> None:
    with pytest.raises(ValueError, match="not a host name"):
        Settings(allowed_hosts=name)


def policy(answer: httpx.Response) -> dict[str, list[str]]:
    parts = (part.split() for part in answer.headers["content-security-policy"].split(";"))
    return {name: values for name, *values in parts}


@pytest.mark.parametrize(
    "path", ["/", "/docs", "/problems/gone", "/openapi.json", "/docs/assets/swagger-ui.css", "/livez", "/nothing"]
)
@pytest.mark.parametrize("accept", ["text/html", "*/*"])
def test_every_answer_is_marked(shared_client: httpx.Client, path: str, accept: str) -> None:
    answer = shared_client.get(path, headers={"Accept": accept}, follow_redirects=False)
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert policy(answer)["default-src"] == policy(answer)["frame-ancestors"] == ["'none'"]


def test_the_documentation_runs_its_own_scripts_only(client: httpx.Client) -> None:
    page = client.get("/docs")
    scripts = re.findall(r"<script>(.*?)</script>", page.text, re.DOTALL)
    assert scripts, "the page starts Swagger UI"
    hashes = {f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in scripts}
    assert set(policy(page)["script-src"]) == {"'self'"} | hashes
    for source in re.findall(r'(?:src|href)="([^"]+)"', page.text):
        assert source.startswith("/docs/assets/"), "everything else is of this service"


def test_a_script_in_a_drawing_stays_text(client: httpx.Client, app: FastAPI) -> None:
    """Names that callers give stand in titles of a drawing: escaped, and the policy forbids scripts besides."""
    hostile = '</text><script>alert(1)</script><text onload="x">'
    trees = [{"id": f"{i}{hostile}", "x": x, "y": y} for i, (x, y) in enumerate(points(forest(1)))]
    client.put("/v1/collections/plots/submaps/p1", json={"landmarks": trees}).raise_for_status()
    put_submap(client, "plots", "p2", 2)
    body = {"landmarks": trees, "store": True}
    answer = client.post("/v1/collections/plots/queries", json=body).json()
    links = [answer["candidates"][0]["links"]["match"], answer["links"]["explanation"]]
    links.append("/v1/collections/plots/submaps/p1/tessellation")
    for link in links:
        drawing = client.get(link, headers={"Accept": "image/svg+xml"})
        assert drawing.status_code == 200
        assert "<script" not in drawing.text
        assert "onload=" not in re.sub(r">[^<]*<", "><", drawing.text), "no element got it as an attribute"
        assert policy(drawing)["sandbox"] == []
        assert "script-src" not in policy(drawing)
