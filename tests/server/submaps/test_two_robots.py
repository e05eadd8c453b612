"""Robots that close loops at one place at the same time: whoever commits last is told of the others."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.config.settings import Limits
from server.queries import lookup, loop_closing
from server.schemas.submaps import SubmapInput
from server.store.sqlite.database import Database
from server.submaps import writes
from tests.server.factories import forest, observed, points
from tests.server.processes import Server

COLLECTION = "/v1/collections/plots"
SUBMAPS = f"{COLLECTION}/submaps"
PAIRS = 8


def places(count: int) -> Iterator[tuple[list[list[float]], list[list[float]]]]:
    """Two views of each of several places."""
    for seed in range(count):
        trees = forest(1000 + seed, 30)
        yield observed(trees, 2 * seed)[0], observed(trees, 2 * seed + 1)[0]


def untold(send: Callable[[int, str, Any], httpx.Response], count: int) -> list[int]:
    """Places at which neither of two robots that came at once was told of the other."""
    silent = []
    with ThreadPoolExecutor(2) as pool:
        for place, views in enumerate(places(count)):
            barrier = threading.Barrier(2)

            def arrive(robot: int, place: int = place, views: Any = views, barrier: Any = barrier) -> dict[str, Any]:
                barrier.wait()
                sent = {
                    "xy": views[robot],
                    "session": f"robot-{robot}",
                    "query": {"exclude": {"session": f"robot-{robot}"}},
                }
                answer = send(robot, f"r{robot}-{place}", sent)
                assert answer.status_code == 201, answer.text
                return dict(answer.json())

            receipts = list(pool.map(arrive, range(2)))
            told = [
                one["query"]["candidates"][0]["submap_id"] for one in receipts if one["query"]["verdict"] == "matched"
            ]
            last = max(receipts, key=lambda one: one["revision"])
            other = min(receipts, key=lambda one: one["revision"])
            if other["id"] not in told or last["query"]["revision"] < other["revision"]:
                silent.append(place)
    return silent


@pytest.mark.parametrize("method", ["PUT", "POST"])
def test_two_robots_at_once_are_told_of_each_other(client: httpx.Client, method: str) -> None:
    def send(_: int, name: str, sent: Any) -> httpx.Response:
        return client.put(f"{SUBMAPS}/{name}", json=sent) if method == "PUT" else client.post(SUBMAPS, json=sent)

    assert untold(send, PAIRS) == []


def test_two_robots_at_two_processes(tmp_path: Path, serve: Callable[..., Server]) -> None:
    servers = [serve(tmp_path / "shared.db") for _ in range(2)]
    servers[0].client.put(COLLECTION, json={}).raise_for_status()
    assert untold(lambda robot, name, sent: servers[robot].client.put(f"{SUBMAPS}/{name}", json=sent), PAIRS) == []


class Meanwhile:
    """Stores submaps between the searches of one question and the writes after them."""

    def __init__(self, database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
        self.waiting: list[tuple[str, list[list[float]]]] = []
        self.searches = 0
        look_up = lookup.look_up

        def looked_up(*arguments: Any, **options: Any) -> Any:
            self.searches += 1
            found = look_up(*arguments, **options)
            if self.waiting:
                name, xy = self.waiting.pop(0)
                writes.put(database, "plots", name, SubmapInput.model_validate({"xy": xy}), Limits())
            return found

        monkeypatch.setattr(loop_closing, "look_up", looked_up)


@pytest.fixture
def meanwhile(client: httpx.Client, app: Any, monkeypatch: pytest.MonkeyPatch) -> Meanwhile:
    return Meanwhile(app.state.service.database, monkeypatch)


def test_whoever_comes_between_search_and_write_is_found(client: httpx.Client, meanwhile: Meanwhile) -> None:
    (one, other), *_ = places(1)
    meanwhile.waiting = [("between", one)]
    receipt = client.put(f"{SUBMAPS}/p", json={"xy": other, "query": {}}).json()
    assert (receipt["query"]["verdict"], receipt["query"]["candidates"][0]["submap_id"]) == ("matched", "between")
    assert (receipt["query"]["revision"], receipt["revision"]) == (1, 2)
    assert meanwhile.searches == 2


@pytest.mark.parametrize("hint", [{"exclude": {"submap_ids": ["between"]}}, {"near": {"x": 0, "y": 0, "radius": 1}}])
def test_what_is_not_asked_for_is_not_searched_again(
    client: httpx.Client, meanwhile: Meanwhile, hint: dict[str, Any]
) -> None:
    (one, other), *_ = places(1)
    meanwhile.waiting = [("between", one)]
    # A submap of that id from before, so that it is known by then.
    client.put(f"{SUBMAPS}/between", json={"xy": points(forest(5))}).raise_for_status()
    receipt = client.put(f"{SUBMAPS}/p", json={"xy": other, "query": hint}).json()
    assert (receipt["outcome"], receipt["query"]["verdict"]) == ("created", "no_match")
    assert (receipt["query"]["revision"], meanwhile.searches) == (2, 1)


def test_an_earlier_version_of_its_own_is_not_found(client: httpx.Client, meanwhile: Meanwhile) -> None:
    (one, other), *_ = places(1)
    meanwhile.waiting = [("p", one)]
    receipt = client.put(f"{SUBMAPS}/p", json={"xy": other, "query": {}}).json()
    assert (receipt["outcome"], receipt["query"]["verdict"], meanwhile.searches) == ("replaced", "no_match", 1)


def test_in_a_crowd_it_is_looked_at_within_the_write(client: httpx.Client, meanwhile: Meanwhile) -> None:
    """Somebody stores a submap during each search. Strangers do not hold this one up; the one of this place is told."""
    (one, other), *_ = places(1)
    meanwhile.waiting = [(f"s{i}", points(forest(i))) for i in range(7)]
    receipt = client.put(f"{SUBMAPS}/p", json={"xy": other, "query": {}}).json()
    assert (receipt["query"]["verdict"], receipt["query"]["revision"], meanwhile.searches) == ("no_match", 3, 3)
    meanwhile.waiting, meanwhile.searches = [*((f"t{i}", points(forest(i + 20))) for i in range(3)), ("same", one)], 0
    receipt = client.put(f"{SUBMAPS}/q", json={"xy": other, "query": {"exclude": {"submap_ids": ["p"]}}}).json()
    assert (receipt["query"]["verdict"], meanwhile.searches) == ("no_match", 3)
    meanwhile.waiting, meanwhile.searches = [*((f"u{i}", points(forest(i + 40))) for i in range(2)), ("here", one)], 0
    excluded = {"exclude": {"submap_ids": ["p", "q"]}}
    receipt = client.put(f"{SUBMAPS}/r", json={"xy": other, "query": excluded}).json()
    assert (receipt["query"]["candidates"][0]["submap_id"], meanwhile.searches) == ("here", 4)


def test_where_it_never_ends_nothing_is_stored(client: httpx.Client, meanwhile: Meanwhile) -> None:
    (one, other), *_ = places(1)
    meanwhile.waiting = [(f"s{i}", one) for i in range(50)]
    refused = client.put(f"{SUBMAPS}/p", json={"xy": other, "query": {}})
    assert (refused.status_code, refused.json()["type"]) == (503, "/problems/overloaded")
    assert refused.headers["Retry-After"] == "1"
    assert client.get(f"{SUBMAPS}/p").status_code == 404
