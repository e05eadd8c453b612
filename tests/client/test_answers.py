"""How the client reads what is not the answer it asked for."""

import json

import httpx
import pytest

from tests.client.fake import CANDIDATE, RESULT, SUBMAP, FakeService, client, service
from urquhart_client import ConnectionFailed, ProblemError, UnexpectedAnswer


def test_a_problem_document_is_raised_whole() -> None:
    problem = {
        "type": "/problems/invalid-landmarks",
        "title": "Invalid landmarks",
        "status": 422,
        "detail": "The landmarks cannot be used.",
        "errors": [{"pointer": "/xy/3", "code": "not_finite", "detail": "is not a number"}],
        "request_id": "0c5f",
    }
    fake = FakeService(
        httpx.Response(
            422, content=json.dumps(problem), headers={"content-type": "application/problem+json", "retry-after": "2.5"}
        )
    )
    with pytest.raises(ProblemError) as caught:
        client(fake).query("plots", [[0, 0]])
    error = caught.value
    assert (error.status, error.type, error.title) == (422, "/problems/invalid-landmarks", "Invalid landmarks")
    assert error.detail == "The landmarks cannot be used."
    assert error.errors[0]["pointer"] == "/xy/3"
    assert error.members["request_id"] == "0c5f"
    assert error.retry_after == 2.5
    assert str(error) == "422 Invalid landmarks: The landmarks cannot be used. (/xy/3 is not a number)"


def test_what_is_wrong_is_said_once() -> None:
    entry = {"pointer": "/xy", "code": "too_few", "detail": "2 landmarks given"}
    problem = {"title": "No", "detail": "/xy: 2 landmarks given", "errors": [entry]}
    with pytest.raises(ProblemError) as caught:
        client(service(problem, 422)).ready()
    assert str(caught.value) == "422 No: /xy: 2 landmarks given"


@pytest.mark.parametrize("retry_after", ["Wed, 21 Oct 2026 07:28:00 GMT", "-1", "nan"])
def test_a_retry_after_that_is_no_delay_is_none(retry_after: str) -> None:
    with pytest.raises(ProblemError) as caught:
        client(service({"title": "Busy"}, 503, **{"retry-after": retry_after})).ready()
    assert caught.value.retry_after is None


@pytest.mark.parametrize(
    ("answered", "status"),
    [
        (httpx.Response(502, text="<html>bad gateway</html>"), 502),
        (httpx.Response(500, text="{", headers={"content-type": "application/json"}), 500),
        (httpx.Response(200, text="hello"), 200),
        (httpx.Response(200, json=[1, 2]), 200),
        (httpx.Response(200, json={"id": "plots"}), 200),
    ],
)
def test_answers_of_something_else_are_named(answered: httpx.Response, status: int) -> None:
    with pytest.raises(UnexpectedAnswer) as caught:
        client(FakeService(answered)).get_collection("plots")
    assert caught.value.status == status
    assert "http://service/v1/collections/plots" in str(caught.value)


def test_a_broken_page_is_named() -> None:
    with pytest.raises(UnexpectedAnswer, match="not a page of submaps"):
        list(client(service({"items": []})).submaps("plots"))


def test_a_connection_that_fails_is_named() -> None:
    def refuse(request: httpx.Request) -> httpx.Response:
        raise httpx.ConnectError("connection refused")

    with pytest.raises(ConnectionFailed, match=r"GET http://service/livez: connection refused"):
        client(refuse).live()


def test_an_answer_prints_on_one_line() -> None:
    pairs = [{"query": str(i), "submap": f"t{i}", "residual": 0.1} for i in range(200)]
    candidate = CANDIDATE | {"inliers": pairs, "inlier_count": 200}
    result = client(service(RESULT | {"id": "7", "candidates": [candidate] * 3})).query("plots", [[0, 0]])
    told = str(result)
    assert told == repr(result)
    assert told.startswith(
        "QueryResult(id='7', collection='plots', verdict='matched', reason='verified', best=Candidate("
    )
    assert "submap_id='p7', transform=Transform(x 1.000 m, y 2.000 m, yaw 90.00 deg)" in told
    assert "inlier_count=200" in told
    assert "candidates=<3>" in told
    assert len(told) < 400
    assert "\n" not in told
    landmarks = [{"id": str(i), "x": 1.0, "y": 2.0} for i in range(500)]
    submap = client(service(SUBMAP | {"landmarks": landmarks, "properties": {"a": "b" * 1000}})).get_submap(
        "plots", "p7"
    )
    assert "landmarks=<500>" in str(submap)
    assert len(str(submap)) < 200
