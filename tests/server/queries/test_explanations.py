"""Why an answer is what it is: rivals and findings in the answer, explanations of stored ones."""

import json
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict
from typing import Any, get_args

import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from server.app import create_app
from server.config.settings import Limits, Settings
from server.queries.answers import strongest
from server.schemas.queries import FINDINGS
from server.service_parts import Service
from tests.server.factories import TestClient, forest, observed, points, put_submap
from urquhart import SE2, Config, Finding, Gates
from urquhart.evaluation.simulation import Sensor, observe, plantation
from urquhart.propose.query import LevelName
from urquhart.report.explanation import REASONS

PLOTS = "/v1/collections/plots"
QUERIES = f"{PLOTS}/queries"
JSON = {"Accept": "application/json"}
SVG = {"Accept": "image/svg+xml"}
ROWS = plantation(90.0, 90.0, np.random.default_rng(8), jitter=0.05, survival=0.97)
STORED = observe(ROWS, SE2(45.0, 45.0, 0.3), Sensor(20.0, sigma=0.1, detection=0.95), np.random.default_rng(1))
ASKED = observe(ROWS, SE2(46.0, 47.0, -2.0), Sensor(20.0, sigma=0.1, detection=0.95), np.random.default_rng(2))


def ask(client: httpx.Client, **body: Any) -> dict[str, Any]:
    """The answer to a query that must be answered."""
    response = client.post(QUERIES, json=body).raise_for_status()
    answer: dict[str, Any] = response.json()
    return answer


def ambiguous(client: httpx.Client, **fields: Any) -> dict[str, Any]:
    """The answer in the rows of a plantation."""
    client.put(f"{PLOTS}/submaps/rows", json={"xy": points(STORED.xy)}).raise_for_status()
    return ask(client, xy=points(ASKED.xy), **fields)


def test_rivals_are_named_the_strongest_first(client: httpx.Client) -> None:
    answer = ambiguous(client, store=True)
    best, rivals = answer["candidates"][0], answer["rivals"]
    assert answer["reason"] == "rival_too_close"
    assert rivals
    assert [rival["evidence"] for rival in rivals] == sorted((r["evidence"] for r in rivals), reverse=True)
    assert answer["lead"] == pytest.approx(best["evidence"] - rivals[0]["evidence"])
    for rival in rivals:
        assert rival["submap_id"] == "rows"
        assert set(rival["transform"]) == {"x", "y", "yaw"}
        assert rival["inlier_count"] > 20
        assert rival["links"] == {"submap": f"{PLOTS}/submaps/rows"}
    assert client.get(f"{QUERIES}/1").json()["rivals"] == rivals


def test_a_rival_may_be_in_another_submap(client: httpx.Client) -> None:
    """Two patches of one plantation, far apart, are two places."""
    rng = np.random.default_rng(4)
    for name, pose in (("here", SE2(25.0, 25.0, 0.0)), ("there", SE2(65.0, 65.0, 1.0))):
        seen = observe(ROWS, pose, Sensor(18.0, sigma=0.1), rng)
        client.put(f"{PLOTS}/submaps/{name}", json={"xy": points(seen.xy)}).raise_for_status()
    seen = observe(ROWS, SE2(26.0, 24.0, 2.0), Sensor(18.0, sigma=0.1), rng)
    answer = ask(client, xy=points(seen.xy), limit=1, store=True)
    assert len(answer["candidates"]) == 1
    assert {rival["submap_id"] for rival in answer["rivals"]} <= {"here", "there"}
    assert client.get(answer["links"]["explanation"]).status_code == 200


def test_a_match_has_no_rivals_and_the_gates_are_the_collections(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    answer = ask(client, xy=points(forest(1)))
    assert (answer["verdict"], answer["rivals"]) == ("matched", [])
    assert (answer["findings"], answer["findings_total"]) == (None, None)
    assert answer["links"]["explanation"] is None
    config = Config()
    assert answer["gates"] == asdict(Gates.of(config)) | {"confidence": 1.0 / (1.0 + math.exp(-config.gate))}
    client.put("/v1/collections/strict", json={"config": {"gate": 9.5}}).raise_for_status()
    strict = client.post("/v1/collections/strict/queries", json={"xy": []}).json()
    assert strict["gates"]["confidence"] == pytest.approx(1.0 - 7.4846e-5, abs=1e-9)  # 1 / (1 + exp(-9.5))
    assert strict["reason"] == "too_few_landmarks"


def test_findings_say_what_each_level_found(client: httpx.Client) -> None:
    for i in range(4):
        put_submap(client, "plots", f"p{i}", i).raise_for_status()
    answer = ask(client, xy=observed(forest(2), 1, sigma=0.2)[0], explain=True)
    assert answer["findings_total"] == len(answer["findings"]) > 0
    best = next(found for found in answer["findings"] if found["submap_id"] == "p2")
    assert best["refused"] is None
    assert best["log_odds"] > answer["gates"]["log_odds"]
    assert 0 < best["inlier_count"] <= best["overlap_count"] <= 60
    foreign = ask(client, xy=points(forest(9)), explain=True)
    assert foreign["verdict"] == "no_match"
    assert {found["refused"] for found in foreign["findings"]} <= {"verification_failed", "below_gate"}
    assert {found["level"] for found in foreign["findings"]} <= set(get_args(LevelName))
    assert ask(client, xy=[], explain=True)["findings"] == []


def test_the_strongest_findings_are_answered_in_their_order() -> None:
    rng = np.random.default_rng(0)
    found = [Finding("quads", key, 1, 5, 9, 4.0, float(rng.normal()), None) for key in range(FINDINGS + 20)]
    kept = strongest(found)
    assert len(kept) == FINDINGS
    assert [one.key for one in kept] == sorted(one.key for one in kept)
    assert min(one.log_odds for one in kept) >= max(one.log_odds for one in found if one not in kept)


def test_a_stored_answer_keeps_its_findings_whatever_was_answered(client: httpx.Client) -> None:
    silent, asked = ambiguous(client, store=True), ambiguous(client, store=True, explain=True)
    assert silent["findings"] is None
    kept = client.get(f"{QUERIES}/1").json()
    assert kept["findings"]
    assert kept | {"findings": None, "findings_total": None, "sentences": None} == silent
    assert client.get(f"{QUERIES}/2").json() == asked


def test_an_explanation_as_data(client: httpx.Client) -> None:
    answer = ambiguous(client, store=True, explain=True)
    url = answer["links"]["explanation"]
    assert url == f"{QUERIES}/1/explanation"
    response = client.get(url, headers=JSON)
    assert (response.headers["Content-Type"], response.headers["Vary"]) == (
        "application/json",
        "Accept, Accept-Encoding",
    )
    told = response.json()
    shared = ("collection", "verdict", "reason", "lead", "gates", "stages", "findings", "findings_total", "rivals")
    assert {name: told[name] for name in shared} == {name: answer[name] for name in shared}
    assert told["query_id"] == "1"
    assert told["links"] == {"self": url, "query": f"{QUERIES}/1"}
    words = {told["reason"], *(found["refused"] for found in told["findings"])} - {None}
    assert told["sentences"] == {word: REASONS[word] for word in words}


def test_an_explanation_as_a_drawing(client: httpx.Client) -> None:
    url = ambiguous(client, store=True)["links"]["explanation"]
    for accept in ("image/svg+xml", "image/*", "image/svg+xml, */*;q=0.8"):
        drawing = client.get(url, headers={"Accept": accept})
        assert (drawing.headers["Content-Type"], drawing.headers["Vary"]) == (
            "image/svg+xml",
            "Accept, Accept-Encoding",
        )
    said = [text.text for text in ElementTree.fromstring(drawing.text).iter() if text.tag.endswith("text")]
    assert "query 1: ambiguous" in said
    assert "best: rows" in said
    assert "rival: rows" in said
    assert any(words is not None and words.startswith("It leads the best other pose by") for words in said)


def test_every_verdict_can_be_drawn(client: httpx.Client) -> None:
    bodies: list[dict[str, Any]] = [{"xy": []}, {"xy": points(forest(1))}]
    drawn = [ask(client, **body, store=True)["links"]["explanation"] for body in bodies]
    put_submap(client, "plots", "p", 1).raise_for_status()
    bodies += [{"xy": points(forest(9))}, {"xy": points(forest(1)), "method": "paper", "seed": 1}, {"submap_id": "p"}]
    drawn += [ask(client, **body, store=True)["links"]["explanation"] for body in bodies]
    for url in drawn:
        ElementTree.fromstring(client.get(url, headers=SVG).raise_for_status().text)
        client.get(url, headers=JSON).raise_for_status()


def test_of_a_submap_that_changed_the_numbers_stay(client: httpx.Client) -> None:
    url = ambiguous(client, store=True)["links"]["explanation"]
    before = client.get(url, headers=JSON).json()
    put_submap(client, "plots", "rows", 3).raise_for_status()
    for _ in range(2):
        drawing = client.get(url, headers=SVG).raise_for_status().text
        assert "no longer those that were searched" in drawing
        assert "best: rows" not in drawing
        assert client.get(url, headers=JSON).json() == before
        client.delete(f"{PLOTS}/submaps/rows")


def test_an_answer_stored_by_an_older_version_is_explained_as_far_as_it_goes(
    client: httpx.Client, service: Service
) -> None:
    answer = ambiguous(client, store=True)
    older = {name: answer[name] for name in answer if name not in ("rivals", "gates", "findings", "findings_total")}
    del older["links"]["explanation"]
    with service.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE queries SET answer = ?", (json.dumps(older).encode(),))
    read = client.get(f"{QUERIES}/1").json()
    assert (read["rivals"], read["findings"]) == ([], None)
    assert read["links"]["explanation"] == f"{QUERIES}/1/explanation"
    told = client.get(f"{QUERIES}/1/explanation", headers=JSON).json()
    assert (told["stages"], told["gates"]) == (answer["stages"], answer["gates"])
    drawing = client.get(f"{QUERIES}/1/explanation", headers=SVG).text
    assert "was not kept with this answer" in drawing
    assert "best: rows" in drawing
    for path in (f"{QUERIES}/1/explanation", f"{QUERIES}/1/candidates/1/match"):
        types = [client.get(path, headers={"Accept": wanted}).headers["Content-Type"] for wanted in ("*/*", "image/*")]
        assert types == ["application/json", "image/svg+xml"]


def test_explanations_that_are_not_there(settings: Settings) -> None:
    few: FastAPI = create_app(settings.model_copy(update={"limits": Limits(stored_queries=1)}))
    with TestClient(few) as client:
        client.put(PLOTS, json={}).raise_for_status()
        for _ in range(2):
            ask(client, xy=[], store=True)
        statuses = [client.get(f"{QUERIES}/{name}/explanation").status_code for name in ("0", "1", "2", "3", "x")]
        assert statuses == [404, 410, 200, 404, 404]
        assert client.get(f"{QUERIES}/1/explanation").json()["type"] == "/problems/gone"
        assert client.get("/v1/collections/moon/queries/1/explanation").status_code == 404
        refused = client.get(f"{QUERIES}/2/explanation", headers={"Accept": "image/png"})
        assert (refused.status_code, refused.json()["type"]) == (406, "/problems/not-acceptable")
        for method in ("POST", "PUT", "PATCH", "DELETE"):
            refused = client.request(method, f"{QUERIES}/2/explanation")
            assert (refused.status_code, refused.headers["Allow"]) == (405, "GET, HEAD, OPTIONS")


@pytest.mark.parametrize("explain", [1, 0, "true", "yes", [True]])
def test_explain_is_true_or_false(shared_client: httpx.Client, explain: Any) -> None:
    response = shared_client.post(QUERIES, json={"xy": [], "explain": explain})
    assert response.status_code == 422
    (error,) = response.json()["errors"]
    assert (error["pointer"], error["code"]) == ("/explain", "bool_type")


def test_reasons_are_explained_in_the_openapi_document(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    for name in ("QueryAnswer", "ExplanationAnswer"):
        described = schemas[name]["properties"]["reason"]["description"]
        assert all(f"`{word}`: {text}" in described for word, text in REASONS.items())
    assert set(schemas["FindingAnswer"]["properties"]["level"]["enum"]) == set(get_args(LevelName))
    assert set(schemas["CandidateAnswer"]["properties"]["level"]["enum"]) == set(get_args(LevelName))
