"""The client and the service agree: every call of the client, answered by the real thing."""

import contextlib
import time
import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime

import numpy as np
import pytest

from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe
from urquhart_client import Client, ConnectionFailed, MapPose, ProblemError, Retry

TREES = np.random.default_rng(7).uniform(-40.0, 40.0, (90, 2))
POSE = SE2(4.0, -3.0, 2.5)
SEEN = observe(TREES, POSE, Sensor(35.0, sigma=0.05, detection=0.95), np.random.default_rng(8))


def test_the_smallest_round_trip(client: Client) -> None:
    client.put_collection("plots")
    client.put_submap("plots", "p7", xy=TREES)
    result = client.query("plots", SEEN.xy, limit=5)
    assert (result.verdict, result.reason) == ("matched", "verified")
    best = result.best
    assert best is not None
    assert (best.rank, best.submap_id, best.refused) == (1, "p7", None)
    assert best.map_pose is None
    metres, radians = SE2(best.transform.x, best.transform.y, best.transform.yaw).distance(POSE)
    assert metres < 0.1
    assert radians < 0.01
    assert best.transform.covariance is not None
    right = [SEEN.trees[int(pair.query)] == int(pair.submap) for pair in best.inliers]
    assert all(right)
    assert len(right) == best.inlier_count
    moved = best.transform.apply([(float(x), float(y)) for x, y in SEEN.xy])
    residuals = [float(np.hypot(*(np.array(moved[int(p.query)]) - TREES[int(p.submap)]))) for p in best.inliers]
    np.testing.assert_allclose(residuals, [pair.residual for pair in best.inliers], atol=1e-6)
    assert {stage.name for stage in result.stages}


def test_stored_queries_are_listed_and_trees_of_a_map_frame_are_columns(client: Client) -> None:
    client.put_collection("plots")
    stamp = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
    place = MapPose(frame_id="map", x=400_000.0, y=50.0, yaw=0.0)
    client.put_submap("plots", "p7", xy=TREES, map_pose=place, session="mon", stamp=stamp)
    client.put_submap("plots", "p8", xy=np.random.default_rng(9).uniform(300.0, 400.0, (40, 2)), map_pose=place)
    kept = client.query("plots", SEEN.xy, store=True)
    missed = client.query("plots", SEEN.xy[:3], store=True)
    assert [one.id for one in client.queries("plots", page_size=1)] == [missed.id, kept.id]
    (found,) = client.queries("plots", verdict="matched")
    assert kept.best is not None
    assert (found.id, found.submap_id, found.inlier_count) == (kept.id, "p7", kept.best.inlier_count)
    columns = client.landmark_columns("plots", "map")
    assert (columns.submaps, columns.sessions, columns.stamps) == (("p7", "p8"), ("mon", None), (stamp, None))
    assert (columns.landmarks, columns.every, list(columns.counts)) == (130, 1, [90, 40])
    xy = np.asarray(columns.xy).reshape(-1, 2) + columns.origin
    np.testing.assert_allclose(xy[:90], TREES + (400_000.0, 50.0), atol=1e-3)
    assert client.landmark_columns("plots", "map", bbox=(399_900, 0, 400_100, 100), limit=45).submaps == ("p7",)
    assert len(client.landmark_columns("plots", "map", limit=45).xy) <= 90
    with pytest.raises(ProblemError, match="limit"):
        client.landmark_columns("plots", "map", limit=0)


def test_queries_can_be_kept_and_drawn(client: Client) -> None:
    client.put_collection("plots")
    ids = [f"t{i}" for i in range(len(TREES))]
    client.put_submap("plots", "p7", xy=TREES, ids=ids, map_pose=MapPose(frame_id="map", x=100.0, y=50.0, yaw=0.0))
    stamp = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
    kept = client.query("plots", SEEN.xy, store=True, explain=True, seed=3, frame_id="base", stamp=stamp)
    assert kept.id is not None
    assert (kept.frame_id, kept.stamp) == ("base", stamp)
    assert kept.best is not None
    assert kept.best.inliers[0].submap.startswith("t")
    assert kept.best.map_pose is not None
    assert kept.best.map_pose.x == pytest.approx(104.0, abs=0.1)
    survey = kept.best.survey
    assert survey is not None
    assert (survey.frame_id, survey.axes, survey.about) == ("map", ("x", "y"), "query_centre")
    assert survey.position == pytest.approx([a + b for a, b in zip(survey.centre, survey.shift, strict=True)])
    assert repr(survey).startswith("SurveyPose(x +")
    assert client.get_query("plots", kept.id) == kept
    assert ElementTree.fromstring(client.match_svg("plots", kept.id, 1)).tag.endswith("svg")
    assert client.query("plots", SEEN.xy, seed=3).id is None
    with pytest.raises(ProblemError) as caught:
        client.match_svg("plots", kept.id, 99)
    assert caught.value.status == 404


def test_answers_can_be_explained(client: Client) -> None:
    client.put_collection("plots")
    stems = 100.0 * np.random.default_rng(9).lognormal(-1.4, 0.4, len(TREES))
    client.put_submap("plots", "p7", xy=TREES, dbh_cm=stems)
    plain = client.query("plots", SEEN.xy)
    assert (plain.findings, plain.rivals) == (None, ())
    measured = [float(stems[tree]) if i else None for i, tree in enumerate(SEEN.trees)]
    result = client.query("plots", SEEN.xy, dbh_cm=measured, store=True, explain=True)
    assert result.sentences is not None and result.sentences[result.reason]
    assert result.best is not None
    assert plain.best is not None
    assert (result.best.evidence or 0.0) > (plain.best.evidence or 0.0) + 5.0
    assert result.gates is not None
    assert result.findings
    assert result.findings[0].log_odds > result.gates.log_odds
    assert result.id is not None
    told = client.explanation("plots", result.id)
    assert (told.verdict, told.findings, told.rivals) == (result.verdict, result.findings, result.rivals)
    assert told.sentences[told.reason]
    assert ElementTree.fromstring(client.explanation_svg("plots", result.id)).tag.endswith("svg")
    with pytest.raises(ProblemError) as caught:
        client.explanation("plots", "99")
    assert caught.value.status == 404


def test_rivals_of_a_row_of_trees(client: Client) -> None:
    rows = np.array([[2.5 * i, 2.5 * j] for i in range(9) for j in range(9)])
    rows += np.random.default_rng(1).normal(0.0, 0.02, rows.shape)
    client.put_collection("plots")
    client.put_submap("plots", "rows", xy=rows)
    result = client.query("plots", rows[[i for i in range(81) if i % 9 not in (0, 8)]])
    assert (result.verdict, result.best) == ("ambiguous", None)
    rival = result.rivals[0]
    assert (rival.submap_id, rival.transform.covariance) == ("rows", None)
    assert rival.evidence > 0.0
    assert rival.inlier_count > 10


def test_verdicts_without_a_pose(client: Client) -> None:
    client.put_collection("plots")
    client.put_submap("plots", "p7", xy=TREES)
    few = client.query("plots", [[0.0, 0.0], [1.0, 2.0]])
    assert (few.verdict, few.reason, few.best) == ("no_match", "too_few_landmarks", None)
    itself = client.query("plots", submap_id="p7")
    assert itself.verdict == "no_match"
    excluded = client.query("plots", TREES, exclude={"submap_ids": ["p7"]})
    assert excluded.verdict == "no_match"
    paper = client.query("plots", TREES, method="paper", seed=1)
    assert paper.method == "paper"


def test_collections_from_first_to_last(client: Client) -> None:
    made = client.put_collection("plots", title="Plots", crs="EPSG:32633", origin=(412000.0, 5820000.0))
    assert (made.id, made.title, made.origin) == ("plots", "Plots", (412000.0, 5820000.0))
    assert made.config
    assert client.put_collection("plots") == made
    with pytest.raises(ProblemError) as caught:
        client.put_collection("plots", title="Other")
    assert caught.value.status == 409
    assert client.patch_collection("plots", title="Other", crs=None).crs is None
    for name in ("b", "c", "d"):
        client.put_collection(name)
    assert [one.id for one in client.collections(page_size=3)] == ["plots", "b", "c", "d"]
    client.delete_collection("plots")
    with pytest.raises(ProblemError) as caught:
        client.get_collection("plots")
    assert caught.value.status == 404
    assert "plots" in caught.value.detail


def test_submaps_from_first_to_last(client: Client) -> None:
    client.put_collection("plots")
    stamp = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
    landmarks = [{"id": f"t{i}", "x": x, "y": y, "dbh_cm": 30.0} for i, (x, y) in enumerate(TREES.tolist())]
    first = client.put_submap("plots", "p1", landmarks=landmarks, stamp=stamp, session="s1", properties={"by": "us"})
    assert first.outcome == "created"
    assert first.counts["landmarks"] == len(TREES)
    again = client.put_submap("plots", "p1", landmarks=landmarks, stamp=stamp, session="s1", properties={"by": "us"})
    assert (again.outcome, again.etag) == ("unchanged", first.etag)
    with pytest.raises(ProblemError) as caught:
        client.put_submap("plots", "p1", xy=TREES, if_none_match="*")
    assert caught.value.status == 412
    with pytest.raises(ProblemError) as caught:
        client.put_submap("plots", "p1", xy=TREES, if_match="stale")
    assert caught.value.status == 412

    stored = client.get_submap("plots", "p1")
    assert stored.landmarks is not None
    assert (stored.landmarks[5].id, stored.landmarks[5].dbh_cm) == ("t5", 30.0)
    assert (stored.landmarks[5].x, stored.landmarks[5].y) == tuple(TREES[5])
    assert (stored.stamp, stored.session, stored.properties) == (stamp, "s1", {"by": "us"})

    pose = MapPose(frame_id="map", x=100.0, y=0.0, yaw=0.5)
    moved = client.patch_submap("plots", "p1", map_pose=pose, if_match=first.etag)
    assert moved.map_pose == pose
    assert moved.etag != first.etag
    assert client.patch_submap("plots", "p1", properties=None).properties is None

    client.put_submap("plots", "p2", xy=TREES + 500.0, session="s2")
    assert [one.id for one in client.submaps("plots", page_size=1)] == ["p1", "p2"]
    assert [one.id for one in client.submaps("plots", session="s2")] == ["p2"]
    assert [one.id for one in client.submaps("plots", bbox=(0.0, -100.0, 200.0, 100.0))] == ["p1"]
    assert [one.id for one in client.submaps("plots", interval="2026-01-01T00:00:00Z/..")] == ["p1"]

    seen = client.tessellation("plots", "p1")
    assert len(seen.landmarks) == len(TREES)
    assert seen.triangles
    assert len(seen.polygons) == seen.counts["polygons"]
    assert all(len(polygon.descriptor) > 0 for polygon in seen.polygons)
    assert ElementTree.fromstring(client.tessellation_svg("plots", "p1")).tag.endswith("svg")

    client.delete_submap("plots", "p1")
    assert [one.id for one in client.submaps("plots")] == ["p2"]


def test_refusals_say_where(client: Client) -> None:
    client.put_collection("plots")
    with pytest.raises(ProblemError) as caught:
        client.put_submap("plots", "p1", xy=[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    assert caught.value.status == 422
    assert caught.value.errors[0]["pointer"].startswith("/xy")
    with pytest.raises(ProblemError) as caught:
        client.query("moon", TREES)
    assert caught.value.status == 404
    with pytest.raises(ProblemError) as caught:
        client.put_collection("plots two")
    assert caught.value.status == 422


def test_the_service_tells_of_itself(client: Client) -> None:
    client.live()
    for _ in range(600):
        with contextlib.suppress(ProblemError):  # 503 until the kernels and the index are there
            client.ready()
            break
        time.sleep(0.1)
    client.ready()
    assert client.limits().limits["landmarks"] == 20000
    assert client.landing()
    assert "urquhart_" in client.metrics()


def test_a_port_where_nothing_listens() -> None:
    with Client("http://127.0.0.1:1", timeout=2.0, retry=Retry(attempts=1)) as nobody, pytest.raises(ConnectionFailed):
        nobody.live()
