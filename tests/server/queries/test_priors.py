"""A query whose rough pose is known: only the window of its prior is searched, and priors that cannot be used."""

from typing import Any

import httpx
import numpy as np
import pytest

from server.queries import search
from tests.server.factories import TestClient, forest, points, put_submap
from urquhart import SE2, Budget, Recognition, Recognizer, unsearched

PLOTS = "/v1/collections/plots"
QUERIES = f"{PLOTS}/queries"
POSE = SE2(1000.0, 500.0, 0.4)
"""`map_T_submap` of the submap `here`."""
TRUTH = SE2(1003.0, 498.0, 0.2)
"""`map_T_query`."""
ROUND = [4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.001]


def seen() -> list[list[float]]:
    """The trees within 20 m of the middle, off by 0.4 m, as seen from `TRUTH`."""
    trees = forest(1)
    near = trees[np.hypot(*trees.T) < 20.0]
    moved = (TRUTH.inverse() @ POSE).apply(near)
    return points(moved + np.random.default_rng(2).normal(0.0, 0.4, moved.shape))


def prior(**changes: Any) -> dict[str, Any]:
    """A prior near the truth."""
    return {"frame_id": "site", "x": 1004.0, "y": 499.0, "yaw": 0.22, "covariance": ROUND} | changes


@pytest.fixture(scope="module")
def stored(shared_client: httpx.Client) -> httpx.Client:
    """Two submaps in the frame `site`, 2 km apart, with the same trees."""
    for name, x in (("here", POSE.x), ("twin", POSE.x + 2000.0)):
        pose = {"frame_id": "site", "x": x, "y": POSE.y, "yaw": POSE.yaw}
        put_submap(shared_client, "plots", name, 1, map_pose=pose).raise_for_status()
    return shared_client


def ask(client: httpx.Client, **body: Any) -> dict[str, Any]:
    """The answer to a query that must be answered."""
    response = client.post(QUERIES, json={"xy": seen(), "prior": prior()} | body)
    assert response.status_code == 200, response.text
    answer: dict[str, Any] = response.json()
    return answer


def problem(client: httpx.Client, **body: Any) -> dict[str, Any]:
    """What is wrong with a query that must be refused: the first of `errors`."""
    response = client.post(QUERIES, json={"xy": seen(), "prior": prior()} | body)
    assert response.status_code == 422, response.text
    first: dict[str, Any] = response.json()["errors"][0]
    return first


def test_the_plot_is_found_in_its_window_and_not_in_its_twin(stored: httpx.Client) -> None:
    answer = ask(stored, explain=True)
    assert (answer["verdict"], len(answer["candidates"])) == ("matched", 1)
    best = answer["candidates"][0]
    assert (best["submap_id"], best["level"], best["refused"]) == ("here", "given", None)
    assert (best["map_pose"]["x"], best["map_pose"]["y"]) == pytest.approx((TRUTH.x, TRUTH.y), abs=0.4)
    assert answer["search"]["stopped_by"] == "window"
    assert "none outside of it" in answer["search"]["sentence"]
    assert {stage["name"] for stage in answer["stages"]} >= {"search window"}


def test_what_lies_outside_of_the_window_is_not_matched(stored: httpx.Client) -> None:
    for away in ({"x": 1020.0}, {"yaw": 1.0}, {"x": 2004.0}):
        answer = ask(stored, prior=prior(**away))
        assert answer["verdict"] != "matched", away
    far = ask(stored, prior=prior(x=1500.0))
    assert (far["verdict"], far["reason"], far["candidates"]) == ("no_match", "all_filtered_out", [])


def test_the_point_that_is_known_need_not_be_the_origin(stored: httpx.Client) -> None:
    about = [12.0, -5.0]
    x, y = TRUTH.apply(np.array([about]))[0].tolist()
    answer = ask(stored, prior=prior(x=x + 1.0, y=y - 1.0, about=about))
    assert answer["verdict"] == "matched"
    assert answer["candidates"][0]["map_pose"]["x"] == pytest.approx(TRUTH.x, abs=0.4)


def test_without_a_heading_every_rotation_is_tried(stored: httpx.Client) -> None:
    answer = ask(stored, prior=prior(yaw=None, covariance=[1.0, 0, 0, 0, 1.0, 0, 0, 0, 0]))
    assert answer["verdict"] == "matched"
    assert answer["candidates"][0]["map_pose"]["yaw"] == pytest.approx(TRUTH.yaw, abs=0.05)


def test_submaps_that_are_left_out_are_not_searched(stored: httpx.Client) -> None:
    answer = ask(stored, exclude={"submap_ids": ["here"]})
    assert (answer["verdict"], answer["reason"]) == ("no_match", "all_filtered_out")


@pytest.mark.parametrize(
    ("change", "pointer", "words"),
    [
        ({"covariance": [0.0] * 9}, "/prior/covariance", "positive definite over x, y and yaw"),
        ({"covariance": [4.0, 0, 0, 0, 4.0, 0, 0, 0, 0]}, "/prior/covariance", "variance above 0"),
        ({"covariance": [4, 4, 0, 4, 4, 0, 0, 0, 1]}, "/prior/covariance", "correlations below 1"),
        ({"covariance": [-1.0, 0, 0, 0, 4.0, 0, 0, 0, 1]}, "/prior/covariance", "variance at position 0 is negative"),
        ({"covariance": [4.0, 4.0]}, "/prior/covariance", "9"),
        ({"yaw": 90.0}, "/prior/yaw", "radians"),
        ({"frame_id": "elsewhere"}, "/prior/frame_id", "there are 'site'"),
        ({"yaw": None, "covariance": [1e6, 0, 0, 0, 1e6, 0, 0, 0, 0]}, "/prior/covariance", "give a heading or"),
        ({"noise": 9.0}, "/prior/noise", "2"),
        ({"radius": 9.0}, "/prior/radius", ""),
    ],
)
def test_a_prior_that_cannot_be_used_is_refused(
    stored: httpx.Client, change: dict[str, Any], pointer: str, words: str
) -> None:
    error = problem(stored, prior=prior(**change))
    assert error["pointer"] == pointer
    assert words in error["detail"]


def test_the_papers_method_has_no_prior(stored: httpx.Client) -> None:
    error = problem(stored, method="paper")
    assert (error["pointer"], error["detail"].split(":")[0]) == ("/prior", "needs the method `robust`")


def test_too_many_submaps_in_a_window_are_refused(stored: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "MOST_SUBMAPS", 0)
    assert "leave submaps out with `exclude`" in problem(stored)["detail"]


def test_the_search_has_the_budget_of_the_request(stored: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    budgets = list[Budget]()

    def spend(self: Recognizer, *given: object, budget: Budget, **options: object) -> Recognition:
        budgets.append(budget)
        return unsearched("deadline")

    monkeypatch.setattr(Recognizer, "recognize_within", spend)
    answer = ask(stored, timeout_ms=300)
    assert (answer["verdict"], answer["reason"]) == ("no_match", "deadline")
    assert budgets[0].remaining < 0.3


def test_a_stored_submap_is_looked_for_elsewhere_in_its_window(stored: httpx.Client) -> None:
    answer = stored.post(
        QUERIES, json={"submap_id": "here", "prior": prior(x=3000.0, y=500.0, yaw=0.4), "pairs": False}
    ).json()
    assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", "twin")


def test_an_empty_collection_has_nothing_to_search(shared_client: TestClient) -> None:
    shared_client.put("/v1/collections/empty", json={}).raise_for_status()
    answer = shared_client.post("/v1/collections/empty/queries", json={"xy": seen(), "prior": prior()}).json()
    assert answer["reason"] == "empty_collection"
