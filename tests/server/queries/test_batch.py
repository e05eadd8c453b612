"""Several queries at once, and who has been where."""

from typing import Any

import httpx
import numpy as np
import pytest

from server.app import create_app
from server.config.settings import Limits, Settings
from tests.server.factories import TestClient, forest, observed, points, put_submap

BATCH = "/v1/collections/plots/queries/batch"


def _bare(answer: dict[str, Any]) -> dict[str, Any]:
    """What of an answer does not depend on the clock."""
    return {name: value for name, value in answer.items() if name != "stages"}


def test_each_is_answered_as_if_it_came_alone(client: httpx.Client) -> None:
    for seed in range(4):
        put_submap(client, "plots", f"p{seed}", seed).raise_for_status()
    queries: list[Any] = [{"xy": observed(forest(seed), seed)[0], "seed": 1} for seed in range(4)]
    queries += [{"xy": [[0, 0]]}, {"xy": points(forest(99))}, {"submap_id": "p1"}]
    response = client.post(BATCH, json={"queries": queries})
    assert response.status_code == 200, response.text
    results = response.json()["results"]
    assert [one["verdict"] for one in results] == ["matched"] * 4 + ["no_match"] * 3
    for query, result in zip(queries, results, strict=True):
        alone = client.post("/v1/collections/plots/queries", json=query).json()
        assert _bare(result) == _bare(alone)


def test_one_that_is_wrong_does_not_spoil_the_others(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    good = {"xy": points(forest(1))}
    wrong: list[Any] = [{}, {"xy": "x"}, {"xy": [[0, 0]], "limit": 0}, {"submap_id": "nope"}, {**good, "limit": 1000}]
    results = client.post(BATCH, json={"queries": [good, *wrong, good]}).json()["results"]
    assert [result.get("verdict") for result in results] == ["matched", *[None] * 5, "matched"]
    for query, result in zip(wrong, results[1:-1], strict=True):
        alone = client.post("/v1/collections/plots/queries", json=query).json()
        assert (result["problem"]["status"], result["problem"]["type"]) == (alone["status"], alone["type"])
        assert (result["problem"]["detail"], result["problem"].get("errors")) == (alone["detail"], alone.get("errors"))


@pytest.mark.parametrize("body", [{}, {"queries": []}, {"queries": [1]}, {"queries": [{}], "limit": 1}])
def test_batches_that_cannot_be(client: httpx.Client, body: Any) -> None:
    assert client.post(BATCH, json=body).status_code == 422


def test_limits_of_a_batch(settings: Settings) -> None:
    with TestClient(create_app(settings.model_copy(update={"limits": Limits(batch_queries=2)}))) as client:
        client.put("/v1/collections/plots", json={}).raise_for_status()
        assert client.post(BATCH, json={"queries": [{"xy": []}] * 2}).status_code == 200
        refused = client.post(BATCH, json={"queries": [{"xy": []}] * 3})
        assert (refused.status_code, refused.json()["limit"]) == (413, "batch_queries")
        assert client.post(BATCH.replace("plots", "nope"), json={"queries": [{}]}).status_code == 404


def test_who_has_been_here_and_when(client: httpx.Client) -> None:
    here, elsewhere = forest(1), forest(2)
    stamps = {"monday": "2026-05-04T09:00:00Z", "tuesday": "2026-05-05T09:00:00Z", "friday": "2026-05-08T09:00:00Z"}
    for i, (session, trees) in enumerate(
        [("monday", here), ("tuesday", here), ("tuesday", here), ("wednesday", elsewhere), ("friday", here)]
    ):
        seen, _ = observed(trees, i)
        client.put(
            f"/v1/collections/plots/submaps/s{i}", json={"xy": seen, "session": session, "stamp": stamps.get(session)}
        ).raise_for_status()
    seen, _ = observed(here, 50)
    ask = {"xy": seen, "per_session": True, "limit": 10}
    answer = client.post("/v1/collections/plots/queries", json=ask).json()
    assert answer["verdict"] == "matched"
    found = {one["session"]: one["stamp"] for one in answer["candidates"]}
    assert found == stamps
    assert len(answer["candidates"]) == 3
    assert [one["rank"] for one in answer["candidates"]] == [1, 2, 3]
    assert all(one["refused"] is None for one in answer["candidates"])
    assert len(client.post("/v1/collections/plots/queries", json=ask | {"limit": 2}).json()["candidates"]) == 2
    without = ask | {"exclude": {"session": "monday"}}
    answer = client.post("/v1/collections/plots/queries", json=without).json()
    assert {one["session"] for one in answer["candidates"]} == {"tuesday", "friday"}
    nowhere = client.post("/v1/collections/plots/queries", json=ask | {"xy": points(forest(77))}).json()
    assert nowhere["verdict"] == "no_match"
    assert all(one["refused"] for one in nowhere["candidates"])


def test_submaps_without_a_session_count_as_one(client: httpx.Client) -> None:
    for i in range(3):
        client.put(f"/v1/collections/plots/submaps/s{i}", json={"xy": observed(forest(1), i)[0]}).raise_for_status()
    body = {"xy": observed(forest(1), 9)[0], "per_session": True}
    answer = client.post("/v1/collections/plots/queries", json=body).json()
    assert [one["session"] for one in answer["candidates"]] == [None]
    assert np.isfinite(answer["candidates"][0]["rms"])
