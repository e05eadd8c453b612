"""What is wrong with the coordinates of one side is told in answers, constraints and on the command line."""

from typing import Any

import httpx
import numpy as np
import orjson

from tests.server.factories import forest, observed, points, put_submap
from tests.server.jobs.test_jobs import finished
from urquhart.verify.distortion import WARNINGS

PLOTS = "/v1/collections/plots"


def ask(client: httpx.Client, xy: Any, **body: Any) -> Any:
    response = client.post(f"{PLOTS}/queries", json={"xy": xy, **body})
    assert response.status_code == 200, response.text
    return response.json()


def test_a_distorted_query_is_told(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    seen, _ = observed(forest(1), 2)
    assert ask(client, seen)["candidates"][0]["warnings"] == []
    for shape, word in (
        (np.diag([1.01, 1.01]), "scaled"),
        (np.diag([np.cos(np.radians(5.0)), 1.0]), "tilted"),
    ):
        answer = ask(client, points(np.array(seen) @ shape), explain=True, store=True)
        assert (answer["verdict"], answer["candidates"][0]["warnings"]) == ("matched", [word])
        assert answer["sentences"][word] == WARNINGS[word]
        match = client.get(answer["candidates"][0]["links"]["match"], headers={"Accept": "application/json"})
        assert match.json()["candidate"]["warnings"] == [word]
    far = points(np.array(seen) + (412_000.0, 5_820_000.0))
    answer = ask(client, far)
    assert answer["candidates"][0]["warnings"] == ["far_origin"]


def test_constraints_carry_warnings(client: httpx.Client) -> None:
    seen, _ = observed(forest(1), 2)
    client.put(f"{PLOTS}/submaps/a", json={"xy": seen}).raise_for_status()
    client.put(f"{PLOTS}/submaps/b", json={"xy": points(1.02 * forest(1))}).raise_for_status()
    job = finished(client, client.post(f"{PLOTS}/constraints", json={}))
    lines = client.get(job["links"]["results"]).content.splitlines()
    assert [orjson.loads(line)["warnings"] for line in lines] == [["scaled"]]


def test_a_mirror_image_is_told_where_it_is_asked_for(client: httpx.Client) -> None:
    for seed in range(4):
        put_submap(client, "plots", f"p{seed}", seed).raise_for_status()
    seen, _ = observed(forest(1), 2)
    mirrored = points(np.array(seen) * (1.0, -1.0))
    plain, explained = ask(client, mirrored), ask(client, mirrored, explain=True)
    assert (plain["verdict"], plain["warnings"]) == ("no_match", [])
    assert (explained["verdict"], explained["warnings"]) == ("no_match", ["mirrored"])
    assert explained["reason"] == plain["reason"]
    assert (plain["hints"], [one["word"] for one in explained["hints"]]) == ([], ["mirrored"])
    assert explained["sentences"]["mirrored"] == WARNINGS["mirrored"]
    assert ask(client, points(forest(99)), explain=True)["warnings"] == []
    assert ask(client, [], explain=True)["warnings"] == []


def test_a_collection_has_a_floor_of_what_can_be_known(client: httpx.Client) -> None:
    config = {"covariance_floor": 0.3, "covariance_floor_yaw": 0.02, "covariance_scale": 2.0}
    client.put("/v1/collections/wary", json={"config": config}).raise_for_status()
    told = {}
    for collection in ("plots", "wary"):
        put_submap(client, collection, "p", 1).raise_for_status()
        seen, _ = observed(forest(1), 2)
        answer = client.post(f"/v1/collections/{collection}/queries", json={"xy": seen}).json()
        told[collection] = np.reshape(answer["candidates"][0]["transform"]["middle"]["covariance"], (3, 3))
    np.testing.assert_allclose(told["wary"], 2.0 * told["plots"] + np.diag([0.09, 0.09, 4e-4]), rtol=1e-9)


def test_wrong_units_and_scales_are_told_where_it_is_asked_for(client: httpx.Client) -> None:
    client.patch("/v1/collections/plots", json={"crs": "EPSG:25832"}).raise_for_status()
    pose = {"x": 448_000.0, "y": 5_411_000.0, "yaw": 0.0}
    for seed in range(3):
        put_submap(client, "plots", f"p{seed}", seed, map_pose=pose).raise_for_status()
    seen, _ = observed(forest(1), 2)
    for factor, word in ((1.0 / 0.3048, "feet"), (0.3048, "metres"), (1.0 / np.cos(np.radians(48.85)), "mercator")):
        answer = ask(client, points(np.array(seen) * factor), explain=True)
        (hint,) = answer["hints"]
        assert (answer["verdict"], hint["word"], hint["submap_id"]) == ("no_match", word, "p1")
        assert abs(hint["factor"] * factor - 1.0) < 0.01
        assert "changed coordinates" in {stage["name"] for stage in answer["stages"]}
    (hint,) = ask(client, points(np.array(seen) * 1.065), explain=True)["hints"]
    assert hint["word"] == "scaled"
    assert abs(hint["factor"] * 1.065 - 1.0) < 0.01


def test_a_hint_is_for_the_window_of_a_prior_too(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1, map_pose={"x": 0.0, "y": 0.0, "yaw": 0.0}).raise_for_status()
    swapped = points(forest(1)[:, ::-1])
    prior = {"x": 1.0, "y": 0.0, "yaw": 0.0, "covariance": [1, 0, 0, 0, 1, 0, 0, 0, 0.001]}
    answer = ask(client, swapped, prior=prior, explain=True)
    assert (answer["verdict"], [one["word"] for one in answer["hints"]]) == ("no_match", ["mirrored"])
    assert ask(client, points(forest(7)), prior=prior, explain=True)["hints"] == []
