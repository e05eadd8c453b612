"""Probes, metrics, limits, pages, and the OpenAPI document."""

import re
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.errors import StorageDamaged
from server.http.documentation import openapi_document
from server.problem_types import PROBLEM_TYPES, TABLE
from server.service_parts import Service
from server.store.schema_version import expected_revision
from tests.server.factories import TestClient, forest, points, put_submap

OPERATIONS = {
    "deleteSession": "delete /v1/collections/{collection}/sessions/{session}",
    "listConstraints": "get /v1/collections/{collection}/constraints",
    "deleteConstraint": "delete /v1/collections/{collection}/constraints/{constraint}",
    "postOdometry": "post /v1/collections/{collection}/odometry",
    "getSessionPoses": "get /v1/collections/{collection}/sessions/{session}/poses",
    "postMerge": "post /v1/collections/{collection}/merges",
    "getMerge": "get /v1/collections/{collection}/merges/{merge}",
    "getLandingPage": "get /",
    "getProblem": "get /problems/{slug}",
    "getLiveness": "get /livez",
    "getReadiness": "get /readyz",
    "getMetrics": "get /metrics",
    "getLimits": "get /v1/limits",
    "listCollections": "get /v1/collections",
    "putCollection": "put /v1/collections/{collection}",
    "getCollection": "get /v1/collections/{collection}",
    "patchCollection": "patch /v1/collections/{collection}",
    "deleteCollection": "delete /v1/collections/{collection}",
    "listSubmaps": "get /v1/collections/{collection}/submaps",
    "postSubmap": "post /v1/collections/{collection}/submaps",
    "listSessions": "get /v1/collections/{collection}/sessions",
    "listStands": "get /v1/collections/{collection}/stands",
    "getStand": "get /v1/collections/{collection}/stands/{stand}",
    "putStand": "put /v1/collections/{collection}/stands/{stand}",
    "patchStand": "patch /v1/collections/{collection}/stands/{stand}",
    "readStemMap": "post /v1/stem-maps",
    "deleteStand": "delete /v1/collections/{collection}/stands/{stand}",
    "putSubmap": "put /v1/collections/{collection}/submaps/{submap}",
    "getSubmap": "get /v1/collections/{collection}/submaps/{submap}",
    "patchSubmap": "patch /v1/collections/{collection}/submaps/{submap}",
    "deleteSubmap": "delete /v1/collections/{collection}/submaps/{submap}",
    "getTessellation": "get /v1/collections/{collection}/submaps/{submap}/tessellation",
    "postImport": "post /v1/collections/{collection}/imports",
    "postReindex": "post /v1/collections/{collection}/reindex",
    "postConstraints": "post /v1/collections/{collection}/constraints",
    "postMap": "post /v1/collections/{collection}/maps",
    "postPoses": "post /v1/collections/{collection}/poses",
    "getMap": "get /v1/collections/{collection}/maps/{map}",
    "getMapLandmarks": "get /v1/collections/{collection}/maps/{map}/landmarks",
    "getLandmarks": "get /v1/collections/{collection}/landmarks",
    "listQueries": "get /v1/collections/{collection}/queries",
    "getExport": "get /v1/collections/{collection}/exports/{table}",
    "getFeaturesLandingPage": "get /ogc",
    "getConformance": "get /ogc/conformance",
    "listFeatureCollections": "get /ogc/collections",
    "getFeatureCollection": "get /ogc/collections/{collection}:{kind}",
    "listFeatures": "get /ogc/collections/{collection}:{kind}/items",
    "getFeature": "get /ogc/collections/{collection}:{kind}/items/{feature}",
    "postCoregistration": "post /v1/collections/{collection}/coregistrations",
    "listJobFiles": "get /v1/jobs/{job}/files",
    "getJobFile": "get /v1/jobs/{job}/files/{file}",
    "listJobs": "get /v1/jobs",
    "getJob": "get /v1/jobs/{job}",
    "getJobResults": "get /v1/jobs/{job}/results",
    "getJobErrors": "get /v1/jobs/{job}/errors",
    "deleteJob": "delete /v1/jobs/{job}",
    "query": "post /v1/collections/{collection}/queries",
    "queryBatch": "post /v1/collections/{collection}/queries/batch",
    "getQuery": "get /v1/collections/{collection}/queries/{query}",
    "getMatch": "get /v1/collections/{collection}/queries/{query}/candidates/{rank}/match",
    "getExplanation": "get /v1/collections/{collection}/queries/{query}/explanation",
    "postSnapshot": "post /v1/snapshots",
    "listSnapshots": "get /v1/snapshots",
    "getSnapshot": "get /v1/snapshots/{snapshot}",
    "deleteSnapshot": "delete /v1/snapshots/{snapshot}",
}


def ready(client: httpx.Client) -> httpx.Response:
    """The first answer of /readyz that is not 503."""
    for _ in range(3000):
        response = client.get("/readyz")
        if response.status_code != 503:
            return response
        threading.Event().wait(0.02)
    raise AssertionError(response.text)


def test_probes(client: httpx.Client) -> None:
    assert client.get("/livez").json() == {"status": "ok"}
    assert ready(client).json() == {
        "status": "ok",
        "checks": {"migrations": "ok", "kernels": "ok", "index": "ok", "database": "ok"},
        "load": {"in_flight": 0, "capacity": 32, "queued": 0, "saturated": False},
    }


def test_readiness_names_what_is_open(service: Service, monkeypatch: pytest.MonkeyPatch, client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    ready(client)
    hold = threading.Event()

    def slowly() -> Iterator[tuple[str, int, int]]:
        hold.wait(60)
        yield "plots", 1, 1

    again = create_app(service.settings)
    monkeypatch.setattr(again.state.service.indexes, "warm_up", slowly)
    with TestClient(again) as starting:
        response = starting.get("/readyz")
        while response.json()["check"] != "index":
            response = starting.get("/readyz")
        assert response.status_code == 503
        assert response.headers["Retry-After"] == "1"
        assert "index" in response.json()["detail"]
        answer = starting.post("/v1/collections/plots/queries", json={"xy": points(forest(1))})
        assert answer.json()["verdict"] == "matched"
        hold.set()
        assert ready(starting).status_code == 200


def test_a_failed_warm_up_stays_visible(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> Iterator[tuple[str, int, int]]:
        raise StorageDamaged("the index cannot be read")

    app = create_app(service.settings)
    monkeypatch.setattr(app.state.service.indexes, "warm_up", fail)
    with TestClient(app) as client:
        response = client.get("/readyz")
        while "cannot be read" not in response.text:
            response = client.get("/readyz")
        assert response.status_code == 503


def test_metrics(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    client.post("/v1/collections/plots/queries", json={"xy": points(forest(1))}).raise_for_status()
    client.get("/nope")
    response = client.get("/metrics")
    assert response.headers["Content-Type"].startswith("text/plain")
    lines = response.text.splitlines()
    put = 'route="/v1/collections/{collection}/submaps/{submap}"'
    assert f'urquhart_requests_total{{method="PUT",{put},status="201"}} 1.0' in lines
    assert 'urquhart_requests_total{method="GET",route="unmatched",status="404"} 1.0' in lines
    assert 'urquhart_query_verdicts_total{verdict="matched"} 1.0' in lines
    assert 'urquhart_index_revision{collection="plots"} 1.0' in lines
    assert 'urquhart_index_submaps{collection="plots"} 1.0' in lines
    assert 'urquhart_submaps_written_total{outcome="created"} 1.0' in lines
    assert any(line.startswith("urquhart_query_stage_seconds_count") for line in lines)
    client.delete("/v1/collections/plots").raise_for_status()
    assert 'collection="plots"' not in client.get("/metrics").text


def test_limits(client: httpx.Client, service: Service) -> None:
    limits = client.get("/v1/limits").json()
    assert limits["limits"]["body_bytes"] == 8 * 1024 * 1024
    assert set(limits["limits"]) | {"stored_queries", "requests_per_second"} == set(
        type(service.settings.limits).model_fields
    )
    assert limits["retention"] == {"stored_queries": 10_000, "idempotency_hours": 24.0}
    assert limits["versions"]["schema"] == expected_revision()


def test_landing_page_for_people_and_programs(client: httpx.Client) -> None:
    page = client.get("/", headers={"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}, follow_redirects=False)
    assert (page.status_code, page.headers["Location"]) == (303, "/ui")
    data = client.get("/").json()
    assert data["collections"][0]["id"] == "plots"
    assert set(data["links"]) >= {"docs", "openapi", "collections", "limits"}
    client.delete("/v1/collections/plots").raise_for_status()
    assert client.get("/").json()["collections"] == []
    assert client.get("/", headers={"Accept": "image/png"}).status_code == 406


def test_every_problem_type_is_explained(client: httpx.Client) -> None:
    assert {kind.slug for kind in TABLE.values()} <= set(PROBLEM_TYPES)
    for slug, kind in PROBLEM_TYPES.items():
        explained = client.get(f"/problems/{slug}").json()
        assert (explained["status"], explained["title"]) == (kind.status, kind.title)
        assert explained["about"]
        assert kind.title in client.get(f"/problems/{slug}", headers={"Accept": "text/html"}).text
    assert client.get("/problems/nope").status_code == 404


def test_request_ids(client: httpx.Client) -> None:
    assert client.get("/livez", headers={"X-Request-Id": "robot-2.17"}).headers["X-Request-Id"] == "robot-2.17"
    made = client.get("/livez", headers={"X-Request-Id": "bad id\x7f" * 20}).headers["X-Request-Id"]
    assert len(made) == 16
    assert made != client.get("/livez").headers["X-Request-Id"]


def test_head_is_get_without_the_body(client: httpx.Client) -> None:
    head, get = client.head("/v1/collections/plots"), client.get("/v1/collections/plots")
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["ETag"] == get.headers["ETag"]


def test_openapi_is_stable_and_has_examples(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    operations = {
        operation["operationId"]: (f"{method} {path}", operation)
        for path, item in document["paths"].items()
        for method, operation in item.items()
    }
    assert {name: where for name, (where, _) in operations.items()} == OPERATIONS
    schemas = document["components"]["schemas"]
    assert not {"HTTPValidationError", "ValidationError"} & set(schemas)
    for name, (_, operation) in operations.items():
        assert operation["summary"], name
        assert operation["tags"], name
        if "requestBody" in operation:
            body = operation["requestBody"]["content"]
            if name == "postImport":
                assert body["application/x-ndjson"]["example"]
                continue
            if name in ("putStand", "readStemMap", "postCoregistration"):
                assert body["application/octet-stream"]["example"]
                continue
            assert list(body) == ["application/json"], name
            reference = body["application/json"]["schema"]["$ref"]
            assert schemas[reference.rsplit("/", 1)[1]]["examples"], name
        for status, response in operation["responses"].items():
            check_response(name, status, response)
        assert "500" in operation["responses"], name


def test_the_event_loop_is_free_while_the_openapi_document_is_made(
    app: FastAPI, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, alive = threading.Event(), threading.Event()

    def slowly(app: FastAPI) -> dict[str, Any]:
        asked.set()
        assert alive.wait(60.0)
        return {"openapi": "3.1.0"}

    monkeypatch.setattr(openapi_document, "openapi_document", slowly)
    with ThreadPoolExecutor(1) as other:
        made = other.submit(client.get, "/openapi.json")
        assert asked.wait(60.0)
        assert client.get("/livez").status_code == 200
        alive.set()
        assert made.result().json() == {"openapi": "3.1.0"}


def check_response(name: str, status: str, response: dict[str, Any]) -> None:
    """A success has an example for each media type; an error is a problem."""
    assert response["description"], (name, status)
    content = response.get("content", {})
    if status >= "400":
        assert list(content) == ["application/problem+json"], (name, status)
        assert content["application/problem+json"]["schema"] == {"$ref": "#/components/schemas/Problem"}
    for media_type, described in content.items():
        assert "example" in described, (name, status, media_type)


@pytest.mark.parametrize(
    "operation",
    [
        "putCollection",
        "patchCollection",
        "putSubmap",
        "postSubmap",
        "postSnapshot",
        "patchSubmap",
        "query",
        "queryBatch",
        "postConstraints",
    ],
)
def test_examples_of_bodies_are_accepted(client: httpx.Client, document: dict[str, Any], operation: str) -> None:
    method, path = OPERATIONS[operation].split()
    put_submap(client, "plots", "p7", 1, map_pose={"x": 0.0, "y": 0.0, "yaw": 0.0}).raise_for_status()
    reference = document["paths"][path][method]["requestBody"]["content"]["application/json"]["schema"]["$ref"]
    examples = document["components"]["schemas"][reference.rsplit("/", 1)[1]]["examples"]
    target = "new" if operation == "putCollection" else "plots"
    for i, example in enumerate(examples):
        url = path.replace("{collection}", f"{target}{i or ''}" if target == "new" else target)
        response = client.request(method.upper(), url.replace("{submap}", "p7"), json=example)
        assert response.status_code in {200, 201, 202}, response.text


def test_the_documentation_needs_no_internet(client: httpx.Client) -> None:
    page = client.get("/docs").text
    parts = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert len(parts) >= 3
    for part in parts:
        assert part.startswith("/docs/assets/")
        assert client.get(part).status_code == 200
