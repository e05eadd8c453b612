"""What holds for every route: methods, preconditions, parameters, codings, pointers."""

import gzip
import threading
from typing import Any

import httpx
import pytest

from server.app import create_app
from server.config.settings import Limits, Settings
from server.http import compression
from server.http.negotiation import accepts_coding
from tests.server.factories import TestClient, forest, points, put_submap
from tests.server.jobs.test_jobs import finished

PLOTS = "/v1/collections/plots"
SUBMAPS = f"{PLOTS}/submaps"


def body(seed: int, **fields: Any) -> dict[str, Any]:
    return {"xy": points(forest(seed)), **fields}


def first_error(response: httpx.Response, status: int = 422) -> dict[str, Any]:
    assert response.status_code == status, response.text
    error: dict[str, Any] = response.json()["errors"][0]
    return error


# ----------------------------------------------------------------- methods


@pytest.mark.parametrize(
    ("path", "allow"),
    [
        (PLOTS, "DELETE, GET, HEAD, OPTIONS, PATCH, PUT"),
        (SUBMAPS, "GET, HEAD, OPTIONS, POST"),
        (f"{PLOTS}/queries", "GET, HEAD, OPTIONS, POST"),
        ("/openapi.json", "GET, HEAD, OPTIONS"),
        ("/docs/assets/swagger-ui.css", "GET, HEAD, OPTIONS"),
    ],
)
def test_options_are_told_and_other_methods_refused(shared_client: httpx.Client, path: str, allow: str) -> None:
    told = shared_client.options(path)
    assert (told.status_code, told.content, told.headers["Allow"]) == (204, b"", allow)
    refused = shared_client.request("BREW", path)
    assert (refused.status_code, refused.headers["Allow"]) == (405, allow)
    assert refused.headers["Content-Type"] == "application/problem+json"
    if "HEAD" in allow:
        assert shared_client.head(path).status_code == 200
    else:
        assert shared_client.head(path).status_code == 405


def test_options_of_nothing(shared_client: httpx.Client) -> None:
    assert shared_client.options("/v1/nope").status_code == 404


# ----------------------------------------------------------- preconditions


def test_preconditions_of_a_collection_put(client: httpx.Client) -> None:
    url = "/v1/collections/new"
    absent = client.put(url, json={}, headers={"If-Match": "*"})
    assert absent.status_code == 412
    assert client.get(url).status_code == 404
    made = client.put(url, json={}, headers={"If-None-Match": "*"})
    assert made.status_code == 201
    again = client.put(url, json={}, headers={"If-None-Match": "*"})
    assert (again.status_code, again.headers["ETag"]) == (412, made.headers["ETag"])
    assert client.put(url, json={}, headers={"If-Match": '"other"'}).status_code == 412
    assert client.put(url, json={}, headers={"If-Match": made.headers["ETag"]}).status_code == 200


def test_an_unchanged_answer_says_what_it_varies_with(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    for path, vary in (
        (SUBMAPS + "/p", {"Accept-Encoding"}),
        (SUBMAPS + "/p/tessellation", {"Accept-Encoding", "Accept"}),
    ):
        whole = client.get(path)
        unchanged = client.get(path, headers={"If-None-Match": whole.headers["ETag"]})
        assert (unchanged.status_code, unchanged.content) == (304, b"")
        for response in (whole, unchanged):
            assert set(response.headers["Vary"].split(", ")) == vary


# -------------------------------------------------------------- parameters


@pytest.mark.parametrize("path", ["/v1/collections", SUBMAPS, f"{PLOTS}/sessions", f"{PLOTS}/stands", "/v1/jobs"])
@pytest.mark.parametrize("limit", ["", "0", "-1", "51", "+1", "1.0", "1_0", " 1", "1e1", "\u0661", "9" * 5000])
def test_limits_that_cannot_be(shared_client: httpx.Client, path: str, limit: str) -> None:
    assert first_error(shared_client.get(path, params={"limit": limit}))["parameter"] == "limit"


def test_who_asks_for_too_much_is_told_which_limit_it_is(client: httpx.Client) -> None:
    told = client.get("/v1/limits").json()["limits"]
    page = first_error(client.get(SUBMAPS, params={"limit": told["page_max"] + 1}))
    assert page["detail"] == "must be from 1 to 50: see `page_max` in GET /v1/limits"
    query = first_error(client.post(f"{PLOTS}/queries", json={"xy": [], "limit": told["candidates"] + 1}))
    assert query["detail"] == "must be at most 100: see `candidates` in GET /v1/limits"


def test_who_asks_for_no_number_of_candidates_gets_as_many_as_there_may_be(settings: Settings) -> None:
    few = settings.model_copy(update={"limits": Limits(candidates=1)})
    with TestClient(create_app(few)) as client:
        client.put(PLOTS, json={}).raise_for_status()
        for name in ("a", "b", "c"):
            put_submap(client, "plots", name, 1).raise_for_status()
        answers = [client.post(f"{PLOTS}/queries", json=body(1)), client.post(SUBMAPS, json=body(1, query={}))]
        assert [len(answer.json().get("query", answer.json())["candidates"]) for answer in answers] == [1, 1]
        for asked in (body(1, limit=2), body(1, limit=5)):
            first_error(client.post(f"{PLOTS}/queries", json=asked))
        assert first_error(client.post(SUBMAPS, json=body(1, query={"limit": 2})))["pointer"] == "/query/limit"
        job = finished(client, client.post(f"{PLOTS}/constraints", json={}))
        assert job["state"] == "successful"


@pytest.mark.parametrize(
    ("path", "sent", "told"),
    [
        (f"{PLOTS}/queries/batch", {"queries": []}, "must not be empty"),
        (f"{PLOTS}/constraints", {"submap_ids": []}, "must not be empty"),
        (f"{PLOTS}/queries", {"xy": [], "frame_id": ""}, "must not be empty"),
        (SUBMAPS, {"map_pose": {"x": 0, "y": 0, "yaw": 0, "covariance": [1]}}, "must have 9 entries, not 1"),
    ],
)
def test_what_is_too_short_is_told_so(shared_client: httpx.Client, path: str, sent: Any, told: str) -> None:
    assert first_error(shared_client.post(path, json=sent))["detail"] == told


def test_an_idempotency_key_that_cannot_be_is_told_in_words(shared_client: httpx.Client) -> None:
    for key, told in (("", "must not be empty"), ("a b", "must be of visible ASCII characters, without spaces")):
        refused = first_error(shared_client.post(SUBMAPS, json=body(1), headers={"Idempotency-Key": key}))
        assert (refused["parameter"], refused["detail"]) == ("idempotency-key", told)


@pytest.mark.parametrize("bbox", ["0,0,1_0,1", "", "0,0,1,1,", "-inf,0,1,1", "0;0;1;1"])
def test_boxes_that_cannot_be(shared_client: httpx.Client, bbox: str) -> None:
    assert first_error(shared_client.get(SUBMAPS, params={"bbox": bbox}))["parameter"] == "bbox"


def test_ids_may_be_escaped_in_paths(client: httpx.Client) -> None:
    made = client.put(f"{SUBMAPS}/%C3%A9t%C3%A9~1", json=body(1))
    assert made.status_code == 201
    assert made.json()["id"] == "\u00e9t\u00e9~1"
    for path in (made.headers["Location"], f"{SUBMAPS}/\u00e9t\u00e9%7E1"):
        assert client.get(path).json()["id"] == "\u00e9t\u00e9~1"
    for path in ("p%201", "%ff", "%2E%2E", "e%CC%81"):  # a space, no UTF-8, a folder, not composed
        assert first_error(client.get(f"{SUBMAPS}/{path}"))["parameter"] == "submap"


# ---------------------------------------------------- a question on the way


@pytest.mark.parametrize("method", ["POST", "PUT"])
def test_what_is_wrong_with_a_question_is_pointed_at_in_the_body(client: httpx.Client, method: str) -> None:
    url = SUBMAPS if method == "POST" else f"{SUBMAPS}/p"
    for options, pointer in (
        ({"limit": 1000}, "/query/limit"),
        ({"exclude": {"within_seconds": 5}}, "/query/exclude/within_seconds"),
        ({"near": {"x": 0, "y": 0}}, "/query/near/radius"),
    ):
        response = client.request(method, url, json=body(1, query=options))
        assert first_error(response)["pointer"] == pointer
        assert response.json()["detail"].startswith(f"{pointer}: ")
    assert client.get(SUBMAPS).json()["submaps"] == []


def test_as_many_may_be_excluded_on_the_way_as_in_a_query(client: httpx.Client) -> None:
    put_submap(client, "plots", "p", 1).raise_for_status()
    most = [f"x{i}" for i in range(10_000)]
    response = client.put(f"{SUBMAPS}/p", json=body(1, query={"exclude": {"submap_ids": most}}))
    assert response.status_code == 200
    assert response.json()["query"]["candidates"] == []
    more = client.put(f"{SUBMAPS}/p", json=body(1, query={"exclude": {"submap_ids": [*most, "y"]}}))
    assert (more.status_code, more.json()["limit"], more.json()["got"]) == (413, "excluded_submaps", 10_001)


def test_near_is_heeded_on_the_way(client: httpx.Client) -> None:
    pose = {"x": 0.0, "y": 0.0, "yaw": 0.0}
    put_submap(client, "plots", "here", 1, map_pose=pose).raise_for_status()
    for x, found in ((0.0, ["here"]), (5000.0, [])):
        options = {"near": {"x": x, "y": 0.0, "radius": 100.0}}
        answer = client.put(f"{SUBMAPS}/q", json=body(1, query=options)).json()["query"]
        assert [one["submap_id"] for one in answer["candidates"]] == found


# ----------------------------------------------------------------- codings


@pytest.mark.parametrize(
    ("header", "packed"),
    [
        ("gzip", True),
        ("x-gzip", True),
        ("GZIP;Q=0.3", True),
        ("*", True),
        ("identity;q=0.5, gzip", True),
        ("identity;q=0.5, *;q=0.8", True),
        ("gzip;q=0.5, identity;q=0.5", True),
        ("gzip;q=0.5, identity", False),
        ("gzip;q=0, *", False),
        ("identity, *;q=0", False),
        ("br", False),
        ("gzip;q=x", False),
        ("", False),
        (None, False),
    ],
)
def test_the_coding_that_is_preferred(header: str | None, packed: bool) -> None:
    assert accepts_coding(header, "gzip") is packed


def test_a_refused_coding_names_those_that_are_read(client: httpx.Client) -> None:
    headers = {"Content-Type": "application/json", "Content-Encoding": "br"}
    refused = client.put(PLOTS, content=b"{}", headers=headers)
    assert (refused.status_code, refused.headers["Accept-Encoding"]) == (415, "gzip, identity")


def test_large_answers_are_packed_beside_the_event_loop(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    threads: dict[int, str] = {}

    def noted(data: bytes, *arguments: Any, **named: Any) -> bytes:
        threads[len(data)] = threading.current_thread().name
        return gzip.compress(data, *arguments, **named)

    monkeypatch.setattr(compression, "compress", noted)
    client.put(f"{SUBMAPS}/small", json={"xy": points(forest(1))}).raise_for_status()
    large = [[float(x) + 0.01 * y, float(y)] for x in range(50) for y in range(40)]
    client.put(f"{SUBMAPS}/large", json={"xy": large}).raise_for_status()
    for name in ("small", "large"):
        plain = client.get(f"{SUBMAPS}/{name}", headers={"Accept-Encoding": "identity"})
        packed = client.get(f"{SUBMAPS}/{name}", headers={"Accept-Encoding": "gzip"})
        assert packed.headers["Content-Encoding"] == "gzip"
        assert packed.content == plain.content
    small, big = (threads[size] for size in sorted(threads))
    assert "AnyIO worker" in big
    assert "AnyIO worker" not in small


def test_how_long_answers_are_kept_is_published(client: httpx.Client) -> None:
    assert client.get("/v1/limits").json()["retention"]["idempotency_hours"] == 24.0


def test_preconditions_may_come_in_several_lines(client: httpx.Client) -> None:
    etag = put_submap(client, "plots", "p", 1).headers["ETag"]
    matching = [("If-Match", '"other"'), ("If-Match", etag)]
    assert client.put(f"{SUBMAPS}/p", json=body(2), headers=matching).status_code == 200
    absent = [("If-None-Match", '"other"'), ("If-None-Match", "*")]
    assert client.put(f"{SUBMAPS}/p", json=body(3), headers=absent).status_code == 412
    assert client.get(f"{SUBMAPS}/p", headers=absent).status_code == 304


def test_pages_of_problems_differ_by_accept(client: httpx.Client) -> None:
    for accept in ("text/html", "application/json"):
        page = client.get("/problems/gone", headers={"Accept": accept})
        assert page.headers["Content-Type"].startswith(accept)
        assert "Accept" in page.headers["Vary"].split(", ")


def test_a_key_that_comes_twice_is_no_key(client: httpx.Client) -> None:
    headers = [("Idempotency-Key", "a"), ("Idempotency-Key", "b")]
    assert first_error(client.post(SUBMAPS, json=body(1), headers=headers))["parameter"].lower() == "idempotency-key"
    assert client.get(SUBMAPS).json()["submaps"] == []
