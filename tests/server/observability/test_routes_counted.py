"""Every request is counted and logged under the route and the collection of its path, however early it is answered."""

import gzip
import json

import httpx
import pytest

from tests.server.factories import forest, points
from tests.server.observability.test_logs import requests, written

SUBMAP = "/v1/collections/{collection}/submaps/{submap}"
BODY = json.dumps({"xy": points(forest(1))}).encode()
JSON = {"Content-Type": "application/json"}


@pytest.mark.parametrize(
    ("method", "path", "content", "headers", "status", "route"),
    [
        ("PUT", "/v1/collections/plots/submaps/p", BODY, {}, 201, SUBMAP),
        ("PUT", "/v1/collections/plots/submaps/p", gzip.compress(BODY), {"Content-Encoding": "gzip"}, 201, SUBMAP),
        ("PUT", "/v1/collections/plots/submaps/p", BODY, {"Content-Encoding": "gzip"}, 400, SUBMAP),
        ("PUT", "/v1/collections/plots/submaps/p", BODY, {"Content-Encoding": "br"}, 415, SUBMAP),
        ("PUT", "/v1/collections/plots/submaps/p", b" " * 9_000_000, {}, 413, SUBMAP),
        ("PUT", "/v1/collections/plots/submaps/p", BODY, {"Host": "evil.example"}, 403, SUBMAP),
        ("POST", "/v1/collections/plots/submaps/p", b"", {}, 405, SUBMAP),
        ("OPTIONS", "/v1/collections/plots/submaps/p", b"", {}, 204, SUBMAP),
        ("HEAD", "/v1/collections/plots", b"", {}, 200, "/v1/collections/{collection}"),
        ("POST", "/v1/collections/plots/imports", BODY, {"Content-Encoding": "br"}, 415, None),
    ],
)
def test_a_request_is_told_under_its_route(
    client: httpx.Client,
    method: str,
    path: str,
    content: bytes,
    headers: dict[str, str],
    status: int,
    route: str | None,
) -> None:
    stream = written("json")
    answer = client.request(method, path, content=content, headers=JSON | headers)
    assert answer.status_code == status
    (line,) = requests(stream)
    expected = route or "/v1/collections/{collection}/imports"
    assert (line["route"], line["collection"]) == (expected, "plots")
    sample = f'route="{expected}",status="{status}"'
    assert any(sample in told and f'method="{method}"' in told for told in client.get("/metrics").text.splitlines())


@pytest.mark.parametrize("path", ["/openapi.json", "/docs/assets/swagger-ui.css"])
def test_files_have_a_route_too(client: httpx.Client, path: str) -> None:
    stream = written("json")
    client.get(path)
    (line,) = requests(stream)
    assert line["route"] in (path, "/docs/assets")


def test_what_leads_nowhere_is_unmatched(client: httpx.Client) -> None:
    stream = written("json")
    client.get("/v1/nothing")
    (line,) = requests(stream)
    assert (line["route"], line["collection"]) == ("unmatched", "")
