"""Constraints: found from both sides, told once, in every format the same."""

import math
from types import SimpleNamespace
from typing import Any

import httpx
import numpy as np
import orjson
import pytest

from server.constraints.extraction import agree
from server.constraints.formats import StoredSubmap, write_out
from server.errors import StorageBusy
from server.jobs import runner, running_job
from server.jobs.folder import JobFolder
from server.jobs.running_job import RunningJob
from server.jobs.types import find_constraints as constraints_job
from server.queries.lookup import look_up
from server.queries.poses import transform_answer
from server.store.submap_records import Place
from tests.server.factories import forest, observed
from tests.server.jobs.test_jobs import finished
from urquhart import SE2
from urquhart.pose_covariance import least_squares

URL = "/v1/collections/plots/constraints"


def place(client: httpx.Client, name: str, trees: Any, seed: int, **fields: Any) -> SE2:
    """Store what is seen of trees from somewhere; world_T_submap."""
    seen, world_T_submap = observed(trees, seed)
    client.put(f"/v1/collections/plots/submaps/{name}", json={"xy": seen, **fields}).raise_for_status()
    return world_T_submap


@pytest.fixture
def truth(client: httpx.Client) -> dict[str, SE2]:
    """Two places, seen twice and three times, and one seen once."""
    poses = {}
    for i, (name, seed, session) in enumerate(
        [("a1", 1, "mon"), ("a2", 1, "tue"), ("b1", 2, "mon"), ("b2", 2, "mon"), ("b3", 2, "tue"), ("c", 3, "mon")]
    ):
        stamp = f"2026-05-04T09:0{i}:00Z"
        poses[name] = place(client, name, forest(seed), i, session=session, stamp=stamp)
    return poses


def found(client: httpx.Client, body: Any) -> list[dict[str, Any]]:
    job = finished(client, client.post(URL, json=body))
    assert job["state"] == "successful", job
    return [orjson.loads(line) for line in client.get(job["links"]["results"]).content.splitlines()]


def pairs(constraints: list[dict[str, Any]]) -> set[frozenset[str]]:
    named = [frozenset((one["from"], one["to"])) for one in constraints]
    assert len(set(named)) == len(named)
    return set(named)


ALL = {frozenset(pair) for pair in (("a1", "a2"), ("b1", "b2"), ("b1", "b3"), ("b2", "b3"))}


def test_what_is_seen_twice_is_tied_together(client: httpx.Client, truth: dict[str, SE2]) -> None:
    constraints = found(client, {})
    assert pairs(constraints) == ALL
    for one in constraints:
        at = one["transform"]
        expected = truth[one["from"]].inverse() @ truth[one["to"]]
        shift, turn = SE2(at["x"], at["y"], at["yaw"]).distance(expected)
        assert shift < 0.1
        assert turn < 0.01
        assert one["confidence"] > 0.999
        assert (one["from_session"], one["to_session"]) != (None, None)


def test_filters_gates_and_exclusions(client: httpx.Client, truth: dict[str, SE2]) -> None:
    assert truth
    across = ALL - {frozenset(("b1", "b2"))}
    assert pairs(found(client, {"exclude": {"same_session": True}})) == across
    assert pairs(found(client, {"exclude": {"within_seconds": 61}})) == {frozenset(("b1", "b3"))}
    # Both together leave out what is of one session and close in time, as in queries.
    both = {"exclude": {"same_session": True, "within_seconds": 61}}
    assert pairs(found(client, both)) == ALL - {frozenset(("b1", "b2"))}
    assert pairs(found(client, {"exclude": {"same_session": True, "within_seconds": 59}})) == ALL
    assert pairs(found(client, {"session": "tue", "exclude": {"same_session": True}})) == across
    assert pairs(found(client, {"submap_ids": ["a2", "c"]})) == {frozenset(("a1", "a2"))}
    assert found(client, {"gates": {"inlier_count": 1000}}) == []
    assert found(client, {"gates": {"rms": 0.001}}) == []
    assert found(client, {"datetime": "2020-01-01T00:00:00Z/2021-01-01T00:00:00Z"}) == []
    assert found(client, {"bbox": [0, 0, 1, 1]}) == []
    for wrong, pointer in (
        ({"gates": {"confidence": 2}}, "/gates/confidence"),
        ({"datetime": "x"}, "/datetime"),
        ({"bbox": [5, 0, 1, 1]}, "/bbox"),
        ({"sesion": "x"}, "/sesion"),
        ({"submap_ids": ["a2", "nope", "c"]}, "/submap_ids/1"),
    ):
        refused = client.post(URL, json=wrong)
        assert (refused.status_code, refused.json()["errors"][0].get("pointer")) == (422, pointer)


def test_every_format_tells_the_same(client: httpx.Client, truth: dict[str, SE2]) -> None:
    job = finished(client, client.post(URL, json={}))
    url = job["links"]["results"]
    lines = [orjson.loads(line) for line in client.get(url).content.splitlines()]
    assert client.get(url, params={"format": "json"}).json() == {"constraints": lines}
    assert client.get(url, params={"format": "ndjson"}).content == client.get(url).content
    matrices = client.get(url, params={"format": "matrices"}).text.splitlines()
    assert len(matrices) == len(lines)
    for one, text in zip(lines, matrices, strict=True):
        first, second, *numbers = text.split()
        matrix = np.array(numbers, float).reshape(4, 4)
        expected = truth[first].inverse() @ truth[second]
        assert (first, second) == (one["from"], one["to"])
        xy = np.array([[1.0, 2.0], [-3.0, 0.5]])
        moved = np.column_stack([xy, np.zeros(2), np.ones(2)]) @ matrix.T
        np.testing.assert_allclose(moved[:, :2], expected.apply(xy), atol=0.15)
    text = client.get(url, params={"format": "g2o"}).text
    names = dict(line[2:].split() for line in text.splitlines() if line.startswith("# "))
    vertices = {
        fields[1]: SE2(*map(float, fields[2:5]))
        for fields in map(str.split, text.splitlines())
        if fields[0] == "VERTEX_SE2"
    }
    edges = [line.split() for line in text.splitlines() if line.startswith("EDGE_SE2")]
    assert len(edges) == len(lines)
    for edge in edges:
        measured = SE2(*map(float, edge[3:6]))
        expected = truth[names[edge[1]]].inverse() @ truth[names[edge[2]]]
        assert measured.distance(expected)[0] < 0.1
        # Vertices begin where the constraints put them.
        assert (vertices[edge[1]].inverse() @ vertices[edge[2]]).distance(measured)[0] < 0.2
        a, b, c, d, e, f = map(float, edge[6:])
        assert np.all(np.linalg.eigvalsh(np.array([[a, b, c], [b, d, e], [c, e, f]])) > 0)
    assert client.get(url, params={"format": "kml"}).status_code == 422


def test_a_search_that_is_stopped_at_any_point_finds_the_same(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where more was written than was noted, or the end was noted and nothing after it."""
    assert truth
    expected = found(client, {})
    monkeypatch.setattr("server.jobs.types.find_constraints._PAGE", 2)
    monkeypatch.setattr(runner, "_LOOK", 0.01)
    real, runs = RunningJob.report, 0
    folder: JobFolder = client.app.state.service.jobs.folder  # type: ignore[attr-defined]
    while True:
        runs, left = runs + 1, runs + 1

        def report(self: RunningJob, session: Any = None, runs: int = runs, **progress: Any) -> None:
            nonlocal left
            left -= 1
            if left == 0 and runs % 2:
                raise running_job.Interrupted
            real(self, session, **progress)
            if left == 0:
                with folder.found(self.id).open("ab") as file:
                    file.write(b'{"from": "a1", "to')
                raise running_job.Interrupted

        monkeypatch.setattr(RunningJob, "report", report)
        assert found(client, {}) == expected
        if left > 0:
            break
    assert runs > 4


def test_a_slow_search_that_is_cut_short_goes_on_where_it_was(
    client: httpx.Client, truth: dict[str, SE2], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each look-up may take seconds: what was looked up before a process ended is not looked up again."""
    assert truth
    now, asked = 0.0, list[str]()

    def slow(*given: Any, **options: Any) -> Any:
        nonlocal now
        now += 2.0
        if len(asked) in (1, 4):
            asked.append("a process ends")
            raise StorageBusy("a process ends")
        asked.append(given[-1].submap_id)
        return look_up(*given, **options)

    monkeypatch.setattr(constraints_job, "look_up", slow)
    monkeypatch.setattr(running_job, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(runner, "_LOOK", 0.01)
    assert pairs(found(client, {})) == ALL
    assert sorted(asked) == sorted([*truth, "a process ends", "a process ends"])


def test_only_constraints_come_in_formats(client: httpx.Client) -> None:
    job = finished(client, client.post("/v1/collections/plots/reindex"))
    assert client.get(job["links"]["results"], params={"format": "g2o"}).status_code == 410


def constraint(first: str, second: str, pose: SE2, inliers: int, trees: tuple[float, float] = (0.0, 0.0)) -> Any:
    seen = np.array([trees]) + np.array([[-10.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    uncertainty = least_squares(seen, pose, 0.01)
    return {
        "from": first,
        "to": second,
        "transform": transform_answer(pose, uncertainty),
        "inlier_count": inliers,
        "stale": False,
    }


def placed(frame_id: str, pose: SE2) -> StoredSubmap:
    return StoredSubmap(1, Place(frame_id, pose.x, pose.y, pose.yaw, None, 0.0, 0.0, 0.0, 0.0))


def test_two_finds_of_a_pair_have_to_agree() -> None:
    pose = SE2(3.0, -1.0, 2.0)
    near = SE2(3.1, -1.0, 2.01)
    kept, contradictions = agree([constraint("a", "b", pose, 10), constraint("b", "a", near.inverse(), 12)])
    assert ([(one["from"], one["inlier_count"]) for one in kept], contradictions) == ([("b", 12)], 0)
    kept, contradictions = agree([constraint("a", "b", pose, 10), constraint("b", "a", pose, 12)])
    assert (kept, contradictions) == ([], 1)
    third = constraint("a", "b", pose, 50)
    assert agree([constraint("a", "b", pose, 10), constraint("b", "a", pose, 12), third])[0] == []


def test_finds_agree_by_where_the_trees_come_to_lie() -> None:
    """Far from the origin, a turn that does not matter moves the origin by metres."""
    far = (3e6, 4e6)
    pose = SE2(3.0, -1.0, 0.4)
    here = pose.apply(np.array([far]))[0]
    turned = SE2.shift(here) @ SE2(0.01, 0.0, 1e-4) @ SE2.shift(here).inverse() @ pose
    assert math.hypot(turned.x - pose.x, turned.y - pose.y) > 100.0
    assert agree([constraint("a", "b", pose, 10, far), constraint("a", "b", turned, 12, far)])[1] == 0
    back = constraint("b", "a", turned.inverse(), 12, (float(here[0]), float(here[1])))
    assert agree([constraint("a", "b", pose, 10, far), back])[1] == 0


def vertices(text: bytes) -> dict[str, SE2]:
    lines = list(map(str.split, text.decode().splitlines()))
    names = {fields[1]: fields[2] for fields in lines if fields[0] == "#"}
    return {names[fields[1]]: SE2(*map(float, fields[2:5])) for fields in lines if fields[0] == "VERTEX_SE2"}


def test_g2o_starts_from_the_map_where_there_is_one() -> None:
    found = [constraint("a", "b", SE2(1.0, 0.0, math.pi / 2), 9), constraint("b", "c", SE2(2.0, 0.0, 0.0), 9)]
    starts = vertices(write_out(found, "g2o", {"b": placed("map", SE2(10.0, 20.0, 0.0))}))
    assert (starts["b"], starts["c"]) == (SE2(10.0, 20.0, 0.0), SE2(12.0, 20.0, 0.0))
    assert starts["a"].distance(SE2(10.0, 21.0, -math.pi / 2))[0] < 1e-12
    assert write_out([], "g2o", {}) == b""


@pytest.mark.parametrize("wanted", ["g2o", "g2o_middle"])
def test_g2o_of_a_frame_that_no_submap_has_names_those_there_are(client: httpx.Client, wanted: str) -> None:
    for name, frame_id, seed in (("a", "one", 1), ("b", "two", 2)):
        pose = {"frame_id": frame_id, "x": 0.0, "y": 0.0, "yaw": 0.0}
        place(client, name, forest(1), seed, map_pose=pose)
    job = finished(client, client.post(URL, json={}))
    results = job["links"]["results"]
    assert client.get(results, params={"format": wanted, "frame_id": "two"}).status_code == 200
    refused = client.get(results, params={"format": wanted, "frame_id": "tow"})
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert (error["parameter"], error["code"]) == ("frame_id", "not_found")
    assert "'one', 'two'" in error["detail"]


def test_g2o_starts_in_one_frame() -> None:
    """Poses in two robots' maps have nothing to do with each other."""
    step = SE2(2.0, 0.0, 0.0)
    found = [constraint(*pair, step, 9) for pair in (("a", "b"), ("b", "x"), ("x", "y"), ("k", "l"), ("m", "n"))]
    known = {
        "a": placed("one", SE2(5.0, 5.0, 0.0)),
        "b": placed("one", SE2(7.0, 5.0, 0.0)),
        "x": placed("two", SE2(-150.0, 40.0, 1.0)),
        "k": placed("two", SE2(60.0, 0.0, 2.0)),
        "l": placed("one", SE2(100.0, 0.0, 0.0)),
    }
    text = write_out(found, "g2o", known)
    starts = vertices(text)
    along = {"a": (5, 5), "b": (7, 5), "x": (9, 5), "y": (11, 5), "l": (100, 0), "k": (98, 0), "m": (0, 0)}
    for name, (x, y) in along.items():
        assert starts[name].distance(SE2(float(x), float(y), 0.0)) == pytest.approx((0.0, 0.0), abs=1e-9), name
    told = [line for line in text.decode().splitlines() if line.startswith("## component")]
    assert ["frame 'one'" in line for line in told] == [True, True, False]
    assert "no map frame" in told[2]
    other = vertices(write_out(found, "g2o", known, "two"))
    assert (other["x"], other["k"]) == (SE2(-150.0, 40.0, 1.0), SE2(60.0, 0.0, 2.0))
    assert other["a"].distance(SE2(-150.0, 40.0, 1.0) @ SE2(-4.0, 0.0, 0.0))[0] < 1e-9


def test_what_changed_since_is_stale(client: httpx.Client, truth: dict[str, SE2]) -> None:
    job = finished(client, client.post(URL, json={}))
    url, plots = job["links"]["results"], "/v1/collections/plots/submaps"

    def stale() -> dict[frozenset[str], bool]:
        answer = client.get(url)
        told = [orjson.loads(line) for line in answer.content.splitlines()]
        assert told == client.get(url, params={"format": "json"}).json()["constraints"]
        assert answer.headers["X-Stale-Constraints"] == str(sum(one["stale"] for one in told))
        graph = client.get(url, params={"format": "g2o"})
        assert graph.text.count("EDGE_SE2") == sum(not one["stale"] for one in told)
        assert graph.headers["X-Stale-Constraints"] == answer.headers["X-Stale-Constraints"]
        matrices = client.get(url, params={"format": "matrices"}).text.splitlines()
        assert len(matrices) == sum(not one["stale"] for one in told)
        return {frozenset((one["from"], one["to"])): one["stale"] for one in told}

    assert stale() == dict.fromkeys(ALL, False)
    # Where a submap is in a map, and what it is called, has nothing to do with how the trees lie.
    client.patch(f"{plots}/a1", json={"map_pose": {"x": 1, "y": 2, "yaw": 0}}).raise_for_status()
    assert stale() == dict.fromkeys(ALL, False)
    seen, _ = observed(forest(2), 77)
    client.put(f"{plots}/b1", json={"xy": seen}).raise_for_status()
    assert stale() == {pair: "b1" in pair for pair in ALL}
    client.delete(f"{plots}/a2").raise_for_status()
    assert stale() == {pair: bool({"b1", "a2"} & pair) for pair in ALL}
    # Another submap under the same name is not the one that was compared.
    client.put(f"{plots}/a2", json={"xy": seen}).raise_for_status()
    assert stale() == {pair: bool({"b1", "a2"} & pair) for pair in ALL}


def test_results_of_an_older_version_can_be_read(client: httpx.Client, truth: dict[str, SE2]) -> None:
    """They name neither revisions nor the middle of the trees."""
    job = finished(client, client.post(URL, json={}))
    folder: JobFolder = client.app.state.service.jobs.folder  # type: ignore[attr-defined]
    old = []
    for line in folder.results(job["id"]).read_bytes().splitlines():
        one = orjson.loads(line)
        covariance = one["transform"]["covariance"]
        transform = {name: one["transform"][name] for name in ("x", "y", "yaw")} | {"covariance": covariance}
        kept = ("from", "to", "inlier_count", "rms", "confidence", "from_session", "to_session")
        old.append(orjson.dumps({name: one[name] for name in kept} | {"transform": transform}) + b"\n")
    # What counts of a file is noted: what is written here must be as long.
    size = folder.results(job["id"]).stat().st_size
    old[-1] = old[-1].rstrip() + b" " * (size - sum(map(len, old))) + b"\n"
    folder.results(job["id"]).write_bytes(b"".join(old))
    url = job["links"]["results"]
    told = client.get(url, params={"format": "json"}).json()["constraints"]
    assert [one["stale"] for one in told] == [False] * len(ALL)
    assert client.get(url, params={"format": "g2o"}).text.count("EDGE_SE2") == len(ALL)
    client.delete("/v1/collections/plots/submaps/a1").raise_for_status()
    told = client.get(url, params={"format": "json"}).json()["constraints"]
    assert sum(one["stale"] for one in told) == 1
