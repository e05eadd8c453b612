"""Any JSON whatever, and any path: an answer or a problem, never a failure of the service."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from server.app import create_app
from server.config.settings import Settings
from tests.server.factories import TestClient, put_submap

ROUTES = [
    ("PUT", "/v1/collections/any"),
    ("PATCH", "/v1/collections/plots"),
    ("PUT", "/v1/collections/plots/submaps/any"),
    ("PATCH", "/v1/collections/plots/submaps/p"),
    ("POST", "/v1/collections/plots/queries"),
]
NAMES = [
    "xy", "ids", "landmarks", "id", "x", "y", "yaw", "dbh_cm", "height_m", "species", "frame_id", "stamp", "session",
    "map_pose", "covariance", "properties", "submap_id", "limit", "method", "seed", "store", "exclude", "submap_ids",
    "title", "config", "crs", "origin", "gate", "explain",
]  # fmt: skip
scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=True)
    | st.text(max_size=8)
    | st.sampled_from(["p", "paper", "EPSG:32633", "2026-05-04T09:30:00Z", "9999-12-31T23:59:59-23:59"])
)
coordinates = st.floats(-50, 50) | st.sampled_from([0.0, 1e-300, 1e8, -1e15, 1e300])
xy = st.lists(st.lists(coordinates, min_size=2, max_size=2), max_size=12)
values = st.recursive(
    scalars | xy,
    lambda inner: st.lists(inner, max_size=9) | st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=4), inner),
    max_leaves=12,
)
bodies = values | st.fixed_dictionaries({"xy": xy}, optional=dict.fromkeys(NAMES[1:], values))


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A client of an app with one submap."""
    path: Path = tmp_path_factory.mktemp("any") / "urquhart.db"
    with TestClient(create_app(Settings(database=str(path)))) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        put_submap(client, "plots", "p", 1).raise_for_status()
        yield client


def answered(response: httpx.Response) -> None:
    """Success, or a complete problem that is the caller's."""
    assert response.status_code < 500, response.text
    if response.status_code >= 400:
        assert response.headers["Content-Type"] == "application/problem+json"
        assert response.json()["detail"]
        assert len(response.content) < 10_000
    elif response.content:
        json.loads(response.content, parse_constant=lambda name: pytest.fail(f"{name} was answered"))


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(route=st.sampled_from(ROUTES), body=bodies)
def test_any_json_is_answered(running: httpx.Client, route: tuple[str, str], body: Any) -> None:
    response = running.request(*route, content=json.dumps(body), headers={"Content-Type": "application/json"})
    answered(response)
    answered(running.get("/v1/collections/plots"))
    answered(running.get("/v1/collections/plots/submaps"))


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    name=st.text(min_size=1, max_size=12),
    query=st.dictionaries(st.sampled_from(["bbox", "datetime", "session", "limit", "cursor", "frame_id"]), st.text()),
    accept=st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=20),
)
def test_any_path_is_answered(running: httpx.Client, name: str, query: dict[str, str], accept: str) -> None:
    quoted = "/" + quote(name, safe="")
    headers = {"Accept": accept}
    for path in (f"/v1/collections{quoted}", f"/v1/collections/plots/queries{quoted}", f"/problems{quoted}"):
        answered(running.get(path, headers=headers))
    answered(running.get("/v1/collections/plots/submaps", params=query, headers=headers))
