"""An answer is not much larger than it has to be: pairs of landmarks are limited, and what is left out is told."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app import create_app
from server.config.settings import Limits, Settings
from server.schemas.queries import QueryAnswer
from tests.server.factories import TestClient, forest, observed, points
from urquhart.propose import by_correlation, levels
from urquhart.report.explanation import SKIPS, STOPS

TREES = forest(1)
QUERIES = "/v1/collections/plots/queries"
SUBMAPS = 4
MOST = 2 * len(TREES)
SEEN, _ = observed(TREES, 7, sigma=0.01)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[httpx.Client]:
    """A service that gives two candidates their pairs, and one place stored four times."""
    settings = Settings(database=str(tmp_path / "a.db"), limits=Limits(answer_pairs=MOST))
    with TestClient(create_app(settings)) as started:
        started.put("/v1/collections/plots", json={}).raise_for_status()
        for i in range(SUBMAPS):
            started.put(f"/v1/collections/plots/submaps/p{i}", json={"xy": points(TREES)}).raise_for_status()
        yield started


def ask(client: httpx.Client, **members: Any) -> dict[str, Any]:
    answer: dict[str, Any] = (
        client.post(QUERIES, json={"xy": SEEN, "limit": SUBMAPS} | members).raise_for_status().json()
    )
    return answer


def carried(answer: dict[str, Any]) -> list[int]:
    """How many pairs each candidate lists; what it leaves out is told."""
    for one in answer["candidates"]:
        assert len(one["inliers"]) + one["inliers_omitted"] == one["inlier_count"]
        assert one["inliers_omitted"] in (0, one["inlier_count"])
    return [len(one["inliers"]) for one in answer["candidates"]]


def test_the_best_candidates_have_their_pairs_and_the_others_say_how_many(client: httpx.Client) -> None:
    given = carried(ask(client))
    assert len(given) == SUBMAPS
    assert sum(given) <= MOST
    assert given[0] > 0
    assert given[1] > 0
    assert given[2:] == [0, 0]


def test_pairs_can_be_left_out(client: httpx.Client) -> None:
    with_pairs, without = ask(client), ask(client, pairs=False)
    assert carried(without) == [0] * SUBMAPS
    same = ("submap_id", "transform", "inlier_count", "confidence", "refused")
    for one, other in zip(with_pairs["candidates"], without["candidates"], strict=True):
        assert [one[name] for name in same] == [other[name] for name in same]
    assert with_pairs["verdict"] == without["verdict"]


def test_a_batch_shares_the_pairs(client: httpx.Client) -> None:
    body = {"queries": [{"xy": SEEN, "limit": 1}, {"xy": "wrong"}, *[{"xy": SEEN, "limit": 1}] * 6]}
    results = client.post(f"{QUERIES}/batch", json=body).raise_for_status().json()["results"]
    answers = [one for one in results if "candidates" in one]
    assert len(answers) == 7
    assert sum(sum(carried(one)) for one in answers) <= MOST
    one_each = {"queries": [{"xy": SEEN, "limit": SUBMAPS}, {"xy": SEEN, "limit": 1}]}
    first, second = client.post(f"{QUERIES}/batch", json=one_each).raise_for_status().json()["results"]
    assert carried(first)[0] > 0, "the first of two takes its share,"
    assert carried(second)[0] > 0, "and leaves the second its own"


def test_a_put_that_asks_has_the_same_limit(client: httpx.Client) -> None:
    body = {"xy": SEEN, "query": {"limit": SUBMAPS}}
    answer = client.put("/v1/collections/plots/submaps/new", json=body).raise_for_status().json()["query"]
    assert 0 < sum(carried(answer)) <= MOST
    body["query"] = {"limit": SUBMAPS, "pairs": False}
    answer = client.put("/v1/collections/plots/submaps/newer", json=body).raise_for_status().json()["query"]
    assert sum(carried(answer)) == 0


def test_what_is_stored_has_the_pairs_whether_or_not_they_are_answered(client: httpx.Client) -> None:
    answer = ask(client, pairs=False, store=True)
    assert sum(carried(answer)) == 0
    stored = client.get(answer["links"]["self"]).json()
    assert carried(stored)[0] > 0
    drawn = client.get(answer["candidates"][0]["links"]["match"], headers={"Accept": "image/svg+xml"})
    assert drawn.text.count('class="pair"') == stored["candidates"][0]["inlier_count"]


def test_a_match_without_its_pairs_is_gone_and_not_drawn_as_if_it_had_none(client: httpx.Client) -> None:
    answer = ask(client, store=True)
    assert carried(answer)[3] == 0
    gone = client.get(answer["candidates"][3]["links"]["match"])
    assert gone.status_code == 410
    assert "answer_pairs" in gone.json()["detail"]


def test_explain_has_the_sentences_of_the_explanation(client: httpx.Client) -> None:
    answer = ask(client, explain=True, store=True)
    sentences = client.get(answer["links"]["explanation"], headers={"Accept": "application/json"}).json()["sentences"]
    assert answer["sentences"] == sentences
    words = {answer["reason"]} | {one["refused"] for one in answer["candidates"] + answer["findings"]} - {None}
    assert set(sentences) >= words
    assert ask(client)["sentences"] is None


def test_ids_of_positions_are_text(client: httpx.Client) -> None:
    pairs = ask(client)["candidates"][0]["inliers"]
    assert {one["query"] for one in pairs} <= {str(i) for i in range(len(SEEN))}


def test_the_limit_is_published(client: httpx.Client) -> None:
    assert client.get("/v1/limits").json()["limits"]["answer_pairs"] == MOST


def test_an_answer_tells_how_the_search_ended(client: httpx.Client) -> None:
    answer = ask(client, store=True)
    assert answer["search"] == {
        "stopped_by": answer["search"]["stopped_by"],
        "skipped": [],
        "promised": None,
        "sentence": STOPS["decided"],
    }
    page = client.get(answer["links"]["explanation"], headers={"Accept": "application/json"}).json()
    assert page["search"] == answer["search"]
    drawing = client.get(answer["links"]["explanation"], headers={"Accept": "image/svg+xml"}).text
    assert STOPS["decided"].capitalize() in drawing


@pytest.mark.parametrize("per_session", [False, True])
def test_an_answer_tells_which_limit_left_something_out(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, per_session: bool
) -> None:
    """A collection that is too large to be searched exhaustively says so."""
    monkeypatch.setattr(by_correlation, "is_small", lambda index: False)
    monkeypatch.setattr(levels, "is_small", lambda index: False)
    answer = ask(client, xy=points(forest(99)), per_session=per_session)
    assert answer["verdict"] == "no_match"
    assert answer["search"]["stopped_by"] == "exhausted"
    assert answer["search"]["skipped"] == ["exhaustive_rest"]
    assert SKIPS["exhaustive_rest"] in answer["search"]["sentence"]


def test_a_fast_search_says_what_it_promises(client: httpx.Client) -> None:
    answer = ask(client, xy=points(forest(99, 40)), effort="fast", min_confidence=0.99)
    assert (answer["verdict"], answer["effort"]) == ("no_match", "fast")
    assert (answer["search"]["stopped_by"], answer["search"]["promised"]) == ("effort", None)
    many = ask(client, xy=points(forest(99, 80)), effort="fast")
    assert many["search"]["stopped_by"] == "evidence_bound"
    assert many["search"]["promised"] == {"sigma": 0.4, "detection": 0.8, "landmarks": 60}
    assert answer["gates"]["confidence"] == 0.99


def test_pairs_as_columns_are_the_same_pairs(client: httpx.Client) -> None:
    objects, columns = ask(client), ask(client, pair_format="columns")
    for one, other in zip(objects["candidates"], columns["candidates"], strict=True):
        assert other["inliers"] == []
        assert one["inliers_omitted"] == other["inliers_omitted"]
        if one["inliers_omitted"]:
            assert other["inlier_columns"] is None
            continue
        given = other["inlier_columns"]
        pairs = [(str(q), str(s)) for q, s in zip(given["query"], given["submap"], strict=True)]
        assert pairs == [(pair["query"], pair["submap"]) for pair in one["inliers"]]
        assert given["residual"] == pytest.approx([pair["residual"] for pair in one["inliers"]], abs=6e-5)


def test_columns_count_in_a_batch_and_are_not_stored(client: httpx.Client) -> None:
    query = {"xy": SEEN, "limit": 1, "pair_format": "columns"}
    sent = {"queries": [query | {"explain": True}, *[query] * 6]}
    results = client.post(f"{QUERIES}/batch", json=sent).raise_for_status().json()["results"]
    columns = [one["candidates"][0]["inlier_columns"] for one in results]
    assert 0 < sum(len(one["query"]) for one in columns if one is not None) <= MOST
    refused = client.post(QUERIES, json=query | {"store": True})
    assert refused.status_code == 422
    assert "pair_format" in refused.json()["detail"]


@pytest.mark.parametrize(
    "members",
    [{}, {"pairs": False}, {"pair_format": "columns"}, {"explain": True}, {"stamp": "2026-05-04T10:00:00.25+02:00"}],
)
def test_answers_are_what_their_model_says(client: httpx.Client, members: dict[str, Any]) -> None:
    pose = {"frame_id": "map", "x": 1.5, "y": -2.0, "yaw": 0.3, "covariance": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.01]}
    mapped = {"xy": points(TREES), "map_pose": pose, "session": "monday", "stamp": "2026-05-04T10:00:00Z"}
    client.put("/v1/collections/plots/submaps/mapped", json=mapped).raise_for_status()
    raw = client.post(QUERIES, json={"xy": SEEN} | members).raise_for_status().content
    modelled = QueryAnswer.model_validate_json(raw).model_dump_json()
    # As text, because the order of the members counts, too.
    assert json.dumps(json.loads(raw)) == json.dumps(json.loads(modelled))
