"""The poses of a session while its robot drives, over HTTP: rows in, poses out."""

from typing import Any

import httpx
import numpy as np
import orjson
import pytest

from server.constraints.extraction import search_of
from server.errors import PosesPending
from server.maps import session_poses, whole_searches
from server.maps.session_poses import SessionPoses
from server.schemas.maps.request import MapInput
from server.service_parts import Service
from server.store.repositories.maps.constraint_records import ConstraintRecord
from tests.urquhart.graphs import TrueGraph, drive
from urquhart import SE2
from urquhart.pose_covariance import PoseUncertainty

pytest.importorskip("gtsam", reason="there is no wheel of GTSAM for this platform")

URL = "/v1/collections/plots/sessions/mon/poses"


@pytest.fixture(scope="module")
def graph() -> TrueGraph:
    return drive(np.random.default_rng(3), 42, false=0.1)


def store(client: httpx.Client, service: Service, graph: TrueGraph, begin: int, end: int) -> None:
    """Store the submaps `begin` to `end` of a drive, their odometry, and the matches that a search would have found."""
    trees = np.random.default_rng(0).uniform(-20.0, 20.0, (12, 2)).tolist()
    for number in range(begin, end):
        client.put(f"/v1/collections/plots/submaps/s{number}", json={"xy": trees, "session": "mon"}).raise_for_status()
    given = graph.constraints
    last = np.maximum(given.first, given.second)
    some = np.flatnonzero((last >= begin) & (last < end)).tolist()
    odometry = [edge for edge in some if given.trusted[edge]]
    if odometry:
        edges = [edge_of(graph, edge) for edge in odometry]
        client.post("/v1/collections/plots/odometry", json={"edges": edges}).raise_for_status()
    with service.database.write() as tx:
        collection = tx.collections.get("plots")
        assert collection is not None
        revisions = {one.id: one.content_revision for one in tx.sessions(collection.key).members("mon")}
        rows = []
        for edge in sorted(set(some) - set(odometry)):
            ends = f"s{given.first[edge]}", f"s{given.second[edge]}"
            content = match_of(graph, edge)
            rows.append(
                ConstraintRecord(
                    "match", *ends, revisions[ends[0]], revisions[ends[1]], search_of(MapInput()), "job", "j1", content
                )
            )
        tx.constraints(collection.key).put(rows)


def edge_of(graph: TrueGraph, edge: int) -> dict[str, Any]:
    given = graph.constraints
    x, y, yaw = given.poses[edge].tolist()
    ends = {"from": f"s{given.first[edge]}", "to": f"s{given.second[edge]}"}
    return ends | {"x": x, "y": y, "yaw": yaw, "covariance": given.covariances[edge].ravel().tolist()}


def match_of(graph: TrueGraph, edge: int) -> dict[str, Any]:
    """What a constraint's row has of a match, as a search stores it."""
    given = graph.constraints
    pose = SE2(*given.poses[edge].tolist())
    known = PoseUncertainty.about_point(np.zeros(2), pose, given.covariances[edge])
    middle = {
        "source": known.source.tolist(),
        "target": known.target.tolist(),
        "covariance": known.covariance.ravel().tolist(),
        "information": np.linalg.inv(known.covariance).ravel().tolist(),
    }
    covariance = given.covariances[edge].ravel().tolist()
    return {"transform": {"x": pose.x, "y": pose.y, "yaw": pose.yaw, "covariance": covariance, "middle": middle}}


def positions(answer: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([[one["pose"]["x"], one["pose"]["y"]] for one in answer["poses"]])


def test_a_session_that_grows_has_the_poses_that_a_restart_gives(
    client: httpx.Client, service: Service, graph: TrueGraph
) -> None:
    store(client, service, graph, 0, 32)
    before = client.get(URL).raise_for_status()
    assert [one["id"] for one in before.json()["poses"]] == [f"s{i}" for i in range(32)]
    again = client.get(URL, headers={"If-None-Match": before.headers["ETag"]})
    assert again.status_code == 304 and not again.content
    for number in range(32, 42):
        store(client, service, graph, number, number + 1)
        client.get(URL, headers={"If-None-Match": before.headers["ETag"]}).raise_for_status()
    after = client.get(URL).json()
    assert after["settled"] and after["parts"] == [{"part": 1, "submaps": 42, "frame_of": "s0"}]
    # Another process, or this one after a restart, knows nothing but the rows.
    other = SessionPoses(service.database)
    restarted = httpx.Response(200, content=other.answer("plots", "mon", 600.0)).json()
    other.close()
    sigmas = np.sqrt([one["pose"]["covariance"][0] + one["pose"]["covariance"][4] for one in after["poses"]])
    assert (np.hypot(*(positions(after) - positions(restarted)).T) < 0.02 + 0.2 * sigmas).all()
    standings = {one["id"]: one["standing"] for one in restarted["constraints"]}
    assert standings == {one["id"]: one["standing"] for one in after["constraints"]}
    false = {
        frozenset((f"s{a}", f"s{b}"))
        for a, b in zip(graph.constraints.first[graph.false], graph.constraints.second[graph.false], strict=True)
    }
    for one in after["constraints"]:
        wrong = one["kind"] == "match" and frozenset((one["from"], one["to"])) in false
        assert (one["standing"] == "used") is not wrong
    assert not sigmas[0] and sigmas[1:].all()
    truth = SE2(*graph.truth[0].tolist()).inverse().apply(graph.truth[:, :2])
    assert (np.hypot(*(truth - positions(after)).T) < 0.01 + 4.0 * sigmas).all()


def test_submaps_and_constraints_that_go_are_no_longer_in_the_poses(
    client: httpx.Client, service: Service, graph: TrueGraph
) -> None:
    store(client, service, graph, 0, 12)
    whole = client.get(URL).json()
    client.delete("/v1/collections/plots/submaps/s11").raise_for_status()
    assert [one["id"] for one in client.get(URL).json()["poses"]] == [f"s{i}" for i in range(11)]
    gone = next(one for one in whole["constraints"] if (one["from"], one["to"]) == ("s0", "s1"))
    client.delete(f"/v1/collections/plots/constraints/{gone['id']}").raise_for_status()
    now = client.get(URL).json()
    assert gone["id"] not in {one["id"] for one in now["constraints"]}
    # Other landmarks: the constraints of the submap are stale.
    client.put("/v1/collections/plots/submaps/s10", json={"xy": [[0, 0], [3, 1], [5, 7]], "session": "mon"})
    now = client.get(URL).json()
    assert not [one for one in now["constraints"] if "s10" in (one["from"], one["to"])]
    assert [one["submaps"] for one in now["parts"] if one["frame_of"] == "s10"] == [1]
    client.delete("/v1/collections/plots/sessions/mon").raise_for_status()
    assert client.get(URL).status_code == 404


def test_errors_say_what_to_do(
    client: httpx.Client, service: Service, graph: TrueGraph, monkeypatch: pytest.MonkeyPatch
) -> None:
    for url in (URL, URL.replace("plots", "elsewhere")):
        refused = client.get(url)
        assert refused.status_code == 404 and refused.json()["type"] == "/problems/not-found"
    assert client.get(URL.replace("mon", "x" * 129)).status_code == 422
    store(client, service, graph, 0, 3)
    monkeypatch.setattr(session_poses, "_MOST", 2)
    refused = client.get(URL)
    assert refused.status_code == 409 and "Build a map of it instead" in refused.json()["detail"]


def test_only_the_sessions_asked_for_last_are_kept(
    client: httpx.Client, service: Service, graph: TrueGraph, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_poses, "_KEPT", 2)
    for session in ("a", "b", "c"):
        body = {"xy": [[0, 0], [3, 1], [5, 7]], "session": session}
        client.put(f"/v1/collections/plots/submaps/{session}", json=body).raise_for_status()
        answer = client.get(URL.replace("mon", session)).json()
        assert answer["poses"][0]["pose"] == {"x": 0.0, "y": 0.0, "yaw": 0.0, "covariance": [0.0] * 9}
    assert len(service.session_poses._kept) == 2


def test_a_search_that_takes_longer_than_a_query_may_goes_on(
    client: httpx.Client, service: Service, graph: TrueGraph, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Larger sessions are searched in a process of their own, and the next request finds what it found."""
    store(client, service, graph, 0, 12)
    expected = client.get(URL).json()
    monkeypatch.setattr(whole_searches, "_SMALL", 0)
    other = SessionPoses(service.database)
    try:
        with pytest.raises(PosesPending, match="the search goes on"):
            other.answer("plots", "mon", 0.0)
        assert orjson.loads(other.answer("plots", "mon", 600.0)) == expected
        # What is searched again meanwhile does not keep anybody waiting.
        kept = next(iter(other._kept.values()))
        assert kept.poses is not None
        kept.poses._due, kept.not_before = True, 0.0
        assert not orjson.loads(other.answer("plots", "mon", 0.5))["settled"]
        assert kept.search is not None
        kept.search.result(600.0)
        assert orjson.loads(other.answer("plots", "mon", 0.5)) == expected
        kept.poses._due, kept.not_before = True, 0.0
        other.answer("plots", "mon", 0.5)
    finally:
        other.close()  # while a search runs
