"""Landmarks are described once a request, and never where their features are stored."""

import time
from collections.abc import Callable
from typing import Any, Final

import httpx
import pytest

from tests.server.factories import forest, observed
from tests.server.jobs.test_jobs import finished
from urquhart.features.tessellation import tessellate

COLLECTION: Final = "/v1/collections/plots"
ASK: Final = f"{COLLECTION}/queries"
Described = Callable[[Callable[[], httpx.Response]], tuple[int, Any]]


@pytest.fixture
def described(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> Described:
    """Send a request; how many sets of landmarks were described for it, and the answer. Five submaps are stored."""
    for number, (seed, session) in enumerate([(1, "mon"), (1, "tue"), (2, "mon"), (2, "tue"), (3, "wed")]):
        body = {"xy": observed(forest(seed), number)[0], "session": session}
        client.put(f"{COLLECTION}/submaps/p{number}", json=body).raise_for_status()
    while client.get("/readyz").status_code != 200:  # the warm-up describes, too
        time.sleep(0.01)
    calls = list[int]()

    def counted(*given: Any, **named: Any) -> Any:
        calls.append(1)
        return tessellate(*given, **named)

    monkeypatch.setattr("urquhart.features.describe.tessellate", counted)

    def send(ask: Callable[[], httpx.Response]) -> tuple[int, Any]:
        calls.clear()
        answer = ask()
        answer.raise_for_status()
        return len(calls), answer.json()

    return send


@pytest.mark.parametrize("more", [{}, {"per_session": True}, {"explain": True, "store": True}, {"method": "paper"}])
def test_a_query_describes_its_landmarks_once(client: httpx.Client, described: Described, more: Any) -> None:
    times, answer = described(lambda: client.post(ASK, json={"xy": observed(forest(1), 9)[0]} | more))
    assert times == 1
    assert answer["verdict"] == "matched"
    assert [stage["name"] for stage in answer["stages"]].count("describe") == 1


@pytest.mark.parametrize("more", [{}, {"per_session": True}])
def test_a_stored_submap_is_asked_about_by_its_stored_features(
    client: httpx.Client, described: Described, more: Any
) -> None:
    times, answer = described(lambda: client.post(ASK, json={"submap_id": "p0"} | more))
    assert times == 0
    assert answer["candidates"][0]["submap_id"] == "p1"


@pytest.mark.parametrize("method", ["PUT", "POST"])
def test_a_submap_that_is_asked_about_and_stored_is_described_once(
    client: httpx.Client, described: Described, method: str
) -> None:
    url = f"{COLLECTION}/submaps" + ("/new" if method == "PUT" else "")
    body = {"xy": observed(forest(1), 9)[0], "query": {}}
    times, answer = described(lambda: client.request(method, url, json=body))
    assert times == 1
    assert answer["query"]["verdict"] == "matched"


@pytest.mark.parametrize("properties", [None, {"operator": "new"}])
def test_a_submap_that_is_there_with_these_trees_is_not_described_again(
    client: httpx.Client, described: Described, properties: Any
) -> None:
    body = {"xy": observed(forest(1), 0)[0], "session": "mon", "query": {}, "properties": properties}
    times, answer = described(lambda: client.put(f"{COLLECTION}/submaps/p0", json=body))
    assert times == 0
    assert answer["query"]["candidates"][0]["submap_id"] == "p1"


def test_too_few_trees_are_asked_about_without_being_described(client: httpx.Client, described: Described) -> None:
    body = {"xy": [[0, 0], [3, 1]], "query": {}}
    times, answer = described(lambda: client.put(f"{COLLECTION}/submaps/few", json=body))
    assert times == 0
    assert answer["query"]["reason"] == "too_few_landmarks"


def test_a_search_for_constraints_describes_nothing(client: httpx.Client, described: Described) -> None:
    def search() -> httpx.Response:
        accepted = client.post(f"{COLLECTION}/constraints", json={})
        assert finished(client, accepted)["counts"]["constraints"] == 2
        return accepted

    times, _ = described(search)
    assert times == 0
