"""Whatever is sent: a clear problem that says what to do, nothing stored, no traceback, never 500."""

import gc
import json
from collections.abc import Iterator
from typing import Any

import httpx
import orjson
import pytest
from pydantic import ValidationError

from server.config.settings import Limits
from server.errors import InvalidField, TooLarge
from server.submaps.described_batches import read_line
from tests.server.factories import forest, points, put_submap

PLOTS = "/v1/collections/plots"
SUBMAP = f"{PLOTS}/submaps/bad"
JSON = {"Content-Type": "application/json"}
GOOD = [[0, 0], [5, 1], [2, 6], [9, 9]]
AT = {"x": 0, "y": 0, "yaw": 0}
COVARIANCE = "/map_pose/covariance"


def problem(response: httpx.Response, status: int) -> dict[str, Any]:
    """The problem in a response, which must be a complete one."""
    assert response.status_code == status, response.text
    assert response.headers["Content-Type"] == "application/problem+json"
    content: dict[str, Any] = response.json()
    assert content["status"] == status
    assert content["type"].startswith("/problems/")
    assert content["detail"]
    assert content["request_id"] == response.headers["X-Request-Id"]
    assert len(response.content) < 8000
    assert "Traceback" not in response.text
    return content


def nothing_stored(client: httpx.Client) -> None:
    """No submap, no landmark."""
    assert client.get(PLOTS).json()["counts"] == {"submaps": 0, "landmarks": 0, "polygons": 0}
    assert client.get(SUBMAP).status_code == 404


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"xy=1",
        b'{"xy": [[1, NaN], [2, 3], [4, 5]]}',
        b'{"xy": [[1, Infinity], [2, 3], [4, 5]]}',
        b'{"xy": [[1, -Infinity], [2, 3], [4, 5]]}',
        b'{"xy": [[1, 1e999], [2, 3], [4, 5]]}',
        b'{"xy": [[1, 2],]}',
        b'{"frame_id": "\xff\xfe"}',
        b'{"frame_id": "\\ud800"}',
        b"[" * 100_000,
        b"[" * 100_000 + b"]" * 100_000,
        b'{"a":' * 50_000 + b"1" + b"}" * 50_000,
        "{'xy': 1}".encode("utf-16"),
    ],
)
@pytest.mark.parametrize("padding", [0, 100_000])
def test_what_is_not_json(shared_client: httpx.Client, body: bytes, padding: int) -> None:
    response = shared_client.put(SUBMAP, content=body + b" " * padding if body else body, headers=JSON)
    found = problem(response, 400 if body else 422)
    assert found["type"] == ("/problems/malformed-json" if body else "/problems/invalid-request")
    if b"NaN" in body or b"Infinity" in body:
        assert "NaN or Infinity" in found["detail"]
    nothing_stored(shared_client)


@pytest.mark.parametrize(
    ("body", "pointer", "code"),
    [
        ([], "", "model_attributes_type"),
        ("xy", "", "model_attributes_type"),
        (None, "", "model_attributes_type"),
        ({}, "", "no_landmarks"),
        ({"xy": "[[1, 2]]"}, "/xy", "list_type"),
        ({"xy": [1, 2, 3]}, "/xy/0", "tuple_type"),
        ({"xy": [[1, 2], [3], [4, 5]]}, "/xy/1", "too_short"),
        ({"xy": [[1, 2, 3]]}, "/xy/0", "too_long"),
        ({"xy": [["1", 2]]}, "/xy/0/0", "float_type"),
        ({"xy": [[True, 2]]}, "/xy/0/0", "float_type"),
        ({"xy": [[None, 2]]}, "/xy/0/0", "float_type"),
        ({"xy": [[1, 2]] * 2_500 + [[1, True]]}, "/xy/2500/1", "float_type"),
        ({"xy": [[1, 2]] * 2_500 + [[1, 2, 3]] + [[1, 2]] * 2_500}, "/xy/2500", "too_long"),
        ({"xy": GOOD, "colour": "red"}, "/colour", "extra_forbidden"),
        ({"xy": GOOD, "a/b~c": 1}, "/a~1b~0c", "extra_forbidden"),
        ({"xy": GOOD, "ids": ["a"]}, "", "ids_length"),
        ({"xy": GOOD, "ids": ["a", "b", "a", "c"]}, "/ids", "duplicate_id"),
        ({"xy": GOOD, "ids": [1, 2, 3, 4]}, "/ids/0", "string_type"),
        ({"xy": GOOD, "ids": ["a", "", "b", "c"]}, "/ids/1", "string_too_short"),
        ({"ids": ["a"]}, "", "ids_without_xy"),
        ({"xy": GOOD, "landmarks": []}, "", "two_forms"),
        ({"landmarks": [{"x": 1}]}, "/landmarks/0/y", "missing"),
        ({"landmarks": [{"x": 1, "y": 2, "dbh_cm": -1}]}, "/landmarks/0/dbh_cm", "greater_than"),
        ({"landmarks": [{"x": 1, "y": 2, "age": 9}]}, "/landmarks/0/age", "extra_forbidden"),
        ({"landmarks": [{"id": "a", "x": 1, "y": 2}, {"id": "a", "x": 3, "y": 4}]}, "/landmarks", "duplicate_id"),
        ({"xy": GOOD, "stamp": "2026-05-04T09:30:00"}, "/stamp", "value_error"),
        ({"xy": GOOD, "stamp": 1_770_000_000}, "/stamp", "value_error"),
        ({"xy": GOOD, "stamp": "9999-12-31T23:59:59-23:59"}, "/stamp", "value_error"),
        ({"xy": GOOD, "stamp": "0001-01-01T00:00:00+00:01"}, "/stamp", "value_error"),
        ({"xy": GOOD, "stamp": "2026-13-04T09:30:00Z"}, "/stamp", "datetime_from_date_parsing"),
        ({"xy": GOOD, "map_pose": {"x": 0, "y": 0}}, "/map_pose/yaw", "missing"),
        ({"xy": GOOD, "map_pose": {"x": 1e300, "y": 0, "yaw": 0}}, "/map_pose/x", "less_than_equal"),
        ({"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": 0, "covariance": [1]}}, "/map_pose/covariance", "too_short"),
        (
            {"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": 0, "covariance": [1, 2, 0, 0, 1, 0, 0, 0, 1]}},
            "/map_pose/covariance",
            "value_error",
        ),
        (
            {"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": 0, "covariance": [-1, 0, 0, 0, 1, 0, 0, 0, 1]}},
            "/map_pose/covariance",
            "value_error",
        ),
        # Variances are there, and it is symmetric; the eigenvalues are 6, 1 and -4.
        ({"xy": GOOD, "map_pose": AT | {"covariance": [1, 5, 0, 5, 1, 0, 0, 0, 1]}}, COVARIANCE, "value_error"),
        # The same in units that hide it.
        (
            {"xy": GOOD, "map_pose": AT | {"covariance": [1e4, 0, 1, 0, 1e4, 0, 1, 0, 1e-6]}},
            COVARIANCE,
            "value_error",
        ),
        ({"xy": GOOD, "map_pose": AT | {"covariance": [0, 0, 1, 0, 1, 0, 1, 0, 1]}}, COVARIANCE, "value_error"),
        ({"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": 90}}, "/map_pose/yaw", "value_error"),
        ({"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": -6.29}}, "/map_pose/yaw", "value_error"),
        ({"xy": GOOD, "map_pose": {"x": 0, "y": 0, "yaw": 0, "about": "middle"}}, "/map_pose/about", "literal_error"),
        ({"xy": GOOD, "properties": []}, "/properties", "dict_type"),
        ({"xy": GOOD, "properties": {"a": json.loads("[" * 300 + "]" * 300)}}, "/properties", "value_error"),
        ({"xy": GOOD, "session": "a\nb"}, "/session", "value_error"),
        ({"xy": GOOD, "frame_id": ""}, "/frame_id", "string_too_short"),
        ({"xy": GOOD, "session": "x" * 100_000}, "/session", "string_too_long"),
    ],
)
@pytest.mark.parametrize("padding", [0, 100_000])
def test_fields_that_cannot_be(shared_client: httpx.Client, body: Any, pointer: str, code: str, padding: int) -> None:
    """Long bodies are told of as short ones, though they are read elsewhere."""
    found = problem(shared_client.put(SUBMAP, content=json.dumps(body) + " " * padding, headers=JSON), 422)
    assert found["type"] == "/problems/invalid-request"
    if code == "datetime_from_date_parsing":
        code = found["errors"][0]["code"]
        assert code.startswith("datetime")
    assert [(entry["pointer"], entry["code"]) for entry in found["errors"]] == [(pointer, code)]
    assert found["errors"][0]["detail"]
    nothing_stored(shared_client)


@pytest.mark.parametrize(
    ("xy", "code"),
    [
        ([], "too_few"),
        ([[1, 2]], "too_few"),
        ([[1, 2], [3, 4]], "too_few"),
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "collinear"),
        ([[0, 0], [5, 1], [0, 0], [9, 9]], "duplicates"),
        ([[1e300, 0], [5, 1], [2, 6]], "out_of_range"),
    ],
)
def test_landmarks_that_make_no_submap(client: httpx.Client, xy: list[list[float]], code: str) -> None:
    found = problem(client.put(SUBMAP, json={"xy": xy}), 422)
    assert found["type"] == "/problems/invalid-landmarks"
    assert (found["errors"][0]["pointer"], found["errors"][0]["code"]) == ("/xy", code)
    if code == "duplicates":
        assert found["errors"][0]["indices"]
    as_landmarks = [{"x": x, "y": y} for x, y in xy]
    found = problem(client.put(SUBMAP, json={"landmarks": as_landmarks}), 422)
    assert found["errors"][0]["pointer"] == "/landmarks"
    nothing_stored(client)


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({}, ""),
        ({"xy": GOOD, "submap_id": "p"}, ""),
        ({"xy": GOOD, "limit": 0}, "/limit"),
        ({"xy": GOOD, "limit": 101}, "/limit"),
        ({"xy": GOOD, "limit": 2.5}, "/limit"),
        ({"xy": GOOD, "limit": "5"}, "/limit"),
        ({"xy": GOOD, "limit": 10**400}, "/limit"),
        ({"xy": GOOD, "method": "guess"}, "/method"),
        ({"xy": GOOD, "seed": -1}, "/seed"),
        ({"xy": GOOD, "seed": 2**63}, "/seed"),
        ({"xy": GOOD, "store": "yes"}, "/store"),
        ({"xy": GOOD, "exclude": {"sessions": []}}, "/exclude/sessions"),
        ({"xy": GOOD, "exclude": {"submap_ids": ["a b"]}}, "/exclude/submap_ids/0"),
        ({"submap_id": "a b"}, "/submap_id"),
        ({"xy": [[0, 0], [5, 1], [0, 0], [9, 9]]}, "/xy"),
    ],
)
def test_queries_that_cannot_be(client: httpx.Client, body: dict[str, Any], pointer: str) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    response = client.post(f"{PLOTS}/queries", content=json.dumps(body), headers=JSON)
    if body.get("limit") == 10**400:
        problem(response, 400)
    else:
        assert problem(response, 422)["errors"][0]["pointer"] == pointer


def test_many_wrong_things_make_a_short_problem(client: httpx.Client) -> None:
    fields = {f"field{i}": "x" * 1000 for i in range(2000)}
    found = problem(client.put(SUBMAP, json={"xy": GOOD} | fields), 422)
    assert 1 < len(found["errors"]) <= 20
    strings = json.dumps({"xy": [["a", "b"]] * 200_000})
    assert len(problem(client.put(SUBMAP, content=strings, headers=JSON), 422)["errors"]) <= 2


MANY = {f"k{i}": 1 for i in range(20_000)}


@pytest.mark.parametrize("body", [MANY, {"xy": GOOD, "map_pose": MANY}, {"landmarks": [{"x": 1, "y": 2}, MANY]}])
def test_objects_of_very_many_members_are_told_of_once(client: httpx.Client, body: dict[str, Any]) -> None:
    told = problem(client.put(SUBMAP, json=body), 422)
    assert [(entry["pointer"], entry["code"]) for entry in told["errors"]] == [("", "too_many_members")]
    line = orjson.dumps({"id": "bad", **body})
    with pytest.raises(InvalidField, match=r"2000\d members"):
        read_line(line, Limits())
    nothing_stored(client)


def test_bodies_of_very_many_values_are_refused_before_they_are_read(client: httpx.Client) -> None:
    empty = b'{"id": "bad", "xy": [' + b",".join([b"[]"] * 250_000) + b"]}"
    for method, path in (("PUT", SUBMAP), ("POST", f"{PLOTS}/queries/batch"), ("POST", f"{PLOTS}/submaps")):
        told = problem(client.request(method, path, content=empty, headers=JSON), 413)
        assert (told["limit"], told["allowed"], told["got"]) == ("body_values", 250_000, 250_002)
    with pytest.raises(TooLarge, match="body_values"):
        read_line(empty, Limits())
    most = b'{"xy": [' + b",".join([b"[]"] * 249_998) + b"]}"
    assert problem(client.put(SUBMAP, content=most, headers=JSON), 422)["errors"][0]["pointer"].startswith("/xy/0")
    nothing_stored(client)


def test_the_first_and_the_last_moment_are_answered_as_they_were_sent(client: httpx.Client) -> None:
    stamps = ["0001-01-01T00:00:00Z", "9999-12-31T23:59:59.999999Z"]
    for number, stamp in enumerate(stamps):
        put_submap(client, "plots", f"p{number}", number, stamp=stamp).raise_for_status()
    assert [one["stamp"] for one in client.get(f"{PLOTS}/submaps").json()["submaps"]] == stamps


def test_bodies_that_are_refused_leave_nothing_in_memory(client: httpx.Client) -> None:
    for _ in range(20):
        problem(client.put(SUBMAP, json={"xy": GOOD, "session": "a\nb"}), 422)
        problem(client.put(SUBMAP, json={"xy": 5}), 422)
    gc.collect()
    assert sum(isinstance(one, ValidationError) for one in gc.get_objects()) == 0


def test_large_bodies_are_not_taken_for_wide_ones(client: httpx.Client) -> None:
    trees = [{"x": x, "y": y, "dbh_cm": 30.0} for x, y in points(forest(1, count=300, radius=90.0))]
    properties = {f"k{i}": "value" for i in range(900)}
    body = {"landmarks": [tree | {"species": "x" * 128} for tree in trees], "properties": properties}
    assert len(json.dumps(body)) > 1 << 16
    assert client.put(SUBMAP, json=body).status_code == 201


@pytest.mark.parametrize(
    "headers",
    [
        {"Content-Type": "text/plain"},
        {"Content-Type": "application/x-www-form-urlencoded"},
        {"Content-Type": "application/json; charset=latin-1"},
        {"Content-Type": "application/geo+json"},
        {},
    ],
)
def test_content_types_that_are_not_json(client: httpx.Client, headers: dict[str, str]) -> None:
    body = json.dumps({"xy": points(forest(1))}).encode()
    found = problem(client.put(SUBMAP, content=body, headers=headers), 415)
    assert "application/json" in found["detail"] or "UTF-8" in found["detail"]
    nothing_stored(client)
    accepted = client.put(SUBMAP, content=body, headers={"Content-Type": "Application/JSON; Charset=UTF-8"})
    assert accepted.status_code == 201


def test_more_landmarks_than_allowed(client: httpx.Client) -> None:
    many = b'{"xy":[' + b",".join([b"[1,2]"] * 200_000) + b"]}"
    for response in (
        client.put(SUBMAP, content=many, headers=JSON),
        client.post(f"{PLOTS}/queries", content=many, headers=JSON),
    ):
        found = problem(response, 413)
        assert (found["limit"], found["allowed"], found["got"]) == ("landmarks", 20_000, 200_000)
    assert client.get("/v1/limits").json()["limits"]["landmarks"] == 20_000
    nothing_stored(client)


def test_properties_and_exclusions_have_limits(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    large = {"text": "x" * 20_000}
    for response in (
        client.put(SUBMAP, json={"xy": GOOD, "properties": large}),
        client.patch(f"{PLOTS}/submaps/p", json={"properties": large}),
    ):
        assert problem(response, 413)["limit"] == "properties_bytes"
    many = {"xy": GOOD, "exclude": {"submap_ids": [f"s{i}" for i in range(10_001)]}}
    assert problem(client.post(f"{PLOTS}/queries", json=many), 413)["limit"] == "excluded_submaps"


def test_large_bodies_with_and_without_length(client: httpx.Client) -> None:
    chunk = b" " * 65_536

    def chunks() -> Iterator[bytes]:
        for _ in range(20 * 16):
            yield chunk

    for content in (chunk * 20 * 16, chunks()):
        found = problem(client.put(SUBMAP, content=content, headers=JSON), 413)
        assert (found["limit"], found["allowed"]) == ("body_bytes", 8 * 1024 * 1024)
    nothing_stored(client)


def test_paths_and_methods_that_are_not_served(client: httpx.Client) -> None:
    for path in ("/nope", "/v1", "/v1/collections/", "/v1/collections/a%2Fb/submaps/x", "/v1//collections", "/%00"):
        problem(client.get(path), 404)
    found = client.post(SUBMAP, json={})
    problem(found, 405)
    assert found.headers["Allow"] == "DELETE, GET, HEAD, OPTIONS, PATCH, PUT"
    assert problem(client.request("BREW", "/livez"), 405)["type"] == "/problems/method-not-allowed"
    assert client.delete("/v1/collections").headers["Allow"] == "GET, HEAD, OPTIONS"
    assert client.put("/openapi.json").headers["Allow"] == "GET, HEAD, OPTIONS"


def test_unforeseen_failures_tell_nothing_but_an_id(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("secret path /etc")

    monkeypatch.setattr("server.routes.collections.crud.read", fail)
    response = client.get(PLOTS, headers={"X-Request-Id": "call-17"})
    found = problem(response, 500)
    assert found["request_id"] == "call-17"
    assert "secret" not in response.text
    assert "RuntimeError" not in response.text
