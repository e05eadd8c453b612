"""Stored answers of other versions: whatever member is missing, new or named otherwise, no reading of them fails."""

import copy
from collections.abc import Iterator
from typing import Any

import httpx
import orjson
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.queries.older_answers import completed
from server.schemas.queries import QueryAnswer
from server.service_parts import Service
from tests.server.conftest import settings_in
from tests.server.factories import TestClient, forest, observed, points, put_submap

QUERIES = "/v1/collections/plots/queries"
Path = tuple[str | int, ...]
JSON, SVG = {"Accept": "application/json"}, {"Accept": "image/svg+xml"}


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    """One for all tests of this module: each writes what it reads."""
    return create_app(settings_in(tmp_path_factory.mktemp("older")))


@pytest.fixture(scope="module")
def client(app: FastAPI) -> Iterator[httpx.Client]:
    """A client of the started app."""
    with TestClient(app) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        yield started


@pytest.fixture(scope="module")
def first(client: httpx.Client) -> dict[str, Any]:
    """An answer with a candidate, findings and a map pose, as it was stored."""
    pose = {"x": 100.0, "y": 50.0, "yaw": 0.1, "covariance": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.01]}
    put_submap(client, "plots", "p", 1, map_pose=pose, stamp="2026-05-04T09:00:00Z", session="s").raise_for_status()
    # A plantation beside it, for rivals.
    rows = [[4.0 * i, 4.0 * k] for i in range(7) for k in range(7)]
    client.put("/v1/collections/plots/submaps/rows", json={"xy": rows}).raise_for_status()
    seen, _ = observed(forest(1), 2)
    response = client.post(QUERIES, json={"xy": seen, "store": True, "explain": True}, headers={"Idempotency-Key": "k"})
    answer: dict[str, Any] = response.json()
    assert answer["verdict"] == "matched" and answer["findings"]
    return answer


@pytest.fixture
def stored(first: dict[str, Any], service: Service) -> Iterator[dict[str, Any]]:
    """The same, in the database again after each test, as are the candidates."""
    with service.database.read_connection() as connection:
        kept = connection.exec_driver_sql("SELECT answer, candidates FROM queries").one()
    yield copy.deepcopy(first)
    with service.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE queries SET answer = ?, candidates = ?", tuple(kept))


def write(service: Service, answer: Any, candidates: Any = None) -> None:
    with service.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE queries SET answer = ?", (orjson.dumps(answer),))
        if candidates is not None:
            connection.exec_driver_sql("UPDATE queries SET candidates = ?", (orjson.dumps(candidates).decode(),))


def read(client: httpx.Client) -> list[httpx.Response]:
    """The answer, its explanation and its match in each of their forms."""
    one = f"{QUERIES}/1"
    responses = [client.get(one)]
    responses += [client.get(f"{one}/explanation", headers=accept) for accept in (JSON, SVG)]
    responses += [client.get(f"{one}/candidates/1/match", headers=accept) for accept in (JSON, SVG)]
    for response in responses:
        assert response.status_code in (200, 404, 410), response.text
        if response.status_code == 410:
            assert "another version" in response.json()["detail"]
    return responses


def places(content: Any, path: Path = ()) -> Iterator[Path]:
    """Every member of every object, the first entry of lists only."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield (*path, name)
            yield from places(value, (*path, name))
    elif isinstance(content, list) and content:
        yield from places(content[0], (*path, 0))


def without(content: Any, path: Path, name: str | None = None) -> Any:
    """A copy in which the member at `path` is missing, or has another name."""
    changed = copy.deepcopy(content)
    there = changed
    for step in path[:-1]:
        there = there[step]
    value = there.pop(path[-1])
    if name is not None:
        there[name] = value
    return changed


def test_each_member_may_have_another_name(client: httpx.Client, service: Service, stored: dict[str, Any]) -> None:
    """Then one member is missing, and one is unknown."""
    tried = list(places(stored))
    assert len(tried) > 60
    for path in tried:
        write(service, without(stored, path, "called_otherwise"))
        answer = read(client)[0]
        assert answer.status_code == 200, path
        # Everything else is answered as it was.
        assert answer.json()["candidates"][:1] == stored["candidates"][:1] or path[0] == "candidates"


ADDED_LATER: list[Path] = [
    ("rivals",), ("findings",), ("findings_total",), ("gates",), ("gates", "lead"), ("sentences",), ("stages",),
    ("lead",), ("frame_id",), ("stamp",), ("links",), ("links", "explanation"), ("id",), ("collection",),
    ("candidates", 0, "session"), ("candidates", 0, "stamp"), ("candidates", 0, "frame_id"), ("candidates", 0, "links"),
    ("candidates", 0, "map_pose"), ("candidates", 0, "inliers_omitted"), ("candidates", 0, "refused"),
    ("candidates", 0, "transform", "covariance_frame"), ("candidates", 0, "transform", "middle"),
]  # fmt: skip


@pytest.mark.parametrize("path", ADDED_LATER)
def test_what_can_be_told_without_a_member_is_told(
    client: httpx.Client, service: Service, stored: dict[str, Any], path: Path
) -> None:
    write(service, without(stored, path))
    assert [response.status_code for response in read(client)] == [200] * 5, path


def test_all_that_has_a_value_for_nothing_may_be_missing_at_once(stored: dict[str, Any]) -> None:
    """New members must have a default, may be null, or be a list: then older answers are still read."""
    bare = {"verdict": "no_match", "reason": "no_proposal", "method": "robust", "revision": 1, "landmarks": 9}
    done = completed(QueryAnswer, bare)
    assert done["candidates"] == done["rivals"] == done["stages"] == []
    assert done["lead"] is done["findings"] is done["stamp"] is None
    whole = completed(QueryAnswer, stored | {"new": 1})
    assert whole == stored | {"new": 1}
    assert completed(QueryAnswer, stored | {"new": 1}, known_only=True) == stored


def test_each_member_of_a_match_may_be_missing(client: httpx.Client, service: Service, stored: dict[str, Any]) -> None:
    with service.database.read_connection() as connection:
        packed = orjson.loads(connection.exec_driver_sql("SELECT candidates FROM queries").scalar_one())
    for path in places(packed):
        write(service, stored, without(packed, path))
        assert [response.status_code for response in read(client)[:3]] == [200] * 3
    write(service, stored, [])
    assert [response.status_code for response in read(client)[3:]] == [410, 410]
    older = without(packed, (0, "uncertainty"))
    older[0] |= {"covariance": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.0001]], "of_old": 1}
    write(service, stored, older)
    assert [response.status_code for response in read(client)] == [200] * 5


def test_an_answer_that_is_given_again_may_be_of_another_version(
    client: httpx.Client, service: Service, stored: dict[str, Any]
) -> None:
    seen, _ = observed(forest(1), 2)
    body = {"xy": seen, "store": True, "explain": True}
    for path, status in ((("rivals",), 200), (("candidates", 0, "map_pose"), 200), (("verdict",), 410)):
        with service.database.write_connection() as connection:
            changed = orjson.dumps(without(stored, path))
            connection.exec_driver_sql("UPDATE idempotency SET body = ?", (changed,))
        response = client.post(QUERIES, json=body, headers={"Idempotency-Key": "k"})
        assert response.status_code == status, response.text
    assert client.post(QUERIES, json={"xy": points(forest(1))}).status_code == 200


def test_members_and_words_that_have_other_names_now(
    client: httpx.Client, service: Service, stored: dict[str, Any]
) -> None:
    answer, new = copy.deepcopy(stored), read(client)
    answer |= {"margin": answer.pop("lead"), "landmarks": answer.pop("landmark_count")}
    answer["gates"] |= {"lead_each": answer["gates"].pop("lead_per_landmark")}
    answer["gates"] |= {"lead_share": answer["gates"].pop("lead_ratio")}
    for one in answer["findings"]:
        one["inliers"] = one.pop("inlier_count")
    for one in (*answer["candidates"], *answer["findings"]):
        one["votes"] = one.pop("support")
        one["overlap"] = one.pop("overlap_ratio" if "rank" in one else "overlap_count")
    with service.database.read_connection() as connection:
        packed = orjson.loads(connection.exec_driver_sql("SELECT candidates FROM queries").scalar_one())
    for one in packed:
        one |= {"votes": one.pop("support"), "overlap": one.pop("overlap_ratio")}
    write(service, answer, packed)
    for old, now in zip(read(client), new, strict=True):
        assert old.json() == now.json() if "json" in now.headers["content-type"] else old.text == now.text
    answer["candidates"][0]["level"] = answer["findings"][0]["level"] = "sweep"
    answer["reason"] = answer["findings"][0]["refused"] = "runner_up_too_close"
    answer["search"]["stopped_by"] = "settled"
    write(service, answer)
    assert [one.status_code for one in read(client)] == [200] * 5
    renamed = read(client)[0].json()
    assert renamed["candidates"][0]["level"] == "exhaustive"
    assert renamed["reason"] == renamed["findings"][0]["refused"] == "rival_too_close"
    assert renamed["search"]["stopped_by"] == "decided"


def test_words_that_only_another_version_has(client: httpx.Client, service: Service, stored: dict[str, Any]) -> None:
    write(service, stored | {"reason": "of_old", "stages": [{"name": "of old", "milliseconds": 1, "counts": {"x": 1}}]})
    assert [response.status_code for response in read(client)] == [200] * 5
    for changed in ({"verdict": "perhaps"}, {"method": "older"}, {"stages": [{"name": 3}]}):
        write(service, stored | changed)
        assert [response.status_code for response in read(client)] == [200, 410, 410, 410, 410]
