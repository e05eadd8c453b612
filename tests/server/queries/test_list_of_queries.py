"""The list of stored queries: the newest first, page by page, of all verdicts or of one."""

from typing import Any

import httpx
import pytest

from server.queries.listing import newest
from tests.server.factories import forest, observed, points, put_submap

QUERIES = "/v1/collections/plots/queries"


def every_page(client: httpx.Client, **asked: Any) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    page = client.get(QUERIES, params=asked).raise_for_status()
    while True:
        found += page.json()["queries"]
        if "next" not in page.json():
            assert "Link" not in page.headers
            return found
        assert page.links["next"]["url"].startswith(f"{QUERIES}?")
        page = client.get(page.links["next"]["url"]).raise_for_status()


@pytest.fixture
def answers(client: httpx.Client) -> list[dict[str, Any]]:
    """Seven stored answers, of which every third one is `matched`, and one that is not stored."""
    put_submap(client, "plots", "p1", 1).raise_for_status()
    trees = [observed(forest(1 if number % 3 == 0 else 9), number)[0] for number in range(7)]
    client.post(QUERIES, json={"xy": trees[0]}).raise_for_status()
    asked = [client.post(QUERIES, json={"xy": xy, "store": True}).raise_for_status() for xy in trees]
    return [one.json() for one in asked]


def test_the_newest_come_first(client: httpx.Client, answers: list[dict[str, Any]]) -> None:
    listed = every_page(client)
    assert [one["id"] for one in listed] == [str(number) for number in range(7, 0, -1)]
    for one, answer in zip(listed, reversed(answers), strict=True):
        best = answer["candidates"][0] if answer["candidates"] else None
        for name in ("verdict", "reason", "landmark_count", "revision", "links"):
            assert one[name] == answer[name]
        for name in ("submap_id", "inlier_count", "confidence"):
            assert one[name] == (None if best is None else best[name])
        assert one["created"].endswith("Z")
    assert listed[0]["created"] >= listed[-1]["created"]
    assert client.get(listed[0]["links"]["self"]).json()["id"] == "7"


@pytest.mark.parametrize("limit", [1, 2, 3, 7, 50])
@pytest.mark.parametrize("verdict", [None, "matched", "no_match", "ambiguous"])
def test_pages_follow_each_other(
    client: httpx.Client, answers: list[dict[str, Any]], limit: int, verdict: str | None
) -> None:
    expected = [one["id"] for one in reversed(answers) if verdict in (None, one["verdict"])]
    asked = {"limit": limit} | ({} if verdict is None else {"verdict": verdict})
    assert [one["id"] for one in every_page(client, **asked)] == expected


def test_a_rare_verdict_is_looked_for_page_by_page(
    client: httpx.Client, answers: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(newest, "_LOOKED_AT", 2)
    assert [one["id"] for one in every_page(client, verdict="matched", limit=5)] == ["7", "4", "1"]


def test_nothing_stored_is_an_empty_page_and_other_cursors_are_refused(client: httpx.Client) -> None:
    assert client.get(QUERIES).json() == {"queries": []}
    assert client.get("/v1/collections/none/queries").status_code == 404
    put_submap(client, "plots", "p1", 1).raise_for_status()
    put_submap(client, "plots", "p2", 2).raise_for_status()
    other = client.get("/v1/collections/plots/submaps", params={"limit": 1}).json()["next"]
    assert client.get(QUERIES, params={"cursor": other}).status_code == 422
    assert client.get(QUERIES, params={"verdict": "lost"}).status_code == 422
    client.post(QUERIES, json={"xy": points(forest(1)), "store": True}).raise_for_status()
    assert len(client.get(QUERIES).json()["queries"]) == 1
