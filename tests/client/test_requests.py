"""What the client sends and how it reads answers, with a transport in place of a service."""

import re
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import httpx
import numpy as np
import pytest

from tests.client.fake import CANDIDATE, COLLECTION, RECEIPT, RESULT, SUBMAP, FakeService, client, sent, service
from urquhart_client import UNSET, Landmark, MapPose, QueryResult, Transform


def test_query_sends_the_landmarks_and_reads_the_result() -> None:
    fake = service(RESULT)
    result = client(fake).query("plots", np.array([[1.0, 2.0], [3.0, 4.5]]), ids=["a", "b"], limit=3, seed=7)
    assert sent(fake) == ("POST", "/v1/collections/plots/queries")
    assert fake.body == {"xy": [[1.0, 2.0], [3.0, 4.5]], "ids": ["a", "b"], "limit": 3, "seed": 7}
    assert fake.last.headers["content-type"] == "application/json"
    assert result.verdict == "matched"
    assert result.best is not None
    assert result.best.submap_id == "p7"
    assert result.best.inliers[0].submap == "t17"
    assert result.best.map_pose is not None
    assert result.best.map_pose.frame_id == "stand"
    assert result.stages[0].counts == {"polygons": 24}


def test_query_sends_what_is_asked_for_and_nothing_else() -> None:
    fake = service(RESULT)
    stamp = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)
    client(fake).query("plots", submap_id="p6", method="paper", store=True, stamp=stamp, exclude={"submap_ids": ["p5"]})
    assert fake.body == {
        "submap_id": "p6",
        "limit": 5,
        "method": "paper",
        "store": True,
        "stamp": "2026-05-04T09:30:00+00:00",
        "exclude": {"submap_ids": ["p5"]},
    }


def test_limits_of_an_answer_are_sent_where_they_are_given() -> None:
    fake = service(RESULT)
    client(fake).query("plots", [[1, 2]], pairs=False, timeout_ms=800)
    assert fake.body == {"xy": [[1.0, 2.0]], "limit": 5, "pairs": False, "timeout_ms": 800}
    fake = service({"results": [RESULT]})
    client(fake).query_batch("plots", [{"xy": []}], timeout_ms=800)
    assert fake.body == {"queries": [{"xy": []}], "timeout_ms": 800}


def test_landmarks_alone_are_patched() -> None:
    fake = service(SUBMAP)
    client(fake).patch_submap("plots", "p7", xy=[[1, 2]], ids=["a"])
    assert fake.body == {"xy": [[1.0, 2.0]], "ids": ["a"]}
    client(fake).patch_submap("plots", "p7", xy=[[1, 2]], dbh_cm=[30.0], session=None, stamp=None)
    assert fake.body == {"landmarks": [{"x": 1.0, "y": 2.0, "dbh_cm": 30.0}], "session": None, "stamp": None}
    with pytest.raises(ValueError, match="go with xy"):
        client(fake).patch_submap("plots", "p7", ids=["a"])


@pytest.mark.parametrize(
    ("point", "told"), [([1.0, 2.0, 3.0], "3 numbers: leave out what follows x and y"), ([1.0], "1 numbers$")]
)
def test_positions_of_other_than_two_numbers_are_named(point: list[float], told: str) -> None:
    with pytest.raises(ValueError, match=rf"positions are \[x, y\]; the one at 1 has {told}"):
        client(service(RESULT)).query("plots", xy=[[0.0, 0.0], point])


@pytest.mark.parametrize(
    ("xy", "told"),
    [
        ("abc", "xy must be a list of positions [x, y], not str"),
        (5, "xy must be a list of positions [x, y], not int"),
        ([1.0, 2.0], "positions are [x, y], two numbers; the one at 0 is 1.0"),
        ([[0, 0], ["a", 2]], "positions are [x, y], two numbers; the one at 1 is ['a', 2]"),
    ],
)
def test_what_is_no_list_of_positions_is_named(xy: Any, told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)):
        client(service(RESULT)).query("plots", xy)


def test_a_number_that_is_not_finite_is_named_with_its_place() -> None:
    with pytest.raises(ValueError, match="the number at /min_confidence is not finite: leave the member out, or"):
        client(service(RESULT)).query("plots", [[0, 0]], min_confidence=float("nan"))


def test_diameters_make_landmarks_of_points() -> None:
    fake = service(RESULT)
    client(fake).query("plots", [[1, 2], [3, 4]], dbh_cm=[31.0, None], explain=True)
    assert fake.body == {
        "landmarks": [{"x": 1.0, "y": 2.0, "dbh_cm": 31.0}, {"x": 3.0, "y": 4.0}],
        "limit": 5,
        "explain": True,
    }
    fake = service(RECEIPT, 201)
    client(fake).put_submap("plots", "p7", xy=np.eye(2), ids=["a", "b"], dbh_cm=np.array([np.nan, 20.0]))
    assert fake.body == {
        "landmarks": [{"id": "a", "x": 1.0, "y": 0.0}, {"id": "b", "x": 0.0, "y": 1.0, "dbh_cm": 20.0}]
    }
    for wrong in ({"xy": [[1, 2]], "dbh_cm": []}, {"xy": [[1, 2]], "ids": ["a", "b"], "dbh_cm": [10.0]}):
        with pytest.raises(ValueError, match="as many"):
            client(fake).put_submap("plots", "p7", **wrong)
    with pytest.raises(ValueError, match="carry their own"):
        client(fake).query("plots", landmarks=[{"x": 1, "y": 2}], dbh_cm=[30.0])
    with pytest.raises(ValueError, match="not both"):
        client(fake).query("plots", submap_id="p7", dbh_cm=[30.0])


def test_best_is_nothing_unless_matched() -> None:
    for verdict in ("ambiguous", "no_match"):
        assert QueryResult.model_validate(RESULT | {"verdict": verdict}).best is None
    assert QueryResult.model_validate(RESULT | {"candidates": []}).best is None


def test_fields_of_a_newer_service_are_passed_over() -> None:
    newer = RESULT | {"weather": "fog", "candidates": [CANDIDATE | {"canopy": {"closed": True}}]}
    result = client(service(newer)).query("plots", [[0, 0]])
    assert result.best is not None
    assert not hasattr(result.best, "canopy")


def test_transform_takes_query_points_to_the_submap() -> None:
    ((x, y),) = Transform(x=1.0, y=2.0, yaw=np.pi / 2).apply([(3.0, 0.0)])
    assert (x, y) == pytest.approx((1.0, 5.0))


def test_put_submap_sends_pose_stamp_and_conditions() -> None:
    fake = service(RECEIPT, 201)
    east = timezone(timedelta(hours=2))
    receipt = client(fake).put_submap(
        "plots",
        "p7",
        landmarks=[Landmark(id="t1", x=1, y=2, dbh_cm=30.0), {"id": "t2", "x": 3.0, "y": 4.0}],
        frame_id="plot_7",
        stamp=datetime(2026, 5, 4, 11, 30, tzinfo=east),
        session="s1",
        map_pose=MapPose(frame_id="map", x=1, y=2, yaw=0.5),
        properties={"observer": "robot-2"},
        if_match="4be1",
        if_none_match="*",
    )
    assert sent(fake) == ("PUT", "/v1/collections/plots/submaps/p7")
    assert fake.body == {
        "landmarks": [{"id": "t1", "x": 1.0, "y": 2.0, "dbh_cm": 30.0}, {"id": "t2", "x": 3.0, "y": 4.0}],
        "frame_id": "plot_7",
        "stamp": "2026-05-04T11:30:00+02:00",
        "session": "s1",
        "map_pose": {
            "frame_id": "map",
            "x": 1.0,
            "y": 2.0,
            "yaw": 0.5,
            "covariance_frame": "map",
            "about": "submap_origin",
        },
        "properties": {"observer": "robot-2"},
    }
    assert fake.last.headers["if-match"] == '"4be1"'
    assert fake.last.headers["if-none-match"] == "*"
    assert (receipt.outcome, receipt.etag) == ("created", "4be1")


def test_patch_tells_clearing_from_leaving() -> None:
    fake = service(SUBMAP)
    client(fake).patch_submap("plots", "p7", map_pose=None, properties=UNSET)
    assert fake.body == {"map_pose": None}
    client(fake).patch_submap("plots", "p7", map_pose={"frame_id": "map", "x": 0, "y": 0, "yaw": 0})
    assert fake.body == {"map_pose": {"frame_id": "map", "x": 0, "y": 0, "yaw": 0}}
    fake = service(COLLECTION)
    client(fake).patch_collection("plots", title="Plots", origin=None)
    assert sent(fake) == ("PATCH", "/v1/collections/plots")
    assert fake.body == {"title": "Plots", "origin": None}


def test_every_resource_has_its_request() -> None:
    fake = service(COLLECTION)
    there = client(fake)
    there.put_collection("plots", title="t", config={"step": 0.5}, crs="EPSG:32633", origin=(1, 2))
    assert sent(fake) == ("PUT", "/v1/collections/plots")
    assert fake.body == {"title": "t", "config": {"step": 0.5}, "crs": "EPSG:32633", "origin": [1.0, 2.0]}
    assert there.get_collection("plots").revision == 3
    assert sent(fake) == ("GET", "/v1/collections/plots")
    there.delete_collection("plots")
    assert sent(fake) == ("DELETE", "/v1/collections/plots")
    there.delete_submap("plots", "p7", if_match="4be1")
    assert sent(fake) == ("DELETE", "/v1/collections/plots/submaps/p7")
    assert fake.last.headers["if-match"] == '"4be1"'
    there.landing()
    there.live()
    assert sent(fake) == ("GET", "/livez")
    there.ready()
    assert sent(fake) == ("GET", "/readyz")
    fake = service(SUBMAP)
    assert client(fake).get_submap("plots", "p7").landmarks is None
    fake = service({"limits": {"landmarks": 20000}})
    assert client(fake).limits().limits["landmarks"] == 20000
    fake = service({"submap_id": "p7", "fingerprint": "5e2f", "triangles": [[0, 1, 2]], "polygons": []})
    assert client(fake).tessellation("plots", "p7").triangles == ((0, 1, 2),)
    fake = FakeService(httpx.Response(200, text="<svg/>"))
    assert client(fake).tessellation_svg("plots", "p7") == "<svg/>"
    assert fake.last.headers["accept"] == "image/svg+xml"
    assert client(fake).match_svg("plots", "17", rank=2) == "<svg/>"
    assert sent(fake) == ("GET", "/v1/collections/plots/queries/17/candidates/2/match")
    assert client(fake).explanation_svg("plots", "17") == "<svg/>"
    assert sent(fake) == ("GET", "/v1/collections/plots/queries/17/explanation")
    assert fake.last.headers["accept"] == "image/svg+xml"
    assert client(fake).metrics() == "<svg/>"


def test_ids_are_one_path_segment() -> None:
    fake = service(SUBMAP)
    client(fake, "http://service/proxied/").get_submap("plöts", "a/b?c#d e")
    assert fake.last.url.raw_path == b"/proxied/v1/collections/pl%C3%B6ts/submaps/a%2Fb%3Fc%23d%20e"
    for name in ("", ".", ".."):
        with pytest.raises(ValueError, match="cannot be the id of a submap"):
            client(fake).get_submap("plots", name)


def test_listing_fetches_pages_when_they_are_needed() -> None:
    pages = [
        httpx.Response(200, json={"submaps": [SUBMAP | {"id": "a"}, SUBMAP | {"id": "b"}], "next": "c1"}),
        httpx.Response(200, json={"submaps": [SUBMAP | {"id": "c"}]}),
    ]
    fake = FakeService(*pages)
    rows = client(fake).submaps(
        "plots", bbox=(0, 0, 10, 20.5), session="s", interval="../2026-01-01T00:00:00Z", page_size=2
    )
    assert fake.requests == []
    assert [next(rows).id, next(rows).id] == ["a", "b"]
    assert dict(fake.last.url.params) == {
        "bbox": "0.0,0.0,10.0,20.5",
        "session": "s",
        "datetime": "../2026-01-01T00:00:00Z",
        "limit": "2",
    }
    assert [row.id for row in rows] == ["c"]
    assert fake.last.url.params["cursor"] == "c1"
    assert len(fake.requests) == 2
    fake = service({"collections": [COLLECTION]})
    assert [one.id for one in client(fake).collections()] == ["plots"]


def test_what_cannot_be_sent_is_refused_before_it_is() -> None:
    fake = service(RESULT)
    there = client(fake)
    nan = float("nan")
    with pytest.raises(ValueError, match="/xy/1/0 is not finite"):
        there.query("plots", [[0.0, 0.0], [nan, 0.0]])
    with pytest.raises(ValueError, match="/landmarks/0/y is not finite"):
        there.query("plots", [[0.0, -float("inf")]], dbh_cm=[31.0])
    with pytest.raises(ValueError, match="/map_pose/yaw is not finite"):
        there.put_submap("plots", "p7", xy=[[0, 0]], map_pose={"x": 0, "y": 0, "yaw": nan})
    with pytest.raises(ValueError, match="/queries/1/min_confidence is not finite"):
        there.query_batch("plots", [{"submap_id": "a"}, {"submap_id": "b", "min_confidence": nan}])
    with pytest.raises(ValueError, match="either as xy"):
        there.query("plots")
    with pytest.raises(ValueError, match="either as xy"):
        there.put_submap("plots", "p7", xy=[[0, 0]], landmarks=[])
    with pytest.raises(ValueError, match="carry their own ids"):
        there.query("plots", landmarks=[{"id": "a", "x": 0, "y": 0}], ids=["a"])
    with pytest.raises(ValueError, match="not both"):
        there.query("plots", [[0, 0]], submap_id="p7")
    with pytest.raises(ValueError, match="time zone"):
        there.put_submap("plots", "p7", xy=[[0, 0]], stamp=datetime(2026, 5, 4))
    assert fake.requests == []


def test_the_client_closes_its_connections() -> None:
    with client(service(COLLECTION)) as there:
        there.get_collection("plots")
    with pytest.raises(RuntimeError):
        there.get_collection("plots")
