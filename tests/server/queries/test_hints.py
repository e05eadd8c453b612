"""Hints: where a query is about, and what it must not find."""

from typing import Any

import httpx
import pytest

from tests.server.factories import forest, observed, points, put_submap

PLOTS = "/v1/collections/plots"
QUERIES = f"{PLOTS}/queries"


@pytest.fixture
def stored(client: httpx.Client) -> httpx.Client:
    """One place seen three times: on Monday, half a minute later, and on Tuesday; and another place."""
    for name, session, stamp, x, seed in (
        ("early", "monday", "2026-05-04T10:00:00Z", 0.0, 1),
        ("late", "monday", "2026-05-04T10:00:30Z", 1000.0, 1),
        ("next", "tuesday", "2026-05-05T10:00:00Z", 2000.0, 1),
        ("other", "monday", "2026-05-04T10:00:10Z", 5000.0, 2),
    ):
        pose = {"x": x, "y": 0.0, "yaw": 0.0}
        put_submap(client, "plots", name, seed, session=session, stamp=stamp, map_pose=pose).raise_for_status()
    return client


def found(client: httpx.Client, **body: Any) -> set[str]:
    """Submaps in which the place is found."""
    seen, _ = observed(forest(1), 3)
    response = client.post(QUERIES, json={"xy": seen, "limit": 10} | body)
    assert response.status_code == 200, response.text
    return {c["submap_id"] for c in response.json()["candidates"] if len(c["inliers"]) > 40}


def test_only_what_is_near_is_found(stored: httpx.Client) -> None:
    assert found(stored) == {"early", "late", "next"}
    assert found(stored, near={"x": 1010.0, "y": 5.0, "radius": 60.0}) == {"late"}
    assert found(stored, near={"x": 500.0, "y": 0.0, "radius": 500.0}) == {"early", "late"}
    assert found(stored, near={"x": 5000.0, "y": 0.0, "radius": 10.0}) == set()
    assert found(stored, near={"x": 0.0, "y": 0.0, "radius": 10.0, "frame_id": "elsewhere"}) == set()
    stored.patch(f"{PLOTS}/submaps/early", json={"map_pose": {"x": 7000.0, "y": 0.0, "yaw": 1.0}}).raise_for_status()
    assert found(stored, near={"x": 7000.0, "y": 0.0, "radius": 5.0}) == {"early"}
    stored.patch(f"{PLOTS}/submaps/early", json={"map_pose": None}).raise_for_status()
    assert found(stored, near={"x": 0.0, "y": 0.0, "radius": 1e9}) == {"late", "next"}


def test_a_place_that_is_not_near_is_an_answer(stored: httpx.Client) -> None:
    seen, _ = observed(forest(1), 3)
    far = {"xy": seen, "near": {"x": 1e6, "y": 0.0, "radius": 1.0}}
    answer = stored.post(QUERIES, json=far).json()
    assert (answer["verdict"], answer["reason"], answer["candidates"]) == ("no_match", "all_filtered_out", [])


def test_sessions_and_recent_submaps_are_left_out(stored: httpx.Client) -> None:
    now = "2026-05-04T10:00:40Z"
    assert found(stored, exclude={"session": "monday"}) == {"next"}
    assert found(stored, exclude={"session": "sunday"}) == {"early", "late", "next"}
    assert found(stored, exclude={"within_seconds": 20.0}, stamp=now) == {"early", "next"}
    assert found(stored, exclude={"within_seconds": 1e9}, stamp=now) == set()
    # Together: the own session's last seconds. Others' are found.
    assert found(stored, exclude={"session": "tuesday", "within_seconds": 20.0}, stamp=now) == {"early", "late", "next"}
    assert found(stored, exclude={"session": "monday", "within_seconds": 20.0}, stamp=now) == {"early", "next"}
    assert found(stored, exclude={"session": "monday", "submap_ids": ["next"]}) == set()
    ends = {"within_seconds": 1e9}
    assert found(stored, exclude=ends, stamp="0001-01-01T00:00:01Z") == {"early", "late", "next"}
    assert found(stored, exclude=ends, stamp="9999-12-31T23:59:59Z") == {"early", "late", "next"}


def test_a_stored_submap_asks_with_its_own_stamp(stored: httpx.Client) -> None:
    body = {"submap_id": "late", "exclude": {"within_seconds": 35.0}, "limit": 10}
    answer = stored.post(QUERIES, json=body).json()
    assert [c["submap_id"] for c in answer["candidates"] if len(c["inliers"]) > 40] == ["next"]


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"exclude": {"within_seconds": 5.0}}, "/exclude/within_seconds"),
        ({"exclude": {"within_seconds": -1.0}}, "/exclude/within_seconds"),
        ({"exclude": {"session": ""}}, "/exclude/session"),
        ({"near": {"x": 0.0, "y": 0.0}}, "/near/radius"),
        ({"near": {"x": 0.0, "y": 0.0, "radius": 0.0}}, "/near/radius"),
        ({"near": {"x": 0.0, "y": 0.0, "radius": 1.0, "z": 2.0}}, "/near/z"),
        ({"near": {"x": "here", "y": 0.0, "radius": 1.0}}, "/near/x"),
    ],
)
def test_hints_that_cannot_be_used_are_named(stored: httpx.Client, body: dict[str, Any], pointer: str) -> None:
    response = stored.post(QUERIES, json={"xy": points(forest(1))} | body)
    assert response.status_code == 422
    assert [error["pointer"] for error in response.json()["errors"]] == [pointer]
